"""Tables of a run have the declared columns."""

import pandas as pd
import pytest

from polarsim.schemas.__main__ import REPORT_TABLES, STAGE_TABLES
from polarsim.schemas.report import ORIGIN

PATTERNS = {"TerrainTT": "Terrain01", "<split>": "*", "<seed>": "*", "<domain>": "*", "<trained>_on_<evaluated>": "*"}


@pytest.mark.slow
def test_every_table_of_a_small_run_has_the_columns_that_are_declared(small):
    run, checked = small / "results/small", 0
    origin = [name for one in ORIGIN for name in one.each]
    for table in (*REPORT_TABLES[1:], *STAGE_TABLES):
        expected = [*(origin if table in REPORT_TABLES else []), *table.columns]
        pattern = table.path if table in STAGE_TABLES else f"{table.path}.parquet"
        for part, found in PATTERNS.items():
            pattern = pattern.replace(part, found)
        for path in run.glob(pattern):
            if "*_" in table.path and path.name.startswith("meshes_"):
                continue  # separate table
            read = pd.read_parquet if path.suffix == ".parquet" else pd.read_csv
            assert list(read(path).columns) == expected, path
            checked += 1
    assert checked > 30
