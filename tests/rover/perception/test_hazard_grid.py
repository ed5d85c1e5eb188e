"""Map by which the rover drives: updates from pixels, boxes and depths, and their fusion with bounds and decay."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import camera_pose
from polarsim.photo import BLACK_LEVEL
from polarsim.rover.perception.hazard_grid import (
    DECAY_S,
    MAX_LOG_ODDS,
    MISS_LOG_ODDS,
    PARTS,
    HazardGrid,
    MapUpdate,
    without_gaps,
)
from polarsim.rover.perception.map_updates import (
    bright_pixels,
    update_from_boxes,
    update_from_depth,
    update_from_pixels,
)
from polarsim.rover.perception.observation import has_texture
from polarsim.rover.world.surface import bare_world

LENS = Lens(500.0, 500.0, 242.0, 152.0, width=484, height=304)
CAMERA = Camera(camera_pose(np.array([0.0, 0.0, 1.25]), 0.0, 30.0 * np.pi / 180, 0.0), LENS)
LEVEL = 0.3  # height of the ground
ALL_LIT = np.ones((LENS.height, LENS.width), bool)


def grid() -> HazardGrid:
    return HazardGrid(bare_world(np.full((41, 61), LEVEL), 0.1, -1.0, -2.0))


def flat(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.full(np.shape(x), LEVEL) + 0 * y


def cell(grid: HazardGrid, x: float, y: float) -> tuple[int, int]:
    return int(np.abs(grid.y - y).argmin()), int(np.abs(grid.x - x).argmin())


def test_pixels_update_rock_cells_and_heights_and_no_unobserved_cells():
    own = grid()
    row, column = cell(own, 1.5, 0.0)
    part = own.cell_m / PARTS
    left = own.x[column] - own.cell_m / 2 + part / 2
    ground = [(left + part, own.y[row], LEVEL), (left + 2 * part, own.y[row], LEVEL)]
    side = [(left, own.y[row], LEVEL + z) for z in (0.02, 0.1, 0.2)]  # steep side of a rock
    top = (own.x[column - 1], own.y[row], LEVEL + 0.25)  # top of the same rock, in the adjacent cell
    points = np.array([*ground, *side, top])
    look = update_from_pixels(points, np.array([0, 0, 7, 7, 7, 7]), points[:, 2] - LEVEL, CAMERA, own)
    assert (look.rock[row, column - 1 : column + 1] > 0).all()
    np.testing.assert_allclose(look.height[row, column - 1 : column + 1], 0.25, atol=1e-6)
    assert (look.weight > 0).sum() == 2
    fine = np.where(np.isfinite(look.surface), look.surface, 0)
    assert np.isfinite(look.surface).sum() == 4
    assert fine.max() == pytest.approx(LEVEL + 0.25)
    assert np.sort(fine[fine > 0])[2] == pytest.approx(LEVEL + 0.2)  # the highest pixel of the rock there, not the mean
    one = np.array([[own.x[column], own.y[row], LEVEL]])
    single = update_from_pixels(one, np.zeros(1, int), np.zeros(1), CAMERA, own)
    assert single.weight[row, column] == pytest.approx(1 / PARTS**2)  # of a cell of which one part is observed
    assert single.rock[row, column] == 0


def box_at(x: float, y: float) -> np.ndarray:
    """Return the box (1, 4) of a rock of 0.2 m whose near edge is at (x, y)."""
    foot, head = CAMERA.project(np.array([[x, y, LEVEL], [x + 0.15, y, LEVEL + 0.2]]))
    return np.array([[foot[0] - 40, head[1], foot[0] + 40, foot[1]]])


def test_ground_next_to_a_box_is_at_ground_level_and_higher_below_the_box():
    own = grid()
    look = update_from_boxes(box_at(1.6, 0.0), np.array([0.9]), ALL_LIT, CAMERA, flat, own)
    centre = cell(own, 1.75, 0.0)
    assert look.rock[centre] > 0
    assert look.surface[PARTS * centre[0], PARTS * centre[1]] > LEVEL + 0.1
    aside = cell(own, 1.75, 0.6)
    assert look.rock[aside] == 0
    assert look.surface[PARTS * aside[0], PARTS * aside[1]] == pytest.approx(LEVEL)


def test_dark_pixels_update_detected_rocks_only_and_no_free_ground():
    """Without this rule, black pictures without detections were free ground, and the rover drove on in the dark."""
    own = grid()
    box, lit = box_at(1.6, -0.4), ALL_LIT.copy()
    lit[:, 242:] = False  # the right half of the picture, with the rock
    bright, dark = (update_from_boxes(box, np.array([0.9]), some, CAMERA, flat, own) for some in (ALL_LIT, lit))
    free = bright.rock == 0
    for y, seen in ((0.5, True), (-0.8, False)):
        at = cell(own, 1.75, y)
        assert bright.weight[at] > 0
        assert free[at]
        assert (dark.weight[at] > 0) == seen
        assert np.isfinite(dark.surface[PARTS * at[0], PARTS * at[1]]) == seen
    np.testing.assert_array_equal(dark.weight[~free], bright.weight[~free])
    assert (dark.rock > 0).sum() == (bright.rock > 0).sum() > 0


def test_noise_is_not_light_and_a_picture_without_texture_has_nothing_to_match(rng):
    read = rng.normal(0, 1, (40, 60))
    black = np.clip(BLACK_LEVEL + read, 0, None).round().astype(np.uint16)
    dim = (BLACK_LEVEL + 20 + 2 * read).round().astype(np.uint16)
    assert not bright_pixels(black, 12).any()
    assert bright_pixels(dim, 12).all()
    assert bright_pixels(np.hstack([black, dim]), 12)[:, 65:].all()
    grey = np.full((40, 60), 120, np.uint8)
    grey[:, :20] = rng.integers(80, 160, (40, 20))
    textured = has_texture(grey)
    assert textured[:, 3:17].all()
    assert not textured[:, 24:].any()


def test_depth_updates_the_surface_by_parts():
    own = grid()
    x, y = (values.ravel() for values in np.meshgrid(np.arange(1.0, 2.5, 0.01), np.arange(-0.6, 0.6, 0.01)))
    z = LEVEL + np.where((np.abs(x - 1.8) < 0.1) & (np.abs(y) < 0.1), 0.15, 0.0)
    look = update_from_depth(np.stack([x, y, z], axis=1), CAMERA, own)
    own.add(look)
    heights = own.surface_of_cells()
    assert heights[cell(own, 1.8, 0.0)] == pytest.approx(LEVEL + 0.15, abs=0.02)
    assert heights[cell(own, 1.3, 0.3)] == pytest.approx(LEVEL, abs=1e-6)


def test_pixels_at_the_centre_of_a_part_outweigh_the_steep_side_of_a_rock():
    own = grid()
    row, column = cell(own, 1.5, 0.0)
    part = own.cell_m / PARTS
    x, y = own.x[column] + part / 2, own.y[row] + part / 2
    side = [(x + 0.4 * part, y, LEVEL + z) for z in np.arange(0.01, 0.2, 0.01)]
    points = np.array([(x, y, LEVEL), *side])
    look = update_from_pixels(points, np.array([0] + [3] * len(side)), points[:, 2] - LEVEL, CAMERA, own)
    assert look.rock[row, column] == 0
    alone = update_from_pixels(points[1:], np.full(len(side), 3), points[1:, 2] - LEVEL, CAMERA, own)
    assert alone.rock[row, column] > 0


def uniform(rock: float, weight: float = 1.0, height: float = 0.2, surface: float = np.nan) -> MapUpdate:
    empty = grid()
    shape = empty.log_odds.shape
    values = (np.full(shape, value) for value in (weight, rock, height))
    return MapUpdate(*values, np.full(empty.surface.shape, surface))


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 3)), max_size=30))
def test_log_odds_are_bounded_and_an_update_without_weight_changes_nothing(updates):
    fused = grid()
    fused.add(uniform(3.0, weight=0.0))
    assert not fused.seen.any()
    assert not fused.log_odds.any()
    for weight, rock in updates:
        fused.add(uniform(rock, weight))
    assert np.abs(fused.log_odds).max() <= MAX_LOG_ODDS


@given(st.floats(0, 500))
def test_log_odds_decay_exponentially(seconds):
    fused = grid()
    fused.add(uniform(2.0))
    fused.fade(seconds)
    np.testing.assert_allclose(fused.log_odds, 2.0 * math.exp(-seconds / DECAY_S), rtol=1e-12)


def test_updates_without_a_rock_remove_it_and_heights_are_averaged():
    fused = grid()
    fused.add(uniform(1.0, height=0.1))
    fused.add(uniform(1.0, height=0.2))
    np.testing.assert_allclose(fused.height, 0.15)
    assert fused.hazards(0.12).all()
    assert not fused.hazards(0.16).any()
    for _ in range(3):
        fused.add(uniform(0.0))
    np.testing.assert_allclose(fused.log_odds, 2.0 - 3 * MISS_LOG_ODDS)
    assert not fused.rock.any()


def test_surface_heights_are_weighted_means_of_the_observed_parts():
    fused = grid()
    update = uniform(0.0, weight=1.0, surface=0.10)
    update.surface[0, 0] = np.nan
    fused.add(update)
    fused.add(uniform(0.0, weight=0.5, surface=0.40))
    assert fused.surface[0, 0] == pytest.approx(0.40)
    np.testing.assert_allclose(fused.surface.ravel()[1:], (0.10 + 0.5 * 0.40) / 1.5)
    expected = ((PARTS**2 - 1) * 0.20 + 0.40) / PARTS**2
    assert fused.surface_of_cells()[0, 0] == pytest.approx(expected)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_gaps_in_a_plane_are_filled_up_to_the_maximum_distance(along_x, along_y):
    rows, columns = np.mgrid[:20, :30]
    plane = along_x * columns + along_y * rows
    gap = plane.copy()
    gap[5:12, 8:20] = np.nan
    np.testing.assert_allclose(without_gaps(gap, 4), plane, atol=1e-9)
    near = without_gaps(gap, 2)
    assert np.isnan(near[8, 14])
    assert np.isfinite(near[6, 9])
    assert np.isnan(without_gaps(np.full((3, 3), np.nan), 2)).all()
