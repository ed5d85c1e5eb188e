import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats.tables import FORMER_NAMES, read_csv, read_parquet, write_csv, write_parquet


@pytest.mark.parametrize(("read", "write"), [(read_csv, write_csv), (read_parquet, write_parquet)])
def test_a_column_that_is_missing_is_named_and_its_former_name_too(tmp_path, read, write):
    path = tmp_path / "table"
    write(path, pd.DataFrame({"judge": ["compact"], "imgsz": [320]}))
    assert read(path, ["imgsz"]).columns.tolist() == ["judge", "imgsz"]
    with pytest.raises(FormatError, match=r"column 'epochs' is missing$"):
        read(path, ["imgsz", "epochs"])
    with pytest.raises(FormatError, match="column 'detector' is missing; it has 'judge', the former name"):
        read(path, ["detector"])


def test_no_column_has_the_former_name_of_another_one():
    assert not set(FORMER_NAMES) & set(FORMER_NAMES.values())
