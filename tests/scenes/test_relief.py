"""Random relief has the given heights and directions."""

import numpy as np
import pytest

from polarsim.geometry.heightfields import crater, grid_mesh, rough_waves, smooth_noise, sum_noise
from polarsim.scenes.layout import draw_relief
from polarsim.scenes.options import SceneRanges


@pytest.mark.parametrize(("angle", "smooth_axis"), [(0.0, 1), (np.pi / 2, 0)])
def test_ridges_run_along_their_angle(rng, angle, smooth_axis):
    """Steps along a ridge are smaller than across the ridge by the ratio of the correlation lengths."""
    noise = smooth_noise((256, 256), 12, 3, angle, rng)
    assert abs(noise.mean()) < 1e-12
    assert noise.std() == pytest.approx(1)
    along = np.abs(np.diff(noise, axis=smooth_axis)).mean()
    across = np.abs(np.diff(noise, axis=1 - smooth_axis)).mean()
    assert across / along == pytest.approx(4, rel=0.25)


@pytest.mark.parametrize(("radius", "depth"), [(0.1, 0.3), (1, 0.01), (0.5, 0.1)])
def test_a_crater_is_deepest_in_the_centre_highest_at_its_crest_and_flat_far_off(radius, depth):
    x = np.linspace(0, 3 * radius, 3001)
    height = crater(x, np.zeros_like(x), radius, depth)
    assert height[0] == pytest.approx(-depth)
    assert x[height.argmax()] == pytest.approx(radius, abs=0.002 * radius)
    assert height.max() == pytest.approx(0.2 * depth, rel=0.01)
    assert (height[x >= 2 * radius] == 0).all()
    assert np.abs(np.diff(height)).max() < 0.01 * depth  # no step at the crest


def test_a_grid_mesh_faces_up():
    x, y = np.meshgrid([0.0, 1, 2], [0.0, 1])
    mesh = grid_mesh(x, y, np.zeros_like(x))
    assert mesh.faces.shape == (4, 3)
    np.testing.assert_allclose(mesh.normals(), np.tile([0, 0, 1], (6, 1)))


def test_relief_without_craters_has_the_spread_of_its_layers_together(rng):
    options = SceneRanges(
        max_layers=0, rough_sd_m=(0.003, 0.003), swell_sd_m=(0.004, 0.004), swell_width_m=0.1, max_craters=0
    )
    x, y = np.meshgrid(np.arange(-2, 2, 0.02), np.arange(-2, 2, 0.02))
    spread = np.mean([draw_relief(x, y, options, rng).std() for _ in range(8)])
    assert spread == pytest.approx(np.hypot(0.003, 0.004), rel=0.1)


def test_rough_sand_has_no_structure_below_its_finest_size(rng):
    """Steps between neighbours with a finest size of 8 cells are less than half of the steps with 1 cell."""
    steps = []
    for finest in (1, 8):
        noise = sum_noise((256, 256), [(1.0, rough_waves((256, 256), finest, 40))], rng)
        steps.append(np.abs(np.diff(noise)).mean())
    assert steps[1] < 0.5 * steps[0]
