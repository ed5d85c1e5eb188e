"""Irradiance from a lamp and the visible share of the disc of a lamp (soft shadow edges)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from polarsim.geometry.vectors import cross, dot, normalise, scale_vectors
from polarsim.render.hit_engine import hit_kernels
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.surfaces import Surfaces

PROBES = 5  # rays to the centre and rim of the disc: if all agree, no more rays are cast
_SCATTER = (0.6180339887, 0.7548776662)  # low-discrepancy steps: the rotations of adjacent pixels differ strongly
_GOLDEN = np.pi * (3 - np.sqrt(5))  # golden angle, radians: Vogel's sunflower covers a disc evenly


def visible_share(
    surfaces: Surfaces,
    points: np.ndarray,
    to_lamp: np.ndarray,
    radius_m: float,
    samples: int,
    rotation: np.ndarray,
    every: int = 1,
) -> np.ndarray:
    """Return the visible share (n,) float32, 0 to 1, of a disc that faces each point; 0 or 1 if the radius is 0.

    Points and vectors to the centre of the disc are (n, 3) float32, metres. `samples`: rays per point in penumbra,
    where the first rays disagree. `rotation` (n,): rotation of the ray pattern at each point, radians; different
    rotations turn banding into noise. `every`: if above 1, the points must be in raster order, and only every n-th
    point is probed at the centre and rim of the disc. Between two fully visible or two fully occluded points, only the
    centre of the disc is tested, unless a test nearby disagrees.
    """

    def visible(numbers: np.ndarray, pattern: np.ndarray) -> np.ndarray:
        """Return the visible share (m,) of a pattern of disc points, for the points with numbers (m,)."""
        at, towards = _rows(numbers, points, to_lamp)
        occluded = np.zeros(len(numbers), np.float32)
        for along in _on_disc(towards, radius_m, pattern, rotation[numbers]):
            occluded += surfaces.all.occluded(at, along, 1.0)
        return 1 - occluded / np.float32(len(pattern))

    def centre_visible(numbers: np.ndarray) -> np.ndarray:
        return ~surfaces.all.occluded(*_rows(numbers, points, to_lamp), 1.0)

    if not radius_m:
        return (~surfaces.all.occluded(points, to_lamp, 1.0)).astype(np.float32)
    share = np.empty(len(points), np.float32)
    unsure = np.arange(len(points))
    if every > 1:
        unsure = _probe_sparsely(share, every, lambda numbers: visible(numbers, _rim()), centre_visible)
    share[unsure] = visible(unsure, _rim())
    soft = np.flatnonzero((share > 0) & (share < 1))
    if len(soft):
        share[soft] = visible(soft, _sunflower(samples))
    return share


def _probe_sparsely(
    share: np.ndarray, every: int, rim_visible: Callable[..., np.ndarray], centre_visible: Callable[..., np.ndarray]
) -> np.ndarray:
    """Fill `share` (n,) of points between equal probes; return the numbers of the remaining points.

    `rim_visible` and `centre_visible` return the visibility (m,) of points with numbers (m,), as a share and as bool.
    """
    count = len(share)
    probed = np.minimum(np.arange(0, count + every - 1, every), max(count - 1, 0)) if count else np.zeros(0, np.int64)
    probes = rim_visible(probed)
    between = np.minimum(np.arange(count) // every, len(probed) - 2) if len(probed) > 1 else np.zeros(count, np.int64)
    first, second = probes[between], probes[np.minimum(between + 1, len(probed) - 1)]
    equal = np.flatnonzero((first == second) & ((first == 0) | (first == 1)))
    differs = np.zeros(count + 2 * every, np.int64)  # a margin on both sides
    differs[every + equal[centre_visible(equal) != (first[equal] == 1)]] = 1
    so_far = np.concatenate([[0], differs.cumsum()])
    near = so_far[every + every // 2 + 1 :][:count] - so_far[every - every // 2 :][:count] > 0
    sure = equal[~near[equal]]
    share[sure] = first[sure]
    return np.delete(np.arange(count), sure)


def _rows(numbers: np.ndarray, points: np.ndarray, to_lamp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if len(numbers) == len(points):
        return points, to_lamp
    return points.take(numbers, axis=0), to_lamp.take(numbers, axis=0)


def _rim() -> np.ndarray:
    """Return the radius and angle (PROBES, 2) of the centre and of rim points of the unit disc."""
    return np.array([[0, 0], *((1, quarter * np.pi / 2) for quarter in range(PROBES - 1))], float)


def _sunflower(samples: int) -> np.ndarray:
    """Return the radius and angle (samples, 2) of points that cover the unit disc evenly."""
    number = np.arange(samples)
    return np.stack([np.sqrt((number + 0.5) / samples), number * _GOLDEN], axis=1)


def to_disc(to_lamp: np.ndarray, radius_m: float, samples: int, rotation: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the vectors (n, 3) to the disc points that `visible_share` tests, first `to_lamp` to the centre."""
    yield to_lamp
    if radius_m:
        yield from _on_disc(to_lamp, radius_m, np.concatenate([_rim()[1:], _sunflower(samples)]), rotation)


def rotations(pixel: np.ndarray, first_row: int | np.ndarray) -> np.ndarray:
    """Return the rotation (n,) of the ray pattern at each pixel (n,) of a strip, radians."""
    return np.asarray(2 * np.pi * ((pixel * _SCATTER[0] + first_row * _SCATTER[1]) % 1))


def _on_disc(to_lamp: np.ndarray, radius_m: float, pattern: np.ndarray, rotation: np.ndarray) -> Iterator[np.ndarray]:
    across, upward = _facing(to_lamp)
    for radius, angle in pattern:
        rotated, far = (angle + rotation).astype(np.float32), np.float32(radius * radius_m)
        offset = scale_vectors(across, far * np.cos(rotated)) + scale_vectors(upward, far * np.sin(rotated))
        yield to_lamp + offset


def _facing(to_lamp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors (n, 3) that are orthogonal to each other and to `to_lamp` (n, 3)."""
    axis = normalise(to_lamp)
    steep = np.abs(axis[:, 2]) > np.float32(0.9)
    helper = np.where(steep[:, None], np.array([1, 0, 0], axis.dtype), np.array([0, 0, 1], axis.dtype))
    across = normalise(cross(axis, helper))
    return across, cross(axis, across)


def lighting(
    surfaces: Surfaces, hits: Hits, lamp: Lamp, *, falloff: bool, samples: int = 1, share: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers (m,) of the hits that a lamp lights, unit vectors to the lamp (m, 3) and irradiance (m,).

    `samples`: rays to a partly visible disc. `share` (n,): visible share of the disc at each hit, if `disc_share` has
    been computed already.
    """
    to_lamp, irradiance = lamp.light_at(hits.point, falloff=falloff)
    vectors = [array.reshape(-1) for array in (hits.plane, hits.normal, to_lamp)]
    lit = np.empty(len(irradiance), np.int64)
    # Faces turned away from the lamp get no light, even if the smooth normal faces it: else light leaks past the
    # terminator.
    lit = lit[: hit_kernels.facing(*vectors, irradiance, lit)]
    if share is not None:
        irradiance *= share
        lit = lit[share[lit] > 0]
    elif lamp.radius_m:
        rotation = rotations(hits.pixel[lit], hits.rows.start)
        points, towards = hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0)
        visible = visible_share(surfaces, points, towards, lamp.radius_m, samples, rotation)
        irradiance[lit] *= visible
        lit = lit[visible > 0]
    else:
        hidden = surfaces.all.occluded(hit_kernels.rows(hits.point, lit), hit_kernels.rows(to_lamp, lit), 1.0)
        lit = lit[: hit_kernels.kept(lit, hidden)]
    direction, received = np.empty((len(lit), 3), to_lamp.dtype), np.empty(len(lit), irradiance.dtype)
    hit_kernels.beams(lit, *vectors[1:], irradiance, direction.reshape(-1), received)
    return lit, direction, received


def disc_share(surfaces: Surfaces, hits: Hits, lamp: Lamp, samples: int, every: int = 1) -> np.ndarray:
    """Return the visible share (n,) float32 of the disc of a lamp; 0 if the flat face is turned away from the lamp.

    The smooth normal has no effect. `every`: see `visible_share`.
    """
    to_lamp, _ = lamp.light_at(hits.point, falloff=False)
    facing = np.flatnonzero(dot(hits.plane, to_lamp) > 0)
    points, towards = hits.point.take(facing, axis=0), to_lamp.take(facing, axis=0)
    rotation = rotations(hits.pixel[facing], hits.rows.start)
    share = np.zeros(len(hits.pixel), np.float32)
    share[facing] = visible_share(surfaces, points, towards, lamp.radius_m, samples, rotation, every)
    return share


def visible_lamp_share(surfaces: Surfaces, hits: Hits, lamp: Lamp, samples: int) -> np.ndarray:
    """Return the visible share (n,) float32 of a lamp, 0 to 1, to 1e-5; 0 if the surface is turned away."""
    unit_lamp = replace(lamp, intensity=1.0, light_field=())
    lit, to_lamp, irradiance = lighting(surfaces, hits, unit_lamp, falloff=False, samples=samples)
    share = np.zeros(len(hits.pixel), np.float32)
    share[lit] = np.round(irradiance / dot(hits.normal.take(lit, axis=0), to_lamp), 5)
    return share
