import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rocks.heights import (
    FloorGrid,
    filled,
    hull_mask,
    mean_heights,
    smoothed,
    top_heights,
    upward_normals,
)
from polarsim.rocks.scans import Extent

GRID = FloorGrid(Extent(-0.5, -0.3, 0.5, 0.3), 0.01)


def plane(points, a=0.2, b=-0.3, c=0.05):
    return a * points[..., 0] + b * points[..., 1] + c


def test_means_are_weighted():
    points = np.array([[0.001, 0.001, 1.0], [0.002, 0.003, 4.0]])
    mean, weights = mean_heights(GRID, points, np.array([2.0, 1.0]))
    row, column = np.argwhere(weights > 0)[0]
    assert mean[row, column] == pytest.approx(2.0)
    assert np.isnan(mean).sum() == mean.size - 1


def one_cell(heights):
    """Return the top of points with given heights in one cell, and the sum of weights."""
    points = np.column_stack([np.full((len(heights), 2), 0.001), heights])
    top, weights = top_heights(GRID, points, np.ones(len(heights)))
    ((row, column),) = np.argwhere(weights > 0)
    return top[row, column], weights[row, column]


def test_the_top_of_an_overhang_is_the_upper_surface():
    assert one_cell([0.0, 0.10, 0.001, 0.102, 0.002, 0.104]) == pytest.approx((0.102, 3))
    assert one_cell([0.0, 0.0, 0.05, 0.05, 0.10, 0.10]) == pytest.approx((0.10, 2))  # three surfaces


def test_the_top_of_a_slope_in_a_cell_is_the_mean():
    heights = np.linspace(0, 0.028, 9)  # across a cell of 5 mm at 80 degrees
    assert one_cell(heights) == pytest.approx((0.014, 9))


def test_a_stray_point_is_not_the_top():
    assert one_cell([0.0, 0.001, 0.002, 0.003, 0.5]) == pytest.approx((0.0015, 4))
    assert one_cell([*np.zeros(18), 0.5, 0.5]) == pytest.approx((0.0, 18))


def test_points_outside_the_grid_are_ignored():
    _, weights = mean_heights(GRID, np.array([[0.6, 0, 1], [0, -0.31, 1]]), np.ones(2))
    assert not weights.any()


@given(x=st.floats(-0.49, 0.49), y=st.floats(-0.29, 0.29))
def test_sampling_a_plane_gives_the_plane(x, y):
    point = np.array([[x, y]])
    assert GRID.sample(plane(GRID.centres()), point)[0] == pytest.approx(plane(point)[0], abs=1e-12)


def test_a_hole_in_a_plane_is_filled_by_the_plane():
    heights = plane(GRID.centres())
    known = np.ones(GRID.shape, bool)
    known[20:40, 30:60] = False
    result = filled(np.where(known, heights, 0), known)
    np.testing.assert_array_equal(result[known], heights[known])
    assert np.abs(result - heights).max() < 0.003  # the relaxation stops early; the plane spans 0.38 m


def test_a_filled_hole_is_between_the_heights_of_its_rim():
    rng = np.random.default_rng(3)
    heights, known = rng.normal(size=GRID.shape), rng.random(GRID.shape) > 0.3
    result = filled(np.where(known, heights, 99), known)
    assert result.max() <= heights[known].max()
    assert result.min() >= heights[known].min()


def test_smoothing_ignores_values_without_weight():
    values, weights = np.full(GRID.shape, 2.0), np.ones(GRID.shape)
    values[10, 10], weights[10, 10] = 1e6, 0
    np.testing.assert_allclose(smoothed(values, weights, 1.5), 2.0)


def test_normals_of_a_plane():
    normal = np.array([-0.2, 0.3, 1]) / np.linalg.norm([-0.2, 0.3, 1])
    np.testing.assert_allclose(
        upward_normals(plane(GRID.centres()), GRID.cell), np.broadcast_to(normal, (*GRID.shape, 3))
    )


def test_the_hull_of_a_ring_is_a_disc():
    y, x = np.mgrid[-10:11, -10:11]
    r = np.hypot(x, y)
    np.testing.assert_array_equal(hull_mask((r <= 10) & (r > 8)), r <= 10)
    line = np.zeros((4, 4), bool)
    line[2] = True
    np.testing.assert_array_equal(hull_mask(line), line)


@given(x0=st.floats(-2, 0), width=st.floats(0.5, 3))
def test_snapped_extents_of_one_cell_share_their_lattice(x0, width):
    snapped = Extent(x0, 0, x0 + width, 1).snapped(0.005)
    assert snapped.x0 / 0.005 == pytest.approx(round(snapped.x0 / 0.005), abs=1e-6)
    assert x0 - 1e-8 <= snapped.x0 < x0 + 0.005 + 1e-8
