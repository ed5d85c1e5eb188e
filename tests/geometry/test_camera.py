import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import camera_pose
from tests.support.polar_rig import default_rig

CAMERA = Camera(camera_pose(np.array([-3.0, 0.2, 1.4]), 0.1, 0.4, 0.05), default_rig().left)


@given(st.floats(0, 1936), st.floats(0, 1216), st.floats(0.5, 9))
def test_directions_and_projection_are_inverse(u, v, depth):
    pixel = np.array([[u, v]])
    position = CAMERA.centre + depth * CAMERA.directions(pixel)
    np.testing.assert_allclose(CAMERA.project(position), pixel, atol=1e-8)
    np.testing.assert_allclose(CAMERA.world_from_camera.inverse().apply(position)[0, 2], depth)  # along the axis


def test_the_optical_axis_projects_to_the_principal_point():
    axis = np.array([np.cos(0.4) * np.cos(0.1), np.cos(0.4) * np.sin(0.1), -np.sin(0.4)])
    pixel = CAMERA.project(np.array([-3.0, 0.2, 1.4]) + 2 * axis)
    np.testing.assert_allclose(pixel, [964.405 + 0.5, 593.512 + 0.5], atol=1e-6)  # of the calibration, OpenCV's pixels


def test_inside_the_photo():
    pixels = np.array([[0.5, 0.5], [1935.5, 1215.5], [1936.5, 600], [900, -0.5], [np.nan, 3]])
    assert CAMERA.inside(pixels).tolist() == [True, True, False, False, False]


def test_a_box_contains_the_visible_points():
    shown = np.array([[200.0, 300], [260, 340], [230, 320]])
    beyond = np.array([[-40.0, 310]])  # px, outside the left border
    points = CAMERA.centre + 3 * CAMERA.directions(np.concatenate([shown, beyond]))
    behind = CAMERA.centre - CAMERA.directions(shown[:1])
    np.testing.assert_allclose(CAMERA.box_around(np.concatenate([points[:3], behind])), [200, 300, 260, 340], atol=1e-6)
    np.testing.assert_allclose(CAMERA.box_around(points), [0, 300, 260, 340], atol=1e-6)
    assert np.isnan(CAMERA.box_around(points[3:])).all()
