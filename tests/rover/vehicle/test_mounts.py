"""Poses and frames of the rover's cameras."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from polarsim.geometry.poses import Pose
from polarsim.render.views.cameras import pinhole
from polarsim.rover.vehicle.mounts import (
    FRONT,
    Mount,
    base_from_camera,
    heading,
    levelled,
    mount_of,
    pose_of_quaternion,
)
from tests.rover import driven

LENS = pinhole(44, 1936, 1216)
points = arrays(float, 3, elements=st.floats(-20, 20))
rotvecs = arrays(float, 3, elements=st.floats(-1.5, 1.5))
angles = st.floats(-80, 80)


def poses():
    return st.builds(Pose.from_rotvec, rotvecs, points)


def front(level=False):
    return Mount("front", base_from_camera(np.array([0.6, 0, 1.3]), 0, 30, 0), LENS, level)


def test_a_camera_without_rotation_looks_forward():
    rotation = base_from_camera(np.zeros(3), 0, 0, 0).rotation
    np.testing.assert_allclose(rotation, np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]), atol=1e-12)


def test_a_camera_pitched_by_30_degrees_sees_level_ground_at_the_expected_distance():
    towards_west = Pose(np.diag([-1.0, -1, 1]), np.array([5.0, 0, 0.25]))
    camera = front().at(towards_west).world_from_camera
    axis = camera.rotation[:, 2]
    reach = camera.translation[2] / -axis[2]
    np.testing.assert_allclose(camera.translation + reach * axis, [5 - 0.6 - 1.55 / np.tan(np.pi / 6), 0, 0], atol=1e-9)


def test_a_positive_yaw_is_to_the_left():
    np.testing.assert_allclose(base_from_camera(np.zeros(3), 90, 0, 0).rotation[:, 2], [0, 1, 0], atol=1e-12)


def test_a_positive_roll_moves_the_right_side_down():
    assert base_from_camera(np.zeros(3), 0, 0, 20).rotation[2, 0] < -0.3


@given(world_from_base=poses(), point=points)
def test_a_point_fixed_to_the_rover_is_fixed_in_the_camera(world_from_base, point):
    mount = front()
    projected = mount.at(world_from_base).world_from_camera.inverse().apply(world_from_base.apply(point))
    np.testing.assert_allclose(projected, mount.base_from_camera.inverse().apply(point), atol=1e-9)


@given(world_from_base=poses())
def test_a_following_camera_is_upright_over_the_same_point(world_from_base):
    upright = levelled(world_from_base)
    np.testing.assert_allclose(upright.rotation[:, 2], [0, 0, 1], atol=1e-12)
    np.testing.assert_array_equal(upright.translation, world_from_base.translation)
    np.testing.assert_allclose(heading(upright), heading(world_from_base), atol=1e-9)
    right = front(level=True).at(world_from_base).world_from_camera.rotation[:, 0]
    np.testing.assert_allclose(right[2], 0, atol=1e-12)


def test_a_scaled_camera_has_the_same_field_of_view():
    whole, half = (mount_of(driven.vehicle().camera(FRONT), scale) for scale in (1, 0.5))
    point = np.array([0.1, 0.2, 2.0])
    np.testing.assert_allclose(half.lens.project(point), whole.lens.project(point) / 2)
    assert whole.lens.width == 1936


@given(rotvec=rotvecs, position=points)
def test_the_pose_of_a_quaternion_has_its_rotation(rotvec, position):
    rotation = Rotation.from_rotvec(rotvec)
    x, y, z, w = rotation.as_quat()
    np.testing.assert_allclose(
        pose_of_quaternion(position, np.array([w, x, y, z])).rotation, rotation.as_matrix(), atol=1e-12
    )
