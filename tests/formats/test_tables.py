import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats.tables import key_columns, read_csv, read_parquet, typed, write_csv, write_parquet
from polarsim.photo import PhotoKey
from polarsim.schemas.photos import PHOTOS
from tests.support.other_site import other_site

NAMED = next(other_site().photos_of("yard-a"))
_FILE = ("width", "height", "bits", "sha256", "path")


@pytest.mark.parametrize(("read", "write"), [(read_csv, write_csv), (read_parquet, write_parquet)])
def test_a_missing_column_is_an_error(tmp_path, read, write):
    path = tmp_path / "table"
    write(path, pd.DataFrame({"detector": ["compact"], "imgsz": [320]}))
    assert read(path, ["imgsz"]).columns.tolist() == ["detector", "imgsz"]
    with pytest.raises(FormatError, match="'epochs'") as error:
        read(path, ["imgsz", "epochs"])
    assert error.value.path == path


def test_terrains_are_numbers_or_names_in_every_table(tmp_path):
    of_number, of_name = (key_columns(key) for key in (PhotoKey.parse("01_A_off_180_L_0256"), NAMED))
    numbers, names = typed([of_number], PHOTOS, without=_FILE), typed([of_name], PHOTOS, without=_FILE)
    assert (numbers.dtypes["terrain"], names.dtypes["terrain"]) == ("int64", "str")
    assert typed([], PHOTOS, without=_FILE).dtypes["terrain"] == "int64"
    joined = typed(pd.concat([typed([], PHOTOS, without=_FILE), names]), PHOTOS, without=_FILE)
    pd.testing.assert_frame_equal(joined, names)
    for table, row in ((numbers, of_number), (names, of_name)):
        write_csv(tmp_path / "t.csv", table)
        write_parquet(tmp_path / "t.parquet", table)
        for read in (read_csv(tmp_path / "t.csv"), read_parquet(tmp_path / "t.parquet")):
            pd.testing.assert_frame_equal(read, table)
            assert read.to_dict("records") == [row]


def test_a_name_of_a_terrain_is_not_read_as_a_number(tmp_path):
    (tmp_path / "t.csv").write_text("terrain,position,value\n1e5,1,1\n1e6,,\n")
    table = read_csv(tmp_path / "t.csv")
    assert table["terrain"].tolist() == ["1e5", "1e6"]
    assert table["position"].isna().tolist() == [False, True]  # an empty field has no value
    assert table["value"].isna().tolist() == [False, True]
