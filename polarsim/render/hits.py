"""What the pixels of a view see: rays through the distorted lens against the surfaces, a strip of rows at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL, Lens
from polarsim.geometry.poses import Pose
from polarsim.render.surfaces import Surfaces

STRIP = 64  # rows cast at once: bounds memory, and is the unit that threads share
_OFFSETS = {1: ((0.0, 0.0),), 4: ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25))}  # pixels
_LEAST_SLOPE = 1e-3  # smooth normals that face the viewer less than this give way to the flat ones


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


def cast_strip(
    surfaces: Surfaces,
    sandbox_from_camera: Pose,
    lens: Lens,
    rows: slice,
    offset: tuple[float, float] = (0.0, 0.0),
    *,
    smooth: bool = True,
) -> Hits:
    """Cast a ray through every pixel of the rows, `offset` pixels off its centre; normals are flat unless `smooth`."""
    origin = sandbox_from_camera.translation
    directions = _turn(sandbox_from_camera.rotation, pixel_directions(lens, rows, offset).reshape(-1, 3))
    distance, face = surfaces.all.nearest(np.broadcast_to(origin, directions.shape), directions)
    pixel = np.flatnonzero(face >= 0)
    face, directions = face[pixel], directions[pixel]
    point = (origin + distance[pixel, None] * directions).astype(np.float32)
    to_viewer = unit(-directions).astype(np.float32)
    plane = surfaces.planes[face]
    behind = dot(plane, to_viewer) < 0  # open meshes may be seen from inside
    side = np.where(behind, np.float32(-1), np.float32(1))[:, None]
    if not smooth:
        return Hits(rows, pixel, face, point, to_viewer, plane * side, plane * side)
    normal = _smooth_normals(surfaces, face, point, plane) * side
    plane = plane * side
    away = dot(normal, to_viewer) < _LEAST_SLOPE
    normal[away] = plane[away]
    return Hits(rows, pixel, face, point, to_viewer, normal, plane)


def pixel_directions(lens: Lens, rows: slice, offset: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """(rows, w, 3) directions with z = 1 through the pixels' centres, moved by `offset` pixels."""
    u = np.arange(lens.width) + HALF_PIXEL + offset[0]
    v = np.arange(lens.height)[rows] + HALF_PIXEL + offset[1]
    return lens.directions(np.stack(np.meshgrid(u, v), axis=-1))


def _smooth_normals(surfaces: Surfaces, face: np.ndarray, point: np.ndarray, plane: np.ndarray) -> np.ndarray:
    slopes = surfaces.normal_slopes[face]
    normal = np.einsum("nij,nj->ni", slopes[:, :, :3], point - surfaces.corner[face]) + slopes[:, :, 3]
    return np.where(dot(normal, normal)[:, None] > 1e-12, unit(normal), plane)


def _turn(rotation: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Rotate directions (n, 3); BLAS would wake its threads for these thin arrays, and take longer."""
    return np.stack([row[0] * directions[:, 0] + row[1] * directions[:, 1] + row[2] * directions[:, 2]
                     for row in rotation], axis=1)  # fmt: skip


def dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n,) scalar products of vectors (n, 3)."""
    return np.einsum("nk,nk->n", first, second)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) made one long; those of no length stay as they are."""
    square = dot(vectors, vectors)
    return vectors / np.sqrt(np.where(square > 0, square, square.dtype.type(1)))[:, None]


def between_deg(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n,) angles between unit vectors (n, 3), degrees; exact near 0 and 180."""
    apart, together = (np.sqrt(dot(v, v)) for v in (first - second, first + second))
    return np.asarray(np.degrees(2 * np.arctan2(apart, together)))


def for_strips(height: int, threads: int, work: Callable[[slice], None]) -> None:
    """Do the work for every strip of rows, on so many threads; strips write to places of their own."""
    strips = [slice(start, min(start + STRIP, height)) for start in range(0, height, STRIP)]
    if threads <= 1:
        for strip in strips:
            work(strip)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, strips))


def sample_offsets(samples: int) -> tuple[tuple[float, float], ...]:
    """Places inside a pixel, in pixels from its centre."""
    return _OFFSETS[samples]
