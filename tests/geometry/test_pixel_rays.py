import numpy as np
import pytest

from polarsim.geometry.lens import MAX_ERROR_PX, Lens, pixel_directions, separated
from polarsim.geometry.stereo import default_rig

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
