"""Driven wheel at steady slip, compared with independent integrals."""

import numpy as np
import pytest

from polarsim.errors import RoverError
from polarsim.rover.soil.law import read_soil
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_rig import LOAD_A, LOAD_B, WHEEL_A, WHEEL_B
from tests.rover.conftest import SOILS

# Integrals of a prototype that preceded the code: slip, sinkage mm, pull N, torque N m.
LIMIT_A = [(0, 17.11, -12.9, 2.86), (0.05, 17.00, 3.5, 6.91), (0.2, 16.71, 42.7, 16.60), (0.8, 16.17, 91.5, 28.66)]
LIMIT_B = [(0, 9.02, -6.8, 0.51), (0.1, 8.94, 4.4, 2.25), (0.6, 8.67, 35.9, 7.17)]


@pytest.mark.parametrize(
    ("name", "wheel", "load", "rows"),
    [
        ("lunar", WHEEL_A, LOAD_A, LIMIT_A),
        ("hit-simulant", WHEEL_B, LOAD_B, LIMIT_B),
        ("lunar", WHEEL_A, 1054.6, [(0.2, 53.8, 272, 132.5), (0.6, 52.3, 398, 162.5)]),  # on Earth
    ],
)
def test_the_limit_equals_independent_integrals(name, wheel, load, rows):
    law = read_soil(SOILS, name).law(slip_sinkage=False)
    for slip, sinkage_mm, pull, torque in rows:
        steady = steady_wheel(wheel, law, load, slip)
        # The prototype rounded to 0.01 mm, 0.1 N, 0.01 N m.
        np.testing.assert_allclose(
            [1000 * steady.sinkage, steady.pull, steady.torque], [sinkage_mm, pull, torque], atol=0.06, rtol=2e-3
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
