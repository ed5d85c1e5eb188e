"""A driven wheel at steady slip, against integrals that were worked out apart."""

import numpy as np
import pytest

from polarsim.errors import RoverError
from polarsim.rover.soil.law import read_soil
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_rig import LOAD_A, LOAD_B, WHEEL_A, WHEEL_B
from tests.rover.conftest import SOILS

# Prototype integrals made for this project before the code: slip, sinkage mm, pull N, torque N m.
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
def test_the_limit_is_the_one_that_was_worked_out_apart(name, wheel, load, rows):
    law = read_soil(SOILS, name).law(slip_sinkage=False)
    for slip, sinkage_mm, pull, torque in rows:
        found = steady_wheel(wheel, law, load, slip)
        # The prototype rounded to 0.01 mm, 0.1 N, 0.01 N m.
        np.testing.assert_allclose(
            [1000 * found.sinkage, found.pull, found.torque], [sinkage_mm, pull, torque], atol=0.06, rtol=2e-3
        )


def test_slip_sinks_a_wheel_as_deep_as_measured():
    """Ding et al. (2010): 3 to 7 times the static sinkage at slip 0.6."""
    for name, wheel, load in (("lunar", WHEEL_A, LOAD_A), ("hit-simulant", WHEEL_B, LOAD_B)):
        law = read_soil(SOILS, name).law()
        factor = steady_wheel(wheel, law, load, 0.6).sinkage / steady_wheel(wheel, law, load, 0.0).sinkage
        assert 3 < factor < 7, name


def test_a_soil_that_cannot_bear_a_load_says_so():
    with pytest.raises(RoverError):
        steady_wheel(WHEEL_A, read_soil(SOILS, "lunar").law(), 1e5, 0.2)
