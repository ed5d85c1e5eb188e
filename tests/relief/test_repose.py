"""Slopes are limited to the angle of repose."""

import numpy as np

from polarsim.geometry.heightfields import grid_mesh
from polarsim.relief.repose import limit_slopes
from tests.relief.synthetic import GRID, bump


def steepest_deg(heights: np.ndarray) -> float:
    """Return the slope of the steepest triangle of the mesh of heights."""
    mesh = grid_mesh(*np.moveaxis(GRID.centres(), -1, 0), heights)
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.degrees(np.arccos(normal[:, 2] / np.linalg.norm(normal, axis=1))).max())


def test_no_triangle_is_steeper_than_repose():
    steep = bump(height=0.3, sigma=0.08)
    assert steepest_deg(steep) > 60
    assert steepest_deg(limit_slopes(steep, GRID.cell, np.zeros(GRID.shape, bool))) < 35.001


def test_sand_slides_without_a_change_of_volume():
    steep = bump(height=0.2, sigma=0.08)
    limited = limit_slopes(steep, GRID.cell, np.zeros(GRID.shape, bool))
    assert limited.max() < steep.max() - 0.01
    np.testing.assert_allclose(limited.mean(), steep.mean(), rtol=1e-9)


def test_gentle_slopes_and_fixed_cells_do_not_change():
    gentle = bump()
    np.testing.assert_array_equal(limit_slopes(gentle, GRID.cell, np.zeros(GRID.shape, bool)), gentle)
    steep = bump(height=0.3)
    np.testing.assert_array_equal(limit_slopes(steep, GRID.cell, np.ones(GRID.shape, bool)), steep)
