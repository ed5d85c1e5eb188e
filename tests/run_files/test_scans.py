import numpy as np
import pytest

from polarsim.geometry.lens import Lens
from polarsim.run_files.scans import range_map_of_cloud, trusted_pixels

LENS = Lens(500, 500, 100, 60, width=200, height=120)
WALL = np.where(np.arange(200)[None, :] < 100, 2.0, 2.6) * np.ones((120, 1))  # a step of 0.6 m in depth


def seen(depth):
    return (LENS.pixel_directions() * depth[..., None]).astype(np.float32)


def test_mixed_pixels_at_a_depth_edge_are_not_trusted():
    depth = WALL.copy()
    depth[:, 100] = 2.3  # neither on the near nor on the distant wall
    trusted = trusted_pixels(seen(depth), LENS.fx)[1:-1]  # a corner of the map has too few neighbours
    assert not trusted[:, 100].any()
    assert trusted[:, :98].all()
    assert trusted[:, 103:].all()


def test_an_isolated_return_is_not_trusted():
    points = np.full((120, 200, 3), np.nan, np.float32)
    points[60, 60] = [0, 0, 2]
    assert not trusted_pixels(points, LENS.fx).any()


def test_noise_of_two_millimetres_is_trusted(rng):
    trusted = trusted_pixels(seen(2.0 + 0.002 * rng.normal(size=(120, 200))), LENS.fx)
    assert trusted.mean() > 0.99


def test_a_cloud_becomes_a_range_map_of_the_nearest_points():
    near, far = seen(np.full((120, 200), 2.0)).reshape(-1, 3), seen(np.full((120, 200), 3.0)).reshape(-1, 3)
    range_map, lens = range_map_of_cloud(np.concatenate([near, far]).astype(float), LENS)
    assert range_map.shape == (lens.height, lens.width, 3)
    assert np.nanmax(range_map[..., 2]) == pytest.approx(2.0)
    assert np.isfinite(range_map[..., 2]).mean() > 0.95
