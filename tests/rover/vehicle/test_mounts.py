"""Poses and frames of the rover's cameras."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from polarsim.geometry.poses import Pose
from polarsim.render.views.cameras import pinhole
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.mounts import Mount, base_from_camera, levelled, mount_of, pose_of_quaternion
from tests.rover import driven

LENS = pinhole(44, 1936, 1216)


def front(level=False):
    return Mount("front", base_from_camera(np.array([0.6, 0, 1.3]), 0, 30, 0), LENS, level)


@pytest.fixture
def poses(rng) -> list[Pose]:
    vectors, places = rng.uniform(-1.5, 1.5, (20, 3)), rng.uniform(-20, 20, (20, 3))
    return [Pose.from_rotvec(vector, place) for vector, place in zip(vectors, places, strict=True)]


@pytest.mark.parametrize(
    ("angles", "axes"),
    [
        ((0, 0, 0), {2: [1, 0, 0], 0: [0, -1, 0], 1: [0, 0, -1]}),  # looks forward
        ((90, 0, 0), {2: [0, 1, 0]}),  # a positive yaw is to the left
        ((0, 30, 0), {2: [np.sqrt(3) / 2, 0, -0.5]}),  # a positive pitch is down
        ((0, 0, 90), {0: [0, 0, -1]}),  # a positive roll moves the right side down
    ],
)
def test_axes_of_a_camera_at_given_yaw_pitch_and_roll(angles, axes):
    rotation = base_from_camera(np.zeros(3), *angles).rotation
    for axis, expected in axes.items():
        np.testing.assert_allclose(rotation[:, axis], expected, atol=1e-12)


def test_a_point_fixed_to_the_rover_is_fixed_in_the_camera(poses):
    mount, point = front(), np.array([3.0, -1.0, 0.5])
    for world_from_base in poses:
        projected = mount.at(world_from_base).world_from_camera.inverse().apply(world_from_base.apply(point))
        np.testing.assert_allclose(projected, mount.base_from_camera.inverse().apply(point), atol=1e-9)


def test_a_following_camera_is_upright_over_the_same_point(poses):
    for world_from_base in poses:
        upright = levelled(world_from_base)
        np.testing.assert_allclose(upright.rotation[:, 2], [0, 0, 1], atol=1e-12)
        np.testing.assert_array_equal(upright.translation, world_from_base.translation)
        flat = world_from_base.rotation[:2, 0] / np.hypot(*world_from_base.rotation[:2, 0])
        np.testing.assert_allclose(upright.rotation[:2, 0], flat, atol=1e-9)
        right = front(level=True).at(world_from_base).world_from_camera.rotation[:, 0]
        np.testing.assert_allclose(right[2], 0, atol=1e-12)


def test_a_scaled_camera_has_the_same_field_of_view():
    whole, half = (mount_of(driven.vehicle().camera(FRONT), scale) for scale in (1, 0.5))
    point = np.array([0.1, 0.2, 2.0])
    np.testing.assert_allclose(half.lens.project(point), whole.lens.project(point) / 2)
    assert whole.lens.width == 1936


def test_the_pose_of_a_quaternion_has_its_rotation(poses):
    for pose in poses:
        x, y, z, w = Rotation.from_matrix(pose.rotation).as_quat()
        again = pose_of_quaternion(pose.translation, np.array([w, x, y, z]))
        np.testing.assert_allclose(again.rotation, pose.rotation, atol=1e-12)
