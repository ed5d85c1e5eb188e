"""Scores and gaps to rocks, for constructed cases."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from polarsim.rover.planning.challenge import FULL_RATE_1_S, challenge_score, true_cells
from polarsim.rover.planning.clearance import box_gap, cylinder_gap
from polarsim.rover.world.surface import bare_world

SCORED = np.ones((2, 5), bool)


def test_points_of_a_map_with_one_wrong_height_and_one_wrong_rock_and_of_an_empty_map():
    true, rock = np.zeros((2, 5)), np.zeros((2, 5), bool)
    rock[0, :2] = True
    heights, rocks = true.copy(), rock.copy()
    heights[1, 4], rocks[1, 4] = 0.051, True
    score = challenge_score(heights, rocks, true, rock, SCORED, seconds=10 / FULL_RATE_1_S * 2)
    assert score["geometric map"] == pytest.approx(300 * 0.9)
    assert score["rock map"] == pytest.approx(300 * 2 * 2 / 5)  # two right, one false
    assert score["productivity"] == pytest.approx(125)
    assert score["localisation"] == 150
    none = np.zeros((2, 5), bool)
    score = challenge_score(np.full((2, 5), np.nan), none, true, none, SCORED, seconds=60)
    assert (score["geometric map"], score["productivity"]) == (0, 0)
    assert np.isnan(score["rock map"])


def test_a_cell_has_the_mean_height_of_16_rays_and_is_rock_if_a_ray_hits_a_rock():
    """A box over the left quarter of a cell of 0.16 m is hit by 4 of 16 rays, 0.2 m above ground that rises with y."""
    bare = bare_world(np.tile(0.1 * np.arange(21)[:, None] * 0.1, (1, 21)), 0.1, -1.0, -1.0)
    box = trimesh.creation.box((0.04, 0.16, 0.4), trimesh.transformations.translation_matrix([-0.06, 0.0, 0.1]))
    world = replace(bare, vertices=np.asarray(box.vertices, np.float32), triangles=np.asarray(box.faces, np.int32))
    height, rock = true_cells(world, np.array([-0.16, 0.0]), np.array([0.0, 0.16]), 0.16)
    np.testing.assert_array_equal(rock, [[False, True], [False, False]])
    np.testing.assert_allclose(height, [[0.1, (12 * 0.1 + 4 * 0.3) / 16], [0.116, 0.116]], atol=1e-6)


def test_gaps_to_a_wheel_and_a_box():
    gap = cylinder_gap(np.array([[0.30, 0.0, 0.0], [0.0, 0.15, 0.1], [0.28, 0.14, 0.0], [0.2, 0.0, 0.0]]), 0.25, 0.2)
    np.testing.assert_allclose(gap, [0.05, 0.05, 0.05, -0.05], atol=1e-12)
    inside = box_gap(np.array([[1.3, 0, 0], [0, 0, 0.4]]), np.array([2.0, 1, 1]))
    np.testing.assert_allclose(inside, [0.3, -0.1], atol=1e-12)
