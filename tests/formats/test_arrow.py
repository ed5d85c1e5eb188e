import numpy as np
import pandas as pd
import pyarrow as pa

from polarsim.formats import arrow

TABLE = pd.DataFrame(
    {"key": ["b", "a", "b"], "rock": [1, -1, 7], "iou": [0.5, np.nan, 0.25], "right": [True, False, True]}
)


def test_columns_read_back_as_narrow_numbers_and_texts():
    back = pa.ipc.open_file(arrow.encode_arrow(TABLE)).read_pandas()
    assert back["key"].tolist() == ["b", "a", "b"]
    assert back["rock"].dtype == np.int32
    assert back["iou"].dtype == np.float32
    np.testing.assert_array_equal(back["iou"], [0.5, np.nan, 0.25])
    assert back["right"].tolist() == [1, 0, 1]


def test_a_table_is_a_single_batch_without_nulls():
    file = pa.ipc.open_file(arrow.encode_arrow(TABLE))
    assert file.num_record_batches == 1
    assert all(column.null_count == 0 for column in file.read_all().columns)


def test_a_table_without_rows_keeps_its_columns():
    assert list(pa.ipc.open_file(arrow.encode_arrow(TABLE.iloc[:0])).read_pandas().columns) == list(TABLE.columns)
