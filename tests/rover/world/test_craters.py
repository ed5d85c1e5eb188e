"""Craters: number by Trask's law, and shape."""

import numpy as np
import pytest

from polarsim.rover.world.craters import (
    DEPTH_OVER_DIAMETER,
    LARGEST_M,
    RIM_SHARE,
    Craters,
    craters_per_m2,
    dig,
    profile,
    random_craters,
)


def test_number_and_sizes_follow_trasks_law():
    """10^10.9 D^-2 craters on 10^6 km2, D in metres."""
    craters = random_craters(0.5, 300.0, seed=1)
    for diameter in (0.5, 1.0, 2.0, 4.0):
        assert 1e12 * craters_per_m2(diameter) == pytest.approx(10**10.9 / diameter**2, rel=0.01)
        expected = 0.5 * 300.0**2 * (craters_per_m2(diameter) - craters_per_m2(LARGEST_M))
        assert (craters.diameter >= diameter).sum() == pytest.approx(expected, abs=4 * np.sqrt(expected))
    ratio = craters.depth / craters.diameter
    assert (ratio.min(), ratio.max()) == pytest.approx(DEPTH_OVER_DIAMETER, abs=1e-3)
    assert np.abs([craters.x, craters.y]).max() < 150
    assert not len(random_craters(0.0, 300.0, 1).x)


def test_a_crater_has_its_depth_and_diameter():
    x = np.linspace(-4, 4, 801)
    level = np.zeros((801, 801))
    dig(level, x, x, Craters(np.array([0.5]), np.array([-1.0]), np.array([2.0]), np.array([0.2])))
    row = level[np.searchsorted(x, -1.0 - 1e-9)]
    assert np.ptp(level) == pytest.approx(0.2, rel=1e-3)
    assert x[row.argmin()] == pytest.approx(0.5, abs=0.06)
    assert abs(x[row.argmax()] - 0.5) == pytest.approx(1.0, abs=0.1)
    assert 0.5 * RIM_SHARE < row.max() / 0.2 < RIM_SHARE  # rounded, and at most as high as the rim of a fresh crater
    assert not row[np.abs(x - 0.5) > 3.15].any()
    assert np.abs(np.diff(profile(np.linspace(0, 4, 4001)))).max() < 0.003  # no step


def test_a_crater_is_omitted_only_where_nodes_are_too_coarse():
    x = np.concatenate([np.linspace(-3, 0, 61), np.arange(1.0, 4.0)])
    level = np.zeros((61, len(x)))
    y = np.linspace(-1.5, 1.5, 61)
    dig(level, x, y, Craters(np.zeros(1), np.zeros(1), np.array([1.0]), np.array([0.1])))
    assert level[:, x < -0.1].min() < -0.05
    assert not level[:, x > 0.5].any()
