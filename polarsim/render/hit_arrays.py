"""The functions of `hit_kernels` in NumPy, for installations without Numba. Results are equal to the last bit."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.vectors import dot, length, normalise, points_along, scale_vectors

_1 = np.float32(1)


def rows(vectors: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    return vectors.take(numbers, axis=0)


def rotated(rotation: np.ndarray, vectors: np.ndarray, out: np.ndarray) -> None:
    given = vectors.reshape(-1, 3)
    for axis, row in enumerate(rotation.reshape(3, 3)):  # a matrix product may add in another order
        out[axis::3] = row[0] * given[:, 0] + row[1] * given[:, 1] + row[2] * given[:, 2]


def hit_points(
    ray: np.ndarray,
    distance: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    point: np.ndarray,
    to_viewer: np.ndarray,
) -> None:
    along, starts = directions.reshape(-1, 3)[ray], origins.reshape(-1, 3)
    if len(origins) == len(directions):
        starts = starts[ray]
    point.reshape(-1, 3)[:] = points_along(np.broadcast_to(starts, along.shape), along, distance)
    to_viewer.reshape(-1, 3)[:] = normalise(-along.astype(np.float32))


def planes(normal: np.ndarray, to_viewer: np.ndarray, plane: np.ndarray, side: np.ndarray) -> None:
    unit = normalise(normal.reshape(-1, 3).astype(np.float32))
    side[:] = np.where(dot(unit, to_viewer.reshape(-1, 3)) < 0, -_1, _1)
    plane.reshape(-1, 3)[:] = scale_vectors(unit, side)


def smooth_normals(
    face: np.ndarray,
    weights: np.ndarray,
    corner_normals: np.ndarray,
    side: np.ndarray,
    plane: np.ndarray,
    to_viewer: np.ndarray,
    min_square: np.float32,
    min_facing: np.float32,
    normal: np.ndarray,
) -> None:
    second, third = weights.reshape(-1, 2).astype(np.float32).T
    first = _1 - second - third
    corners = corner_normals.reshape(-1, 3, 3)[face]
    between = scale_vectors(corners[:, 0], first) + scale_vectors(corners[:, 1], second)
    between += scale_vectors(corners[:, 2], third)
    defined = (dot(between, between) > min_square).astype(np.float32)
    smooth = scale_vectors(scale_vectors(normalise(between), defined), side)
    flat = dot(smooth, to_viewer.reshape(-1, 3)) < min_facing
    normal.reshape(-1, 3)[:] = np.where(flat[:, None], plane.reshape(-1, 3), smooth)


def facing(
    plane: np.ndarray, normal: np.ndarray, to_lamp: np.ndarray, irradiance: np.ndarray, number: np.ndarray
) -> int:
    flat, smooth, towards = (vectors.reshape(-1, 3) for vectors in (plane, normal, to_lamp))
    chosen = np.flatnonzero((dot(flat, towards) > 0) & (dot(smooth, towards) > 0) & (irradiance > 0))
    number[: len(chosen)] = chosen
    return len(chosen)


def beams(
    chosen: np.ndarray,
    normal: np.ndarray,
    to_lamp: np.ndarray,
    irradiance: np.ndarray,
    direction: np.ndarray,
    received: np.ndarray,
) -> None:
    towards = to_lamp.reshape(-1, 3)[chosen]
    with np.errstate(divide="ignore", invalid="ignore"):  # a lamp at the point itself
        nearness = _1 / length(towards)
        direction.reshape(-1, 3)[:] = scale_vectors(towards, nearness)
        received[:] = irradiance[chosen] * dot(normal.reshape(-1, 3)[chosen], towards) * nearness


def add(strip: np.ndarray, pixel: np.ndarray, value: np.ndarray, share: np.ndarray) -> None:
    strip[pixel] += value * share


def kept(numbers: np.ndarray, hidden: np.ndarray) -> int:
    visible = numbers[~hidden]
    numbers[: len(visible)] = visible
    return len(visible)
