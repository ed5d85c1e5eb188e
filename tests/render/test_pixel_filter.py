import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.render.hits import sample_offsets
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions, SensorOptions
from polarsim.render.surfaces import build_surfaces

SD_OF_BOX = 1 / np.sqrt(12)
ROTATION = 0.13  # radians, angle between edge and pixel rows (slanted edge of ISO 12233)


def test_one_ray_goes_through_the_centre_and_four_through_the_centres_of_the_quarters():
    assert sample_offsets(SensorOptions()) == ((0, 0),)
    quarters = ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25))
    assert sample_offsets(SensorOptions(samples=4)) == quarters


@pytest.mark.parametrize("side", [3, 4])
def test_a_box_has_one_sample_in_each_cell_and_in_each_fine_row_and_column(side):
    points = np.array(sample_offsets(SensorOptions(samples=side**2))) + 0.5
    cells = np.floor(points * side)
    assert len(np.unique(cells, axis=0)) == side**2
    for axis in range(2):
        np.testing.assert_allclose(np.sort(points[:, axis]), (np.arange(side**2) + 0.5) / side**2)


def test_a_rendered_edge_is_as_wide_as_a_pixel(blocks):
    """The variance of a centred edge profile F is the integral of 2 |x| (1 - F or F), here a sum over pixels."""
    lens, height = Lens(220.0, 220.0, 100.0, 70.0, width=200, height=140), 6.0
    cos, sin = np.cos(ROTATION), np.sin(ROTATION)
    pose = Pose(np.array([[cos, sin, 0], [sin, -cos, 0], [0, 0, -1]]), np.array([0.0, 0, height]))
    chosen = RenderOptions(walls=False, bounce=0, samples=16)
    lamp = {"lamp": Lamp(np.array([0.0, 0, 1e4]))}
    image = render_view(
        build_surfaces(blocks(), chosen), Camera(pose, lens), lamp, ["lambert"], None, chosen
    ).olat_images
    profile = image["lambert", "lamp"] / (chosen.parameters("lambert").albedo / np.pi)
    x = (np.arange(200) + 0.5 - 100) * height / 220
    y = (np.arange(140)[:, None] + 0.5 - 70) * height / 220
    in_sandbox = cos * x + sin * y, sin * x - cos * y
    outside_px = (in_sandbox[0] - 2.0) * 220 / height  # the ground ends at x = 2
    reach = 4.0
    near = (np.abs(outside_px) < reach) & (np.abs(in_sandbox[1]) < 1.5)
    missing = np.where(outside_px > 0, profile, 1 - profile)[near]
    variance = (2 * np.abs(outside_px[near]) * missing).mean() * 2 * reach
    assert near.sum() > 700
    assert np.sqrt(variance) == pytest.approx(SD_OF_BOX, rel=0.03)
