import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats.tables import read_csv, read_parquet, write_csv, write_parquet


@pytest.mark.parametrize(("read", "write"), [(read_csv, write_csv), (read_parquet, write_parquet)])
def test_a_missing_column_is_an_error(tmp_path, read, write):
    path = tmp_path / "table"
    write(path, pd.DataFrame({"detector": ["compact"], "imgsz": [320]}))
    assert read(path, ["imgsz"]).columns.tolist() == ["detector", "imgsz"]
    with pytest.raises(FormatError, match="'epochs'") as error:
        read(path, ["imgsz", "epochs"])
    assert error.value.path == path
