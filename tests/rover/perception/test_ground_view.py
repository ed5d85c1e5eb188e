"""Rocks estimated from boxes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.poses import Pose
from polarsim.rover.perception.ground_view import estimate, plane_under
from tests.rover.perception.boxes import CAMERA, GROUND, box_of, level


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
