"""The tables of the soil's checks have the columns and types that readers are told."""

from pathlib import Path

import pandas as pd

from polarsim.formats.schemas import SOIL_LIMIT, SOIL_MEASURED
from polarsim.rover.soil import check

SOILS = Path(__file__).parents[3] / "config/soils.csv"


def test_both_tables_have_the_types_of_their_schemas(tmp_path, monkeypatch):
    monkeypatch.setattr(check, "SLIPS", (0.2,))
    check.check_soil(soils=SOILS, limit=tmp_path / "limit.parquet", measured_slopes=tmp_path / "measured.parquet")
    for name, schema in (("limit", SOIL_LIMIT), ("measured", SOIL_MEASURED)):
        table = pd.read_parquet(tmp_path / f"{name}.parquet")
        assert table.dtypes.astype(str).to_dict() == schema.dtypes
