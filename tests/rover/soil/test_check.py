"""The tables of the soil's checks have the columns and types that readers are told."""

from pathlib import Path

import pandas as pd

from polarsim.report.rover_table import with_slopes
from polarsim.rover.soil import check, published
from polarsim.schemas.soil import SOIL_CHECKS, SOIL_LIMIT, SOIL_MEASURED

SOILS = Path(__file__).parents[3] / "config/soils.csv"


def test_all_tables_have_the_types_of_their_schemas(tmp_path, monkeypatch):
    monkeypatch.setattr(check, "SLIPS", (0.2,))
    paths = {name: tmp_path / f"{name}.parquet" for name in ("limit", "measured_slopes", "checks")}
    published.check_soil(soils=SOILS, **paths)
    found = {name: pd.read_parquet(path) for name, path in paths.items()}
    for name, schema in (("limit", SOIL_LIMIT), ("measured_slopes", SOIL_MEASURED), ("checks", SOIL_CHECKS)):
        assert found[name].dtypes.astype(str).to_dict() == schema.dtypes
    together = with_slopes(found["checks"], found["measured_slopes"])
    assert len(together) == len(found["checks"]) + len(found["measured_slopes"])
    assert together.notna().all(axis=None)
