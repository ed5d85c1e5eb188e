"""Made-up relief has the heights and directions that were asked for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.cover_photos.relief import (
    ReliefOptions,
    crater,
    draw_relief,
    grid_mesh,
    sand_height,
    smooth_noise,
    smooth_sand,
)


def test_noise_has_mean_0_and_sd_1(rng):
    noise = smooth_noise((120, 90), 8, 2, 0.3, rng)
    assert abs(noise.mean()) < 1e-12
    assert noise.std() == pytest.approx(1)


@pytest.mark.parametrize(("angle", "smooth_axis"), [(0.0, 1), (np.pi / 2, 0)])
def test_ridges_run_along_their_angle(rng, angle, smooth_axis):
    """Steps along a ridge are smaller than across it by the ratio of the two lengths."""
    noise = smooth_noise((256, 256), 12, 3, angle, rng)
    along = np.abs(np.diff(noise, axis=smooth_axis)).mean()
    across = np.abs(np.diff(noise, axis=1 - smooth_axis)).mean()
    assert across / along == pytest.approx(4, rel=0.25)


@given(radius=st.floats(0.1, 1), depth=st.floats(0.01, 0.3))
def test_a_crater_is_deepest_in_the_middle_highest_at_its_crest_and_flat_far_off(radius, depth):
    x = np.linspace(0, 3 * radius, 3001)
    height = crater(x, np.zeros_like(x), radius, depth)
    assert height[0] == pytest.approx(-depth)
    assert x[height.argmax()] == pytest.approx(radius, abs=0.002 * radius)
    assert height.max() == pytest.approx(0.2 * depth, rel=0.01)
    assert (height[x >= 2 * radius] == 0).all()
    assert np.abs(np.diff(height)).max() < 0.01 * depth  # no step at the crest


@settings(max_examples=20)
@given(quadric=st.lists(st.floats(-1, 1), min_size=6, max_size=6).map(np.array))
def test_smooth_sand_finds_any_quadric(quadric):
    x, y = np.meshgrid(np.linspace(-2, 2, 9), np.linspace(-2, 2, 9))
    ground = np.stack([x, y, sand_height(quadric, x, y)], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(smooth_sand(ground), quadric, atol=1e-9)


def test_a_grid_mesh_faces_up():
    x, y = np.meshgrid([0.0, 1, 2], [0.0, 1])
    mesh = grid_mesh(x, y, np.zeros_like(x))
    assert mesh.faces.shape == (4, 3)
    np.testing.assert_allclose(mesh.normals(), np.tile([0, 0, 1], (6, 1)))


def test_relief_without_craters_stays_within_its_spread(rng):
    options = ReliefOptions(layers=2, ridge_sd_m=(0.003, 0.003), swell_sd_m=(0.004, 0.004), most_craters=0)
    x, y = np.meshgrid(np.arange(-2, 2, 0.02), np.arange(-2, 2, 0.02))
    height = draw_relief(x, y, options, rng)
    assert height.std() == pytest.approx(np.sqrt(2 * 0.003**2 + 0.004**2), rel=0.15)
