import cv2
import numpy as np
import pytest

from polarsim.geometry.lens import MAX_ERROR_PX, Lens, pixel_directions, separated
from tests.support.polar_rig import default_rig

MATRIX = np.array([[2068.44, 0, 964.405], [0, 2064.29, 593.512], [0, 0, 1]])
TERMS = np.array([-0.108441, 0.158389, 0.000537106, -0.00127904, 0.01])


def test_projection_equals_opencv_plus_half_a_pixel(rng):
    points = np.column_stack([rng.uniform(-2, 2, (200, 2)), rng.uniform(4.5, 8, 200)])
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), MATRIX, TERMS)[0][:, 0]
    found = Lens.from_opencv(MATRIX, TERMS, (1936, 1216)).project(points)
    np.testing.assert_allclose(found, expected + 0.5, atol=1e-8)


def test_the_centre_of_the_first_pixel_is_at_half_a_pixel():
    lens = Lens(2000, 2000, 968, 608, width=1936, height=1216)
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
    np.testing.assert_allclose(Lens.from_opencv(MATRIX, TERMS, (1936, 1216)).opencv_matrix(), MATRIX)


LENSES = {
    "stated": default_rig().left,
    "small": default_rig().right.scaled(0.1),
    "pinhole": Lens(900.0, 900.0, 320.0, 240.0, width=640, height=480),
    "barrel": Lens(700.0, 705.0, 330.0, 236.0, (-0.25, 0.08, 1e-3, -2e-3, -0.01), width=640, height=480),
}


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("offset", [(0.0, 0.0), (-0.25, 0.25), (0.5, -0.5)])
def test_directions_project_to_their_pixels(lens, offset):
    rows = slice(0, lens.height, 7)
    directions = pixel_directions(lens, rows, offset)
    u, v = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height)[rows] + 0.5)
    back = lens.project(2.5 * directions)
    assert np.abs(back - np.stack([u, v], axis=-1) - offset).max() < 2 * MAX_ERROR_PX
    assert (directions[..., 2] == 1).all()


def test_directions_of_some_rows_equal_those_of_all_rows():
    lens = LENSES["small"]
    whole = pixel_directions(lens, slice(None))
    np.testing.assert_array_equal(pixel_directions(lens, slice(5, 17)), whole[5:17])


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_separated_directions_equal_pixel_directions(lens):
    of_row, of_column = separated(lens, (0.25, -0.25))
    xy = np.einsum("vtk,ut->vuk", of_row, of_column)
    np.testing.assert_allclose(xy, pixel_directions(lens, slice(None), (0.25, -0.25))[..., :2], atol=1e-12)
