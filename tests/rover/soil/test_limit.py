"""A driven wheel at steady slip, against integrals that were worked out apart."""

from pathlib import Path

import numpy as np
import pytest

from polarsim.errors import RoverError
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.shapes import Wheel

SOILS = Path(__file__).parents[3] / "config" / "soils.csv"


WHEEL_A, WHEEL_B = Wheel(0.25, 0.20), Wheel(0.15735, 0.165)


# Prototype integrals made for this project before the code: slip, sinkage mm, pull N, torque N m.
LIMIT_A = [(0, 17.11, -12.9, 2.86), (0.05, 17.00, 3.5, 6.91), (0.2, 16.71, 42.7, 16.60), (0.8, 16.17, 91.5, 28.66)]


LIMIT_B = [(0, 9.02, -6.8, 0.51), (0.1, 8.94, 4.4, 2.25), (0.6, 8.67, 35.9, 7.17)]


TERRAIN_A = [(0, 17.21, -12.0, 3.02), (0.2, 17.21, 58.1, 20.37), (0.6, 17.21, 118.3, 35.18)]


TERRAIN_B = [(0, 9.04, -3.3, 1.03), (0.4, 9.04, 38.6, 7.57)]


@pytest.mark.parametrize(
    ("name", "wheel", "load", "terrain", "rows"),
    [
        ("lunar", WHEEL_A, 174.15, False, LIMIT_A),
        ("hit-simulant", WHEEL_B, 80, False, LIMIT_B),
        ("lunar", WHEEL_A, 174.15, True, TERRAIN_A),
        ("hit-simulant", WHEEL_B, 80, True, TERRAIN_B),
    ],
)
def test_the_limit_is_the_one_that_was_worked_out_apart(name, wheel, load, terrain, rows):
    law = read_soil(SOILS, name).law(slip_sinkage=False)
    for slip, sinkage_mm, pull, torque in rows:
        found = steady_wheel(wheel, law, load, slip, terrain)
        # The prototype rounded to 0.01 mm, 0.1 N, 0.01 N m.
        np.testing.assert_allclose(
            [1000 * found.sinkage, found.pull, found.torque], [sinkage_mm, pull, torque], atol=0.06, rtol=1e-3
        )


def test_a_wheel_on_earth_meets_the_limit_that_was_worked_out_apart():
    law = read_soil(SOILS, "lunar").law(slip_sinkage=False)
    for slip, sinkage_mm, pull, torque in [(0.2, 53.8, 272, 132.5), (0.6, 52.3, 398, 162.5)]:
        found = steady_wheel(WHEEL_A, law, 1054.6, slip)
        np.testing.assert_allclose(
            [1000 * found.sinkage, found.pull, found.torque], [sinkage_mm, pull, torque], rtol=2e-3
        )


def test_slip_sinks_a_wheel_as_deep_as_measured():
    """Ding et al. (2010): 3 to 7 times the static sinkage at slip 0.6."""
    for name, wheel, load in (("lunar", WHEEL_A, 174.15), ("hit-simulant", WHEEL_B, 80)):
        law = read_soil(SOILS, name).law()
        factor = steady_wheel(wheel, law, load, 0.6).sinkage / steady_wheel(wheel, law, load, 0.0).sinkage
        assert 3 < factor < 7, name


def test_a_soil_that_cannot_bear_a_load_says_so():
    with pytest.raises(RoverError, match="sinks to its axle"):
        steady_wheel(WHEEL_A, read_soil(SOILS, "lunar").law(), 1e5, 0.2)
