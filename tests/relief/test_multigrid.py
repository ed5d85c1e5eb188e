"""The multigrid solver finds the minimum of the energy that its docstring states."""

import numpy as np
import pytest
from scipy import ndimage

from polarsim.relief import multigrid
from polarsim.relief.multigrid import Energy, minimise, quad_differences


def random_energy(shape: tuple[int, int], stiffness: float, seed: int = 0) -> Energy:
    random = np.random.default_rng(seed)
    gradient = random.normal(size=(shape[0] - 1, shape[1] - 1, 2)) * 500
    curvature = np.stack([gradient[..., 0] ** 2, gradient.prod(axis=-1), gradient[..., 1] ** 2], axis=-1)
    curvature[..., [0, 2]] += 1e5
    slope = random.normal(size=gradient.shape) * 1e3
    pull = np.where(random.random(shape) < 0.1, 1e4, 0.0)
    return Energy(curvature, slope, pull, random.normal(size=shape) * 0.01, stiffness)


def value(energy: Energy, heights: np.ndarray) -> float:
    """Return the energy, as in the docstring of the module."""
    x, y = quad_differences(heights)
    xx, xy, yy = np.moveaxis(energy.curvature, -1, 0)
    total = ((xx * x * x + 2 * xy * x * y + yy * y * y) / 2 - energy.slope[..., 0] * x - energy.slope[..., 1] * y).sum()
    total += (energy.pull * (heights - energy.target) ** 2).sum() / 2
    bends = [np.diff(heights, 2, axis=0), np.diff(heights, 2, axis=1), np.diff(np.diff(heights, axis=0), axis=1)]
    return total + energy.stiffness / 2 * sum(w * (bend**2).sum() for w, bend in zip((1, 1, 2), bends, strict=True))


@pytest.mark.parametrize("shape", [(7, 9), (16, 16), (33, 20)])
@pytest.mark.parametrize("stiffness", [0.0, 1e4, 1e7])
def test_no_direction_lowers_the_energy_of_the_solution(shape, stiffness):
    energy = random_energy(shape, stiffness)
    solution = minimise(energy, np.zeros(shape), tolerance=1e-10)
    random = np.random.default_rng(1)
    least = value(energy, solution)
    for smooth in (0, 2, 5):
        direction = ndimage.gaussian_filter(random.normal(size=shape), smooth) * 1e-4
        up, down = (value(energy, solution + sign * direction) for sign in (1, -1))
        assert min(up, down) >= least
        assert up - down == pytest.approx(0, abs=1e-4 * (up + down - 2 * least))


def test_the_start_does_not_matter():
    energy = random_energy((40, 30), 1e5)
    start = np.random.default_rng(2).normal(size=(40, 30))
    solutions = [minimise(energy, begin, tolerance=1e-9) for begin in (np.zeros((40, 30)), start)]
    np.testing.assert_allclose(*solutions, atol=1e-6)


def test_a_plane_through_few_points_is_continued_over_the_grid():
    """A thin plate with free edges has no energy if it is a plane."""
    shape = (50, 60)
    plane = 0.01 * np.arange(50)[:, None] - 0.02 * np.arange(60)[None] + 0.3
    pull = np.zeros(shape)
    pull[[3, 40, 20], [5, 10, 50]] = 1e4
    energy = Energy(np.zeros((49, 59, 3)), np.zeros((49, 59, 2)), pull, plane, 1e4)
    np.testing.assert_allclose(minimise(energy, np.zeros(shape), tolerance=1e-12), plane, atol=1e-4)


def test_large_grids_need_few_steps(monkeypatch):
    """Plain conjugate gradients need more than 600 steps."""
    cycles = []
    real = multigrid._cycle
    monkeypatch.setattr(
        multigrid, "_cycle", lambda levels, number, load: cycles.append(number) or real(levels, number, load)
    )
    shape = (256, 256)
    x, y = np.meshgrid(np.linspace(-1, 1, 256), np.linspace(-1, 1, 256))
    wave = 0.1 * np.sin(2 * x) * np.cos(y)  # longer than the grid
    slope = np.stack(quad_differences(wave), axis=-1) * 1e6
    curvature = np.zeros((255, 255, 3))
    curvature[..., [0, 2]] = 1e6
    energy = Energy(curvature, slope, np.full(shape, 1.0), wave, 1e5)
    solution = minimise(energy, np.zeros(shape), tolerance=1e-5)
    assert np.abs(solution - wave).max() < 2e-4
    assert cycles.count(0) <= 20
