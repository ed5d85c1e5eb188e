"""Directions through all pixels of a photo's rows, quickly: the inverse of a lens as one polynomial in u and v.

A lens is undone pixel by pixel by Newton's method (`Lens.directions`), which took a quarter of the time of casting the
rays. It is smooth, so that Chebyshev polynomials of degree 14 give it to 1e-6 px over the whole photo; where they do
not, more are taken.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from polarsim.geometry.lens import HALF_PIXEL, Lens

CLOSE_PX = 1e-6  # farthest that a direction may lead from its pixel
_DEGREES = (14, 24, 40)


def pixel_directions(lens: Lens, rows: slice, offset: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """(rows, w, 3) directions with z = 1 through the pixels' centres, moved by `offset` pixels."""
    u, v = _centres(lens, offset)
    v = v[rows]
    fit = _inverse(lens)
    if fit is None:
        return lens.directions(np.stack(np.meshgrid(u, v), axis=-1))
    directions = np.ones((len(v), len(u), 3))
    directions[..., :2] = _evaluated(fit, lens, u, v)
    return directions


def separated(lens: Lens, offset: tuple[float, float] = (0.0, 0.0)) -> tuple[np.ndarray, np.ndarray] | None:
    """Directions of a whole photo as sums of products, for devices that multiply faster than they are given arrays.

    Returns
    -------
    of_row, of_column : (h, n, 2), (w, n)
        x and y of the direction through pixel (v, u), moved by `offset` pixels: of_row[v].T @ of_column[u]. None where
        `pixel_directions` finds no polynomial.
    """
    fit = _inverse(lens)
    if fit is None:
        return None
    u, v = _centres(lens, offset)
    along_v = chebyshev.chebvander(2 * v / lens.height - 1, len(fit) - 1)
    return np.einsum("vi,ijk->vjk", along_v, fit), chebyshev.chebvander(2 * u / lens.width - 1, len(fit) - 1)


def _centres(lens: Lens, offset: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Places u (w,) and v (h,) of pixels' centres, moved by `offset` pixels."""
    return np.arange(lens.width) + HALF_PIXEL + offset[0], np.arange(lens.height) + HALF_PIXEL + offset[1]


@lru_cache(maxsize=16)
def _inverse(lens: Lens) -> np.ndarray | None:
    """(n, n, 2) coefficients by v and u of the x and y of directions; None where no degree is close enough."""
    for degree in _DEGREES:
        nodes = chebyshev.chebpts1(degree + 1)
        u, v = _range_of(nodes, lens.width), _range_of(nodes, lens.height)
        values = lens.directions(np.stack(np.meshgrid(u, v), axis=-1))[..., :2]
        from_values = np.linalg.inv(chebyshev.chebvander(nodes, degree))
        fit = np.einsum("iv,vuk,ju->ijk", from_values, values, from_values)
        if _worst_px(fit, lens) < CLOSE_PX:
            return fit
    return None


def _worst_px(fit: np.ndarray, lens: Lens) -> float:
    """How far directions lead from their pixels, at worst, on a grid that does not hold the nodes."""
    u, v = np.linspace(0, lens.width, 67), np.linspace(0, lens.height, 53)
    found = _evaluated(fit, lens, u, v)
    exact = lens.directions(np.stack(np.meshgrid(u, v), axis=-1))[..., :2]
    return float((np.abs(found - exact) * [lens.fx, lens.fy]).max())


def _evaluated(fit: np.ndarray, lens: Lens, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(v, u, 2) values of a fit on a grid of pixels."""
    along_v = chebyshev.chebvander(2 * v / lens.height - 1, len(fit) - 1)
    along_u = chebyshev.chebvander(2 * u / lens.width - 1, len(fit) - 1)
    return np.stack([along_v @ fit[..., axis] @ along_u.T for axis in range(2)], axis=-1)


def _range_of(nodes: np.ndarray, size: int) -> np.ndarray:
    """Places -1 to 1 as pixels 0 to `size`."""
    return (nodes + 1) / 2 * size
