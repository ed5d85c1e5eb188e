"""Distances from points inside a convex hull to its surface along given directions, compiled."""

from __future__ import annotations

import math

import numpy as np

from polarsim.kernels import njit

_PARALLEL = 1e-6  # minimum cosine between a line and the normal of a facet that it crosses
_OUTSIDE = 1e-9  # m; closer points are on the surface


@njit()
def exits(points, directions, equations):  # type: ignore[no-untyped-def]
    """Return (n,) distances along unit `directions` (n, 3) from `points` (n, 3) to the surface of a hull.

    Also returns (n,) facets there. `equations` (f, 4): outward normal and offset of each facet, as in SciPy. Points
    outside have distance 0.
    """
    result, facets = np.zeros(len(points)), np.zeros(len(points), np.int64)
    for row in range(len(points)):
        x, y, z = points[row, 0], points[row, 1], points[row, 2]
        u, v, w = directions[row, 0], directions[row, 1], directions[row, 2]
        nearest = math.inf
        for facet in range(len(equations)):
            a, b, c, offset = equations[facet, 0], equations[facet, 1], equations[facet, 2], equations[facet, 3]
            depth = -(a * x + b * y + c * z + offset)
            if depth < -_OUTSIDE or nearest < _OUTSIDE:
                nearest = 0.0
                break
            along = a * u + b * v + c * w
            if along > _PARALLEL and depth < nearest * along:
                nearest = depth / along
                facets[row] = facet
        if 0 < nearest < math.inf:
            result[row] = nearest
    return result, facets
