import numpy as np
import pytest

from polarsim.labels.bodies import wall_caster
from polarsim.labels.casting import fit_wall_height, wall_crossing_heights

BOUNDS = np.array([[-2.0, -2.0], [2.0, 2.0]])


@pytest.mark.parametrize(
    ("position", "lamp", "height"),
    [
        ([0, 0, 0], [4, 0, 1], 0.5),  # half of the ray is inside
        ([1.5, 0, 0.1], [3.5, 0, 0.9], 0.3),
        ([0, 1, 0], [-3, 3, 1.2], 0.6),  # over the wall at y = 2, before it passes x = -2
        ([0, 0, 0], [1, 1, 1], np.inf),  # a lamp inside
        ([0, -1, 0], [0, -4, 0.9], 0.3),  # straight along an axis
    ],
)
def test_light_passes_the_walls_at_the_height_of_a_hand_calculation(position, lamp, height):
    found = wall_crossing_heights(np.array([position], float), np.array(lamp, float), BOUNDS)
    np.testing.assert_allclose(found, [height], atol=1e-12)


def test_crossings_below_the_wall_height_agree_with_shadow_rays(rng):
    points = np.column_stack([rng.uniform(-1.99, 1.99, (2000, 2)), rng.uniform(-0.05, 0.05, 2000)])
    lamp = np.array([3.4, 1.8, 0.8])
    occluded = wall_caster(BOUNDS, 0.0, 0.3).occluded(points, lamp - points, 1.0)
    np.testing.assert_array_equal(wall_crossing_heights(points, lamp, BOUNDS) < 0.3, occluded)
    assert 0.1 < occluded.mean() < 0.9


def ground(rng, edge, dark=2.0, lit=20.0):
    """Return wall crossing heights and the brightness of patchy sand that is in shadow below `edge`."""
    passing = rng.uniform(0.1, 0.8, 5000)
    return passing, np.where(passing < edge, dark, lit) * rng.lognormal(0, 0.4, 5000)


@pytest.mark.parametrize("edge", [0.22, 0.3, 0.41])
def test_the_wall_height_follows_from_the_shadow_edge(rng, edge):
    assert fit_wall_height(*ground(rng, edge), 0.3) == pytest.approx(edge, abs=0.015)


def test_without_a_shadow_edge_the_nominal_height_is_used(rng):
    assert fit_wall_height(*ground(rng, 0.0), 0.3) == 0.3
    assert fit_wall_height(np.zeros(0), np.zeros(0), 0.3) == 0.3
