import numpy as np
import pytest

from polarsim.geometry.boxes import iou
from polarsim.geometry.poses import camera_pose
from polarsim.labels.bodies import build_world
from polarsim.labels.projection import move_flat, move_rocks, project_rock
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import read_terrain
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import RIG_LAMP, SANDBOX, SUN_LAMPS

from .conftest import BLOCKS, TERRAIN, localised


@pytest.fixture(scope="module")
def world(untouched_scene):
    return build_world(read_terrain(untouched_scene.meshes, TERRAIN, SANDBOX), 0.004, SUN_LAMPS, RIG_LAMP)


@pytest.mark.parametrize("rock", list(BLOCKS))
@pytest.mark.parametrize("position", ["A", "C"])
def test_a_projected_rock_is_the_box_around_its_corners(untouched_scene, world, position, rock):
    shown = project_rock(world, localised(position).camera("L"), rock)
    np.testing.assert_allclose(shown.box, untouched_scene.expected_box(position, "L", rock), atol=3)
    assert shown.visible_share == 1


def test_a_rock_behind_the_camera_is_not_shown(world):
    away = LocalisedRig(default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), 0.0, np.radians(25)))
    assert project_rock(world, away.camera("L"), 4) is None


def test_an_occluded_rock_has_a_reduced_visible_share(world):
    # Seen from slightly above the ground, on the line through both blocks, block 4 occludes most of block 7.
    near, far = BLOCKS[4][0], BLOCKS[7][0]
    heading = (near - far) / np.linalg.norm(near - far)
    eye = near + 1.2 * heading + [0, 0, 0.10]
    low = LocalisedRig(default_rig(), camera_pose(eye, np.arctan2(-heading[1], -heading[0]), 0.0))
    shown = project_rock(world, low.camera("L"), 7)
    assert shown is None or shown.visible_share < 0.5
    assert project_rock(world, low.camera("L"), 4).visible_share == 1


@pytest.mark.parametrize("rock", list(BLOCKS))
def test_a_rock_moves_to_the_right_camera_like_its_mesh(untouched_scene, world, rock):
    left, right = localised("A").camera("L"), localised("A").camera("R")
    moved = move_rocks(world, left, right, untouched_scene.expected_box("A", "L", rock)[None], np.array([rock]))
    assert iou(moved, untouched_scene.expected_box("A", "R", rock)[None])[0, 0] > 0.9


@pytest.mark.parametrize("rock", list(BLOCKS))
def test_a_rock_without_a_mesh_moves_nearly_as_well(untouched_scene, world, rock):
    left, right = localised("A").camera("L"), localised("A").camera("R")
    moved = move_rocks(world, left, right, untouched_scene.expected_box("A", "L", rock)[None], np.array([101]))
    assert iou(moved, untouched_scene.expected_box("A", "R", rock)[None])[0, 0] > 0.85


def test_a_flat_object_moves_like_the_ground_at_its_centre(world):
    left, right = localised("C").camera("L"), localised("C").camera("R")
    position = np.array([0.3, -0.2, 0.0])
    size = np.array([-20, -10, 20, 10])
    boxes = np.tile(left.project(position), 2) + size
    expected = np.tile(right.project(position), 2) + size
    np.testing.assert_allclose(move_flat(world, left, right, boxes[None])[0], expected, atol=0.05)


def test_moving_to_the_second_camera_and_back_is_the_identity(world):
    left, right = localised("A").camera("L"), localised("A").camera("R")
    boxes = np.array([[700.0, 500, 780, 540], [1200, 800, 1230, 830]])
    np.testing.assert_allclose(move_flat(world, right, left, move_flat(world, left, right, boxes)), boxes, atol=0.1)
