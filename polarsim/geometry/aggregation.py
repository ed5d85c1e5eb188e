"""Semi-global aggregation of matching costs over a grid (Hirschmueller, IEEE TPAMI 30 (2008) 328)."""

from __future__ import annotations

import numpy as np

from polarsim.kernels import njit

_PATHS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1))


def aggregate(cost: np.ndarray, small_step: float, large_step: float) -> np.ndarray:
    """Return costs (rows, columns, k) plus the cost of the cheapest paths from eight directions.

    Parameters
    ----------
    cost : (rows, columns, k) float32
        Matching cost of every cell and candidate.
    small_step, large_step : float
        Cost of neighbours that differ by one candidate, and by more.
    """
    total = np.zeros(cost.shape, np.float32)
    cost, steps = np.ascontiguousarray(cost, np.float32), (np.float32(small_step), np.float32(large_step))
    for down, right in _PATHS:
        _add_path(cost, down, right, *steps, total)
    return total / len(_PATHS)


@njit(nogil=True)
def _add_path(cost, down, right, small_step, large_step, total):  # type: ignore[no-untyped-def]
    rows, columns, count = cost.shape
    path = np.zeros((2, columns, count), np.float32)  # of this row and of the former row
    for line in range(rows):
        row = line if down >= 0 else rows - 1 - line
        now, before = path[line % 2], path[(line + 1) % 2]
        for place in range(columns):
            column = place if right >= 0 else columns - 1 - place
            former_column = column - right
            inside = 0 <= former_column < columns and (down == 0 or line > 0)
            if not inside:
                for k in range(count):
                    now[column, k] = cost[row, column, k]
            else:
                former = now[former_column] if down == 0 else before[former_column]
                lowest = former[0]
                for k in range(1, count):
                    lowest = min(lowest, former[k])
                for k in range(count):
                    best = min(former[k], lowest + large_step)
                    if k > 0:
                        best = min(best, former[k - 1] + small_step)
                    if k < count - 1:
                        best = min(best, former[k + 1] + small_step)
                    now[column, k] = cost[row, column, k] + best - lowest
            for k in range(count):
                total[row, column, k] += now[column, k]


def minima(cost: np.ndarray) -> np.ndarray:
    """Return the candidate (rows, columns) of minimum cost (rows, columns, k), interpolated by a parabola."""
    best = np.clip(cost.argmin(axis=2), 1, cost.shape[2] - 2)
    left, middle, right = (np.take_along_axis(cost, best[..., None] + step, axis=2)[..., 0] for step in (-1, 0, 1))
    curvature = left + right - 2 * middle
    shift = np.divide(left - right, 2 * curvature, out=np.zeros_like(left), where=curvature > 0)
    return np.asarray(best + np.clip(shift, -1.0, 1.0), float)
