"""Camera rays: intersection of rays through the distorted lens with the surfaces, in strips of image rows.

The rays of a pixel have the same offsets in every pixel, and equal weights.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from math import isqrt

import numpy as np
from threadpoolctl import ThreadpoolController

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import pixel_directions
from polarsim.geometry.vectors import dot
from polarsim.render.hit_engine import hit_kernels
from polarsim.render.options import SensorOptions
from polarsim.render.surfaces import Surfaces

STRIP_ROWS = 64  # rows cast together: limits the memory, and is the unit of work of a thread
NO_NORMAL = 1e-12  # squared length below which interpolated normals cancel out
MIN_FACING = 1e-3  # minimum cosine between smooth normal and viewer; below it the flat normal is used


@dataclass(frozen=True)
class Hits:
    """Intersections of camera rays with surfaces for the n hit pixels of a strip; float32, sandbox frame."""

    rows: slice
    pixel: np.ndarray  # (n,) flat number of the pixel inside the strip
    face: np.ndarray  # (n,) int64
    point: np.ndarray  # (n, 3) metres
    to_viewer: np.ndarray  # (n, 3) unit
    normal: np.ndarray  # (n, 3) unit, smooth, towards the viewer
    plane: np.ndarray  # (n, 3) unit normal of the flat face, towards the viewer
    weights: np.ndarray  # (n, 2) barycentric weights of the second and third corner of the face

    def part(self, chosen: np.ndarray) -> Hits:
        """Return the hits with numbers (m,)."""
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
    """Cast a ray through every pixel of the rows, `offset` pixels from the centre; normals are flat unless `smooth`."""
    through = pixel_directions(camera.lens, rows, offset).reshape(-1, 3)
    directions = np.empty_like(through)
    hit_kernels.rotated(camera.world_from_camera.rotation.reshape(-1), through.reshape(-1), directions.reshape(-1))
    return nearest_surface_hits(surfaces, rows, camera.centre, directions, smooth=smooth)


def nearest_surface_hits(
    surfaces: Surfaces, rows: slice, origins: np.ndarray, directions: np.ndarray, *, smooth: bool = True
) -> Hits:
    """Return the nearest hits of rays along directions (n, 3).

    Origins are (n, 3), or (3,) for a common origin. `pixel` contains the ray numbers; the viewer is the ray origin.
    """
    hits = surfaces.all.intersect(np.broadcast_to(origins, directions.shape), directions)
    count = len(hits.ray)
    point, to_viewer, plane, normal = np.empty((4, 3 * count), np.float32)
    side = np.empty(count, np.float32)
    hit_kernels.hit_points(hits.ray, hits.distance, origins.reshape(-1), directions.reshape(-1), point, to_viewer)
    hit_kernels.planes(hits.normal.reshape(-1), to_viewer, plane, side)  # open meshes may be visible from inside
    if smooth:
        corners, limits = surfaces.corner_normals.reshape(-1), (np.float32(NO_NORMAL), np.float32(MIN_FACING))
        weights = hits.weights.reshape(-1)
        hit_kernels.smooth_normals(hits.face, weights, corners, side, plane, to_viewer, *limits, normal)
    point, to_viewer, plane, normal = (array.reshape(-1, 3) for array in (point, to_viewer, plane, normal))
    return Hits(rows, hits.ray, hits.face, point, to_viewer, normal if smooth else plane, plane, hits.weights)


def between_deg(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the angles (n,) between unit vectors (n, 3), degrees; accurate near 0 and 180."""
    difference, total = (np.sqrt(dot(v, v)) for v in (first - second, first + second))
    return np.asarray(np.degrees(2 * np.arctan2(difference, total)))


def for_strips(height: int, threads: int, work: Callable[[slice], None]) -> None:
    """Call `work` for every strip of rows, in parallel threads; strips must write to separate array elements."""
    strips = [slice(start, min(start + STRIP_ROWS, height)) for start in range(0, height, STRIP_ROWS)]
    with one_blas_thread():  # BLAS threads would compete with ours
        if threads <= 1:
            for strip in strips:
                work(strip)
            return
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, strips))


def one_blas_thread() -> AbstractContextManager[object]:
    """Return a context that limits BLAS to a single thread."""
    limited: AbstractContextManager[object] = _blas().limit(limits=1)
    return limited


@cache
def _blas() -> ThreadpoolController:
    """Return the controller of NumPy's BLAS library."""
    return ThreadpoolController().select(user_api="blas")


Offset = tuple[float, float]


def sample_offsets(options: SensorOptions) -> tuple[Offset, ...]:
    """Return the offsets (x, y) of the samples of a pixel from the pixel centre, px; the pixel value is the mean.

    One sample in each of several cells of equal size. With 9 or more samples the grid is rotated so that no two samples
    share a row or column (Cook, ACM TOG 5 (1986) 51, and Chiu et al., Graphics Gems IV); a vertical edge then has as
    many grey levels as there are samples. The pattern is invariant under rotation by 90 degrees: the blur is the same
    along both axes.
    """
    side = isqrt(options.samples)
    if side <= 2:
        cells = [(cell + 0.5) / side - 0.5 for cell in range(side)]
        return tuple((x, y) for y in cells for x in cells)
    levels = ((np.arange(options.samples) + 0.5) / options.samples - 0.5).tolist()
    return tuple(
        (levels[column * side + row], levels[row * side + side - 1 - column])
        for row in range(side)
        for column in range(side)
    )
