from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.rocks.bumps import add_bumps, curvature
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import SandSurface, find_ground
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.regions import Limits, RockRegion, measure_mask
from polarsim.rocks.scans import Extent, ScanPoints

CELL, HALF = 0.005, 0.4  # metres
DENSITY, NOISE = 8, 0.002  # points per cell of three scans, metres
LIMITS = Limits(foot=0.006, height=0.015, confirmed_height=0.010, size=0.035)
NOBODY = Evidence({}, {}, 0.3)

Height = Callable[[np.ndarray, np.ndarray], np.ndarray]


def sand_of(height: Height, seed: int = 1, unseen: Height | None = None) -> SandSurface:
    """Return sand of noisy points on z(x, y), without points where `unseen` is positive."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-HALF, HALF, (2, DENSITY * round(2 * HALF / CELL) ** 2))
    if unseen is not None:
        x, y = (axis[unseen(x, y) <= 0] for axis in (x, y))
    points = np.stack([x, y, height(x, y) + rng.normal(0, NOISE, len(x))], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (len(x), 1))
    extent = Extent(-HALF, -HALF, HALF, HALF)
    return find_ground(ScanPoints(points, up, np.ones(len(x))), extent, CELL)


def found(sand: SandSurface, regions: list[RockRegion] | None = None) -> list[RockRegion]:
    return add_bumps(sand, regions or [], LIMITS, NOBODY)[1]


def cap(size: float, height: float, x0: float = 0.0, y0: float = 0.0) -> Height:
    """Return a paraboloid on level sand; `size` is the diameter of its foot."""
    return lambda x, y: height * np.maximum(0, 1 - ((x - x0) ** 2 + (y - y0) ** 2) / (size / 2) ** 2)


def ripples(wave: float, height: float) -> Height:
    return lambda x, y: height / 2 * np.sin(2 * np.pi * (0.8 * x + 0.6 * y) / wave)


@settings(max_examples=12)
@given(
    size=st.floats(0.055, 0.085),
    share=st.floats(0.22, 0.3),
    x0=st.floats(-0.2, 0.2),
    y0=st.floats(-0.2, 0.2),
    slope=st.floats(-0.15, 0.15),
)
def test_a_small_cap_is_detected_anywhere_on_a_slope_of_sand(size, share, x0, y0, slope):
    one = cap(size, share * size, x0, y0)
    [rock] = found(sand_of(lambda x, y: one(x, y) + slope * x))
    np.testing.assert_allclose(rock.centre, [x0, y0], atol=0.006)
    assert size - 0.020 < rock.size < size + 0.015
    assert rock.height == pytest.approx(share * size, rel=0.3)
    assert rock.confirmed == ()


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_not_a_rock(seed):
    assert found(sand_of(lambda x, y: 0 * x, seed)) == []


@pytest.mark.parametrize(
    "height",
    [
        lambda x, y: 0.015 * np.maximum(0, 1 - (y / 0.03) ** 2),
        ripples(wave=0.12, height=0.010),
        ripples(wave=0.08, height=0.006),
        lambda x, y: ripples(0.12, 0.008)(x, y) + ripples(0.12, 0.008)(y, -x),
        lambda x, y: 0.012 * np.exp(-(x**2 + y**2) / (2 * 0.05**2)),
        cap(0.090, 0.009),
        cap(0.020, 0.008),
        cap(0.115, 0.028),
    ],
    ids=["ridge", "long ripples", "short ripples", "crossed ripples", "heap", "flat cap", "pebble", "large cap"],
)
def test_shapes_of_sand_and_pebbles_are_not_rocks(height):
    assert found(sand_of(height)) == []


def test_a_cap_is_a_rock_only_on_even_sand():
    one = cap(0.06, 0.015)
    assert len(found(sand_of(one))) == 1
    assert found(sand_of(lambda x, y: one(x, y) + ripples(0.12, 0.016)(x, y))) == []


def test_a_half_hidden_cap_is_not_a_rock():
    assert len(found(sand_of(cap(0.06, 0.015), unseen=lambda x, y: y - 0.10))) == 1
    assert found(sand_of(cap(0.06, 0.015), unseen=lambda x, y: y - 0.03)) == []


def test_existing_rocks_are_kept_and_not_detected_again():
    sand = sand_of(lambda x, y: cap(0.07, 0.017, -0.2)(x, y) + cap(0.06, 0.014, 0.2)(x, y))
    points = sand.grid.centres()
    rock = measure_mask(sand, np.hypot(points[..., 0] + 0.2, points[..., 1]) < 0.03)
    left, right = found(sand, [rock])
    assert left is rock
    np.testing.assert_allclose(right.centre, [0.2, 0], atol=0.006)


def test_curvature_of_a_paraboloid_and_of_a_ridge():
    grid = FloorGrid(Extent(-0.2, -0.2, 0.2, 0.2), CELL)
    x, y = np.moveaxis(grid.centres(), -1, 0)
    centre = (slice(30, 50), slice(30, 50))
    np.testing.assert_allclose(
        curvature(-3 * x**2 - 5 * y**2, CELL, 0.012)[centre], 6, rtol=0.01
    )  # filters end at 4 sigma
    np.testing.assert_allclose(curvature(-5 * (0.6 * x + 0.8 * y) ** 2, CELL, 0.012)[centre], 0, atol=0.06)
