import pandas as pd

from polarsim.detect.gather_tables import gather_tables
from polarsim.formats import tables


def test_every_row_says_its_split_and_seed(tmp_path):
    parts = []
    for number, value in enumerate((0.1, 0.2, 0.3)):
        parts.append(tmp_path / f"{number}.parquet")
        tables.write_parquet(parts[-1], pd.DataFrame({"ipd": [value]}))
    splits, seeds = ["photo", "photo", "terrain"], [0, 7, 0]
    gather_tables(parts={"ipd": parts}, tables={"ipd": tmp_path / "all.parquet"}, splits=splits, seeds=seeds)
    table = tables.read_parquet(tmp_path / "all.parquet")
    assert table.to_dict("list") == {"split": splits, "seed": seeds, "ipd": [0.1, 0.2, 0.3]}


def test_an_existing_split_column_is_kept(tmp_path):
    tables.write_parquet(tmp_path / "a.parquet", pd.DataFrame({"trained": ["real"], "split": ["view"], "map50": [0.5]}))
    parts = {"detection": [tmp_path / "a.parquet"]}
    gather_tables(parts=parts, tables={"detection": tmp_path / "all.parquet"}, splits=["view"], seeds=[3])
    assert list(tables.read_parquet(tmp_path / "all.parquet").columns) == ["trained", "split", "seed", "map50"]
