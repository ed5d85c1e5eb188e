"""What the pixels of a view see: rays through the distorted lens against the surfaces, a strip of rows at a time.

In and about a pixel its rays go to the same points in every pixel, each of the same weight.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from math import isqrt

import numpy as np
from scipy.special import ndtri
from threadpoolctl import ThreadpoolController

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import pixel_directions
from polarsim.geometry.rays import RayHits
from polarsim.geometry.vectors import dot, moved, rotated, scaled, unit
from polarsim.render.sensor_options import SensorOptions
from polarsim.render.surfaces import Surfaces

STRIP = 64  # rows cast at once: bounds memory, and is the unit that threads share
NO_NORMAL = 1e-12  # square of the length of smooth normals that cancel out
LEAST_SLOPE = 1e-3  # smooth normals that face the viewer less than this give way to the flat ones


@dataclass(frozen=True)
class Hits:
    """The n pixels of a strip of rows that see a surface; float32, sandbox frame."""

    rows: slice
    pixel: np.ndarray  # (n,) flat number of the pixel inside the strip
    face: np.ndarray  # (n,) int64
    point: np.ndarray  # (n, 3) metres
    to_viewer: np.ndarray  # (n, 3) unit
    normal: np.ndarray  # (n, 3) unit, smooth, towards the viewer
    plane: np.ndarray  # (n, 3) unit normal of the flat face, towards the viewer
    weights: np.ndarray  # (n, 2) barycentric, of the face's second and third corner

    def part(self, chosen: np.ndarray) -> Hits:
        """Those with numbers (m,)."""
        arrays = (self.pixel, self.face, self.point, self.to_viewer, self.normal, self.plane, self.weights)
        return Hits(self.rows, *(array.take(chosen, axis=0) for array in arrays))


def cast_strip(
    surfaces: Surfaces,
    camera: Camera,
    rows: slice,
    offset: tuple[float, float] = (0.0, 0.0),
    *,
    smooth: bool = True,
) -> Hits:
    """Cast a ray through every pixel of the rows, `offset` pixels off its centre; normals are flat unless `smooth`."""
    directions = pixel_directions(camera.lens, rows, offset).reshape(-1, 3)
    directions = rotated(camera.world_from_camera.rotation, directions)
    return intersect(surfaces, rows, camera.centre, directions, smooth=smooth)


def intersect(
    surfaces: Surfaces, rows: slice, origins: np.ndarray, directions: np.ndarray, *, smooth: bool = True
) -> Hits:
    """What rays along directions (n, 3) meet first; `pixel` numbers the rays, the viewer is where they came from.

    Origins are (3,), the same for all, or (n, 3).
    """
    hits = surfaces.all.intersect(np.broadcast_to(origins, directions.shape), directions)
    directions = directions.take(hits.ray, axis=0)
    if origins.ndim > 1:
        origins = origins.take(hits.ray, axis=0)
    point = moved(origins, directions, hits.distance).astype(np.float32)
    to_viewer = unit(-directions.astype(np.float32))
    plane = unit(hits.normal.astype(np.float32))
    behind = dot(plane, to_viewer) < 0  # open meshes may be seen from inside
    side = np.where(behind, np.float32(-1), np.float32(1))
    normal = plane = scaled(plane, side)
    if smooth:
        normal = scaled(_smooth_normals(surfaces, hits), side)
        away = np.flatnonzero(dot(normal, to_viewer) < LEAST_SLOPE)
        normal[away] = plane[away]
    return Hits(rows, hits.ray, hits.face, point, to_viewer, normal, plane, hits.weights)


def _smooth_normals(surfaces: Surfaces, hits: RayHits) -> np.ndarray:
    """(m, 3) unit normals between those of the corners; zero where these cancel out."""
    corners = surfaces.corner_normals.take(hits.face, axis=0)  # (m, 3, 3)
    second, third = (hits.weights[:, number].astype(np.float32) for number in range(2))
    first = 1 - second - third
    normal = np.empty((len(first), 3), np.float32)
    for axis in range(3):
        normal[:, axis] = corners[:, 0, axis] * first + corners[:, 1, axis] * second + corners[:, 2, axis] * third
    return scaled(unit(normal), (dot(normal, normal) > NO_NORMAL).astype(np.float32))


def between_deg(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n,) angles between unit vectors (n, 3), degrees; exact near 0 and 180."""
    apart, together = (np.sqrt(dot(v, v)) for v in (first - second, first + second))
    return np.asarray(np.degrees(2 * np.arctan2(apart, together)))


def for_strips(height: int, threads: int, work: Callable[[slice], None]) -> None:
    """Do the work for every strip of rows, on so many threads; strips write to points of their own."""
    strips = [slice(start, min(start + STRIP, height)) for start in range(0, height, STRIP)]
    with _blas().limit(limits=1):  # its own threads would wait busily beside ours
        if threads <= 1:
            for strip in strips:
                work(strip)
            return
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, strips))


@cache
def _blas() -> ThreadpoolController:
    """NumPy's library of linear algebra."""
    return ThreadpoolController().select(user_api="blas")


Offset = tuple[float, float]


def sample_offsets(options: SensorOptions) -> tuple[Offset, ...]:
    """(x, y) of a pixel's samples, in pixels from its centre; their mean is the pixel's value.

    A box: cells of equal size, one sample each. From 9 samples on, and in a Gaussian, the grid is rotated so that no
    two samples share a row or column (Cook, ACM TOG 5 (1986) 51, and Chiu et al., Graphics Gems IV): an upright edge
    then makes as many shades as there are samples. A Gaussian: samples lie at its quantiles, so that pixels stay apart
    from one another and no weights are needed; they are moved outwards until their variance is that of the Gaussian,
    since the centres of its quantiles leave out its tails.
    """
    side = isqrt(options.samples)
    if options.pixel_filter == "gaussian":
        levels = ndtri((np.arange(options.samples) + 0.5) / options.samples)
        levels *= options.filter_sd_px / np.sqrt((levels**2).mean())
        return _rotated(levels, side)
    if side <= 2:
        cells = [(cell + 0.5) / side - 0.5 for cell in range(side)]
        return tuple((x, y) for y in cells for x in cells)
    return _rotated((np.arange(options.samples) + 0.5) / options.samples - 0.5, side)


def _rotated(levels: np.ndarray, side: int) -> tuple[Offset, ...]:
    """One sample in each of side x side cells, row and column by row and column of `levels` (side^2,).

    A rotation by a quarter takes the pattern to itself: no direction is blurred more than another.
    """
    return tuple(
        (float(levels[column * side + row]), float(levels[row * side + side - 1 - column]))
        for row in range(side)
        for column in range(side)
    )
