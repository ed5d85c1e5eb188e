from pathlib import Path

import pytest

from polarsim.rover.soil.law import Soil, read_soil

SOILS = Path(__file__).parents[2] / "config" / "soils.csv"


@pytest.fixture
def lunar() -> Soil:
    return read_soil(SOILS, "lunar")


@pytest.fixture
def hit() -> Soil:
    return read_soil(SOILS, "hit-simulant")
