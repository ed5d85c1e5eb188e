"""Angle of repose: limit the slope of a height field."""

from __future__ import annotations

import numpy as np

from polarsim.kernels import njit
from polarsim.rocks.fitted_ground import MAX_SLOPE_DEG

_STEEPEST = float(np.tan(np.radians(MAX_SLOPE_DEG)))
_AIM = 0.98  # of the steepest slope, to which steeper triangles are flattened
_SWEEPS = 500


def limit_slopes(heights: np.ndarray, cell: float, fixed: np.ndarray) -> np.ndarray:
    """Return heights (rows, columns) whose triangles are not steeper than the angle of repose.

    Triangles are those of `geometry.heightfields.grid_mesh`. A triangle that is too steep keeps its mean height: sand
    slides from its upper to its lower corners. Triangles with a fixed corner are not changed.
    """
    limited = np.array(heights, float)
    _slide(limited, fixed, _STEEPEST * cell, _AIM * _STEEPEST * cell, _SWEEPS)
    return limited


@njit(error_model="numpy")
def _slide(heights, fixed, steepest, aim, sweeps):  # type: ignore[no-untyped-def]
    """Flatten triangles in place until none is too steep."""
    rows, columns = heights.shape
    for _ in range(sweeps):
        changed = False
        for row in range(rows - 1):
            for column in range(columns - 1):
                for upper in range(2):
                    # The right angle is at (row, column + 1) or (row + 1, column).
                    r, c = (row + 1, column) if upper else (row, column + 1)
                    rx, cx = (row + 1, column + 1) if upper else (row, column)
                    ry, cy = (row, column) if upper else (row + 1, column + 1)
                    if fixed[r, c] or fixed[rx, cx] or fixed[ry, cy]:
                        continue
                    x, y = heights[rx, cx] - heights[r, c], heights[ry, cy] - heights[r, c]
                    slope = np.sqrt(x * x + y * y)
                    if slope > steepest:
                        share = aim / slope
                        mean = heights[r, c] + (x + y) / 3
                        heights[r, c] = mean - share * (x + y) / 3
                        heights[rx, cx] = heights[r, c] + share * x
                        heights[ry, cy] = heights[r, c] + share * y
                        changed = True
        if not changed:
            break
