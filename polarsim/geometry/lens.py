"""Lens: conversion between directions in a camera frame (x right, y down, z forward) and pixels of its photo.

Pixel centres are at integer + 0.5, and the photo extends from 0 to its width. OpenCV's calibrations count from the
centre of the first pixel; only `Lens.from_opencv` converts between both conventions.

`Lens.directions` inverts the distortion of each pixel by Newton's method, which took a quarter of the time of ray
casts. The inverse is smooth: Chebyshev polynomials of degree 14 in u and v approximate it to 1e-6 px over the entire
photo, and higher degrees are used if necessary. `pixel_directions` evaluates them for all pixels of rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

CHUNK = 1 << 14  # number of pixels with arrays that fit the cache
UNDISTORTION_CONVERGED = (
    1e-7  # convergence of the undistortion, in units of the focal length: the next step squares the error
)
HALF_PIXEL = 0.5  # OpenCV's (0, 0) is our (0.5, 0.5)
MAX_ERROR_PX = 1e-6  # maximum reprojection error of a polynomial
_DEGREES = (14, 24, 40)


@dataclass(frozen=True)
class Lens:
    """Brown's model in OpenCV's form: focal lengths and principal point in pixels, k1 k2 p1 p2 k3 without unit."""

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    width: int = field(kw_only=True)  # of the photo
    height: int = field(kw_only=True)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the photo."""
        return self.height, self.width

    @classmethod
    def from_opencv(cls, matrix: np.ndarray, distortion: np.ndarray, size: tuple[int, int]) -> Lens:
        """Create a lens from a camera matrix (3, 3), distortion (k1 k2 p1 p2 [k3]) and size (width, height)."""
        terms = np.zeros(5)
        terms[: len(distortion)] = distortion
        return cls(
            float(matrix[0, 0]),
            float(matrix[1, 1]),
            float(matrix[0, 2]) + HALF_PIXEL,
            float(matrix[1, 2]) + HALF_PIXEL,
            tuple(terms.tolist()),  # type: ignore[arg-type]
            width=size[0],
            height=size[1],
        )

    def opencv_matrix(self) -> np.ndarray:
        """Return the camera matrix (3, 3) in OpenCV's pixel convention."""
        return np.array(
            [[self.fx, 0, self.cx - HALF_PIXEL], [0, self.fy, self.cy - HALF_PIXEL], [0, 0, 1]], dtype=float
        )

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return pixels (..., 2) of points (..., 3) in the camera frame; NaN for points with negative depth."""
        depth = points[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.where(depth > 1e-6, points[..., 0] / depth, np.nan)
            y = np.where(depth > 1e-6, points[..., 1] / depth, np.nan)
        xd, yd = self._distort(x, y)
        return np.stack([self.fx * xd + self.cx, self.fy * yd + self.cy], axis=-1)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Return directions (..., 3) with z = 1 of pixels (..., 2): the inverse of `project`, to 1e-9 px."""
        # Contiguous, so that `flat` is a view of the array.
        distorted = np.ascontiguousarray((np.asarray(pixels) - [self.cx, self.cy]) / [self.fx, self.fy])
        if any(self.distortion):
            flat = distorted.reshape(-1, 2)
            for start in range(0, len(flat), CHUNK):
                flat[start : start + CHUNK] = self._undistorted(*flat[start : start + CHUNK].T)
        return np.concatenate([distorted, np.ones_like(distorted[..., :1])], axis=-1)

    def pixel_directions(self, rows: slice = slice(None), columns: slice = slice(None)) -> np.ndarray:
        """Return directions (h, w, 3) with z = 1 through the centres of the photo's pixels, or of a part of them."""
        u = np.arange(self.width)[columns] + HALF_PIXEL
        v = np.arange(self.height)[rows] + HALF_PIXEL
        return self.directions(np.stack(np.meshgrid(u, v), axis=-1))

    def scaled(self, factor: float) -> Lens:
        """Return the lens for a photo that is `factor` times as large."""
        fx, fy, cx, cy = (factor * value for value in (self.fx, self.fy, self.cx, self.cy))
        width, height = round(self.width * factor), round(self.height * factor)
        return Lens(fx, fy, cx, cy, self.distortion, width=width, height=height)

    def _undistorted(self, xd: np.ndarray, yd: np.ndarray) -> np.ndarray:
        """Return (n, 2) the inverse of `_distort` by Newton's method, in three or four steps."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xd, yd
        for _ in range(20):
            ex, ey = self._distort(x, y)
            ex, ey = ex - xd, ey - yd
            r2, xy = x * x + y * y, x * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))  # the derivative of `radial` along x is slope * x
            xx = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x  # the Jacobian, symmetric
            yy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
            mixed = slope * xy + 2 * p1 * x + 2 * p2 * y
            determinant = xx * yy - mixed * mixed
            x, y = x - (yy * ex - mixed * ey) / determinant, y - (xx * ey - mixed * ex) / determinant
            if max(np.abs(ex).max(initial=0), np.abs(ey).max(initial=0)) < UNDISTORTION_CONVERGED:
                break
        return np.stack([x, y], axis=-1)

    def _distort(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )


def pixel_directions(lens: Lens, rows: slice, offset: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Return directions (rows, w, 3) with z = 1 through the pixels' centres, moved by `offset` pixels."""
    u, v = _centres(lens, offset)
    v = v[rows]
    fit = _inverse(lens)
    if fit is None:
        return lens.directions(np.stack(np.meshgrid(u, v), axis=-1))
    directions = np.ones((len(v), len(u), 3))
    directions[..., :2] = _evaluated(fit, lens, u, v)
    return directions


def separated(lens: Lens, offset: tuple[float, float] = (0.0, 0.0)) -> tuple[np.ndarray, np.ndarray] | None:
    """Return directions of an entire photo as sums of products, for devices with slow transfers.

    x and y of the direction through pixel (v, u), moved by `offset` pixels, are of_row[v].T @ of_column[u], for the
    results (h, n, 2) and (w, n). None if no polynomial is accurate enough.
    """
    fit = _inverse(lens)
    if fit is None:
        return None
    u, v = _centres(lens, offset)
    along_v = chebyshev.chebvander(2 * v / lens.height - 1, len(fit) - 1)
    return np.einsum("vi,ijk->vjk", along_v, fit), chebyshev.chebvander(2 * u / lens.width - 1, len(fit) - 1)


def _centres(lens: Lens, offset: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates u (w,) and v (h,) of pixels' centres, moved by `offset` pixels."""
    return np.arange(lens.width) + HALF_PIXEL + offset[0], np.arange(lens.height) + HALF_PIXEL + offset[1]


@lru_cache(maxsize=16)
def _inverse(lens: Lens) -> np.ndarray | None:
    """Return coefficients (n, n, 2) by v and u of the x and y of directions; None if no degree is accurate enough."""
    for degree in _DEGREES:
        nodes = chebyshev.chebpts1(degree + 1)
        u, v = _range_of(nodes, lens.width), _range_of(nodes, lens.height)
        values = lens.directions(np.stack(np.meshgrid(u, v), axis=-1))[..., :2]
        from_values = np.linalg.inv(chebyshev.chebvander(nodes, degree))
        fit = np.einsum("iv,vuk,ju->ijk", from_values, values, from_values)
        if _max_error_px(fit, lens) < MAX_ERROR_PX:
            return fit
    return None


def _max_error_px(fit: np.ndarray, lens: Lens) -> float:
    """Return the maximum reprojection error of directions on a grid that does not contain the nodes."""
    u, v = np.linspace(0, lens.width, 67), np.linspace(0, lens.height, 53)
    directions = _evaluated(fit, lens, u, v)
    exact = lens.directions(np.stack(np.meshgrid(u, v), axis=-1))[..., :2]
    return float((np.abs(directions - exact) * [lens.fx, lens.fy]).max())


def _evaluated(fit: np.ndarray, lens: Lens, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return values (v, u, 2) of a fit on a grid of pixels."""
    along_v = chebyshev.chebvander(2 * v / lens.height - 1, len(fit) - 1)
    along_u = chebyshev.chebvander(2 * u / lens.width - 1, len(fit) - 1)
    return np.stack([along_v @ fit[..., axis] @ along_u.T for axis in range(2)], axis=-1)


def _range_of(nodes: np.ndarray, size: int) -> np.ndarray:
    """Convert coordinates -1 to 1 to pixels 0 to `size`."""
    return (nodes + 1) / 2 * size
