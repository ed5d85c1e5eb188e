"""Classification of unannotated regions as rocks by shape."""

import numpy as np
import pytest

from polarsim.rocks.regions import Limits, RockRegion, _has_rock_shape

LIMITS = Limits(foot=0.008, height=0.015, confirmed_height=0.01, size=0.035)


@pytest.mark.parametrize(
    ("size", "height", "rock"),
    [
        (0.155, 0.156, True),  # a block of 16 cm on the sand with a hidden back
        (0.10, 0.07, True),
        (0.10, 0.15, False),  # the edge of a partly hidden object, cloth, a lamp's foot
        (0.30, 0.03, False),  # a swell of the sand
        (0.05, 0.012, False),  # too low
    ],
)
def test_rocks_are_neither_flat_nor_upright(size, height, rock):
    region = RockRegion(np.zeros(1, int), np.zeros(1, int), np.zeros(2), size, height, 0.0)
    assert _has_rock_shape(region, LIMITS) == rock
