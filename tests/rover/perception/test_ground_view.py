"""Rocks estimated from boxes, and agreement of both hazard maps on visible ground and rocks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.poses import Pose
from polarsim.rover.perception import hazard_map
from polarsim.rover.perception.ground_view import estimate, plane_under
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.perception.map_updates import update_from_boxes
from polarsim.rover.planning.challenge import true_cells
from polarsim.rover.world.surface import bare_world
from tests.rover import driven
from tests.rover.perception.boxes import CAMERA, CONFIDENCE, GROUND, box_of, level, ride, table


@given(x=st.floats(1.8, 5), y=st.floats(-0.4, 0.4), height=st.floats(0.03, 0.4), width=st.floats(0.05, 0.3))
def test_a_box_gives_the_near_edge_width_and_height_of_the_rock(x, y, height, width):
    lower, upper = box_of(x, y, width, 0), box_of(x + width / 2, 0, width, height)
    rock = estimate(lower, CAMERA, level)
    np.testing.assert_allclose([*rock.near[0], rock.width[0]], [x, y, width], atol=1e-6)
    lower = box_of(x, 0, width, 0)
    rock = estimate(np.array([lower[0], upper[1], lower[2], lower[3]]), CAMERA, level)
    np.testing.assert_allclose(rock.height[0], height, atol=1e-6)


def test_a_box_on_a_slope_is_located_on_the_slope():
    rock = estimate(box_of(3.0, 0.2, 0.0, 0.0), CAMERA, lambda x, y: GROUND + 0.2 * (x - 3.0) + 0 * y)
    np.testing.assert_allclose(rock.near[0], [3.0, 0.2], atol=1e-4)


@given(roll=st.floats(-0.2, 0.2), pitch=st.floats(-0.2, 0.2))
def test_the_plane_under_the_wheels_tilts_with_the_rover(roll, pitch):
    pose = Pose.from_rotvec(np.array([roll, pitch, 0.3]), np.array([1.0, 2, 0.4]))
    position = pose.apply(np.array([2.0, -0.7, GROUND]))
    np.testing.assert_allclose(plane_under(pose, GROUND)(*position[:2]), position[2], atol=1e-9)


def test_a_box_above_the_horizon_has_no_position():
    rock = estimate(np.array([900, -900, 1000, -850.0]), CAMERA, level)
    assert np.isnan(rock.near).all()


WORLD = driven.world()
X, Y = HazardGrid(WORLD).x, HazardGrid(WORLD).y


def scored(boxes: np.ndarray, world) -> tuple[np.ndarray, np.ndarray]:
    """Return visible cells and rock cells of the map of a recorded drive, for its first frame."""
    rows = table([(0, box, 0.9) for box in boxes])
    result = hazard_map.map_from_boxes(rows, ride(1), world, CONFIDENCE)
    return result.visible, result.rock


def decided(boxes: np.ndarray, world) -> tuple[np.ndarray, np.ndarray]:
    """Return visible cells and rock cells of the map by which the rover drives."""
    first, grid = ride(1), HazardGrid(world)
    camera = first.cameras[0]
    lit = np.ones(camera.size[::-1], bool)
    grid.add(update_from_boxes(boxes, np.full(len(boxes), 0.9), lit, camera, first.ground(0), grid))
    return grid.seen, grid.rock


def scored_truth() -> tuple[np.ndarray, np.ndarray]:
    true = hazard_map.true_map(WORLD)
    return true.rock, true.height


def decided_truth() -> tuple[np.ndarray, np.ndarray]:
    height, rock = true_cells(WORLD, X, Y, HazardGrid.cell_m)
    return rock, height - WORLD.height_at(*np.meshgrid(X, Y))


@pytest.mark.parametrize("truth", [scored_truth, decided_truth])
def test_true_rock_cells_are_at_the_rocks(truth):
    rock, height = truth()
    for x, y, top, half in driven.ROCKS:
        row, column = np.abs(Y - y).argmin(), np.abs(X - x).argmin()
        assert rock[row, column]
        assert top < 0.1 or 0.3 * top < height[row, column] <= top + 0.01
        assert not rock[row, np.abs(X - x - half - 0.4).argmin()]
    touched = sum((2 * rock[3] / HazardGrid.cell_m + 1) ** 2 for rock in driven.ROCKS)  # squares around the rocks
    assert 0.5 * touched < rock.sum() < touched


def flat_world():
    return bare_world(np.zeros((61, 81)), 0.1, -1.0, -3.0)


@pytest.mark.parametrize("mapped", [scored, decided])
def test_a_box_is_rock_at_its_foot_and_ground_behind_the_camera_is_unseen(mapped):
    world = flat_world()
    grid = HazardGrid(world)
    seen, rock = mapped(np.array([box_of(2.2, 0.1, 0.3, 0.2)]), world)
    row, column = np.argwhere(rock).mean(axis=0)
    x, y = np.interp(column, np.arange(len(grid.x)), grid.x), np.interp(row, np.arange(len(grid.y)), grid.y)
    assert (x, y) == (pytest.approx(2.35, abs=0.1), pytest.approx(0.1, abs=0.1))
    assert (rock <= seen).all()
    assert not seen[:, grid.x < 0.8].any()


@pytest.mark.parametrize("mapped", [scored, decided])
def test_a_box_that_is_cut_off_hides_the_ground_below_it(mapped):
    world = flat_world()
    width, height = ride(1).cameras[0].size
    everything = mapped(np.zeros((0, 4)), world)[0]
    seen, rock = mapped(np.array([[0.3 * width, 0.5 * height, 0.6 * width, height]]), world)
    assert not rock.any()
    assert 0.05 < (everything & ~seen).sum() / everything.sum() < 0.8
