"""What the pixels of a view see: rays through the distorted lens against the surfaces, a strip of rows at a time.

In and about a pixel its rays go to the same points in every pixel, each of the same weight.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from math import isqrt

import numpy as np
from scipy.special import ndtri
from threadpoolctl import ThreadpoolController

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import pixel_directions
from polarsim.geometry.vectors import dot
from polarsim.render import hit_kernels
from polarsim.render.sensor_options import SensorOptions
from polarsim.render.surfaces import Surfaces

_FILTER_SD_PX = 0.5  # of the Gaussian pixel filter: half a pixel, as far as a box filter of the same area
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
    through = pixel_directions(camera.lens, rows, offset).reshape(-1, 3)
    directions = np.empty_like(through)
    hit_kernels.rotated(camera.world_from_camera.rotation.reshape(-1), through.reshape(-1), directions.reshape(-1))
    return intersect(surfaces, rows, camera.centre, directions, smooth=smooth)


def intersect(
    surfaces: Surfaces, rows: slice, origins: np.ndarray, directions: np.ndarray, *, smooth: bool = True
) -> Hits:
    """What rays along directions (n, 3) meet first; `pixel` numbers the rays, the viewer is where they came from.

    Origins are (3,), the same for all, or (n, 3).
    """
    hits = surfaces.all.intersect(np.broadcast_to(origins, directions.shape), directions)
    count = len(hits.ray)
    point, to_viewer, plane, normal = np.empty((4, 3 * count), np.float32)
    side = np.empty(count, np.float32)
    hit_kernels.points(hits.ray, hits.distance, origins.reshape(-1), directions.reshape(-1), point, to_viewer)
    hit_kernels.planes(hits.normal.reshape(-1), to_viewer, plane, side)  # open meshes may be seen from inside
    if smooth:
        corners, limits = surfaces.corner_normals.reshape(-1), (np.float32(NO_NORMAL), np.float32(LEAST_SLOPE))
        weights = hits.weights.reshape(-1)
        hit_kernels.smooth_normals(hits.face, weights, corners, side, plane, to_viewer, *limits, normal)
    point, to_viewer, plane, normal = (array.reshape(-1, 3) for array in (point, to_viewer, plane, normal))
    return Hits(rows, hits.ray, hits.face, point, to_viewer, normal if smooth else plane, plane, hits.weights)


def between_deg(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n,) angles between unit vectors (n, 3), degrees; exact near 0 and 180."""
    apart, together = (np.sqrt(dot(v, v)) for v in (first - second, first + second))
    return np.asarray(np.degrees(2 * np.arctan2(apart, together)))


def for_strips(height: int, threads: int, work: Callable[[slice], None]) -> None:
    """Do the work for every strip of rows, on so many threads; strips write to points of their own."""
    strips = [slice(start, min(start + STRIP, height)) for start in range(0, height, STRIP)]
    with one_blas_thread():  # its own would wait busily beside ours
        if threads <= 1:
            for strip in strips:
                work(strip)
            return
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, strips))


def one_blas_thread() -> AbstractContextManager[object]:
    """Within it linear algebra, of small matrices, takes one thread."""
    limited: AbstractContextManager[object] = _blas().limit(limits=1)
    return limited


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
        levels *= _FILTER_SD_PX / np.sqrt((levels**2).mean())
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
