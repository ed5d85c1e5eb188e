"""Soils against wheels that NASA measured."""

from pathlib import Path

import numpy as np
import pytest

from polarsim.rover.soil.check import TILT_BED, TREC, misses_deg
from polarsim.rover.soil.law import read_soil

SOILS = Path(__file__).parents[3] / "config" / "soils.csv"


@pytest.mark.parametrize(("curve", "soil", "within_deg"), [(TREC, "trec-grc3", 3.0), (TILT_BED, "mgru3-tilt-bed", 1.5)])
def test_fitted_soils_pull_as_nasa_measured(curve, soil, within_deg):
    misses = misses_deg(curve, read_soil(SOILS, soil).law())
    assert np.sqrt((misses**2).mean()) < within_deg
