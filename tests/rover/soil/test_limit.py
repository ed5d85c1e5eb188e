"""Driven wheel at steady slip, compared with independent integrals."""

import numpy as np
import pytest

from polarsim.errors import RoverError
from polarsim.rover.soil.law import read_soil
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_rig import LOAD_A, LOAD_B, WHEEL_A, WHEEL_B
from tests.rover.conftest import SOILS

# Trapezoidal sums of 4,000 steps of nodes and points of the rim: slip, sinkage mm, pull N, torque N m.
LIMIT_A = [
    (0, 17.113, -12.913, 2.858),
    (0.05, 17.0, 3.491, 6.913),
    (0.2, 16.751, 36.786, 15.141),
    (0.8, 16.362, 79.074, 25.584),
]
LIMIT_B = [(0, 9.017, -6.783, 0.507), (0.1, 8.944, 3.871, 2.169), (0.6, 8.759, 27.449, 5.845)]
ON_EARTH = [(0.2, 53.844, 270.649, 132.074), (0.6, 52.675, 374.518, 156.924)]


@pytest.mark.parametrize(
    ("name", "wheel", "load", "rows"),
    [
        ("lunar", WHEEL_A, LOAD_A, LIMIT_A),
        ("hit-simulant", WHEEL_B, LOAD_B, LIMIT_B),
        ("lunar", WHEEL_A, 1054.6, ON_EARTH),
    ],
)
def test_the_limit_equals_independent_integrals(name, wheel, load, rows):
    law = read_soil(SOILS, name).law(slip_sinkage=False)
    for slip, sinkage_mm, pull, torque in rows:
        steady = steady_wheel(wheel, law, load, slip)
        np.testing.assert_allclose(
            [1000 * steady.sinkage, steady.pull, steady.torque], [sinkage_mm, pull, torque], atol=0.001, rtol=1e-4
        )


def test_slip_sinkage_is_as_measured():
    """Ding et al. (2010): 3 to 7 times the static sinkage at slip 0.6."""
    for name, wheel, load in (("lunar", WHEEL_A, LOAD_A), ("hit-simulant", WHEEL_B, LOAD_B)):
        law = read_soil(SOILS, name).law()
        factor = steady_wheel(wheel, law, load, 0.6).sinkage / steady_wheel(wheel, law, load, 0.0).sinkage
        assert 3 < factor < 7, name


def test_a_load_too_large_for_the_soil_is_an_error():
    with pytest.raises(RoverError):
        steady_wheel(WHEEL_A, read_soil(SOILS, "lunar").law(), 1e5, 0.2)
