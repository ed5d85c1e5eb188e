import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.lens import Lens
from polarsim.geometry.stereo import default_rig

MATRIX = np.array([[2068.44, 0, 964.405], [0, 2064.29, 593.512], [0, 0, 1]])
TERMS = np.array([-0.108441, 0.158389, 0.000537106, -0.00127904, 0.01])


def test_projection_equals_opencv_plus_half_a_pixel(rng):
    points = np.column_stack([rng.uniform(-2, 2, (200, 2)), rng.uniform(4.5, 8, 200)])
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), MATRIX, TERMS)[0][:, 0]
    found = Lens.from_opencv(MATRIX, TERMS).project(points)
    np.testing.assert_allclose(found, expected + 0.5, atol=1e-8)


@given(st.floats(0, 1936), st.floats(0, 1216))
def test_directions_invert_the_projection(u, v):
    lens = default_rig().left
    pixel = np.array([[u, v]])
    np.testing.assert_allclose(lens.project(3.7 * lens.directions(pixel)), pixel, atol=1e-8)


def test_the_centre_of_the_first_pixel_is_at_half_a_pixel():
    lens = Lens(2000, 2000, 968, 608)
    directions = lens.pixel_directions(slice(0, 1), slice(0, 2))
    np.testing.assert_allclose(directions[0, 0], [(0.5 - 968) / 2000, (0.5 - 608) / 2000, 1])
    np.testing.assert_allclose(directions[0, 1] - directions[0, 0], [1 / 2000, 0, 0], atol=1e-12)


def test_points_with_negative_depth_have_no_pixel():
    assert np.isnan(default_rig().left.project(np.array([[0.1, 0.1, -1.0], [0, 0, 0]]))).all()


def test_a_photo_of_half_size_has_half_the_pixel_coordinates():
    lens = default_rig().left
    points = np.array([[0.5, -0.3, 4.0], [-1.0, 0.4, 5.0]])
    half = lens.scaled(0.5)
    np.testing.assert_allclose(half.project(points), lens.project(points) / 2)
    assert (half.width, half.height) == (968, 608)


def test_the_opencv_matrix_is_restored():
    np.testing.assert_allclose(Lens.from_opencv(MATRIX, TERMS).opencv_matrix(), MATRIX)
