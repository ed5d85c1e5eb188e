"""Which points a lamp lights, how much, and how much of its disc they see: soft edges of shadows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from polarsim.geometry.vectors import cross, dot, scaled, unit
from polarsim.render import hit_kernels
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.surfaces import Surfaces

PROBES = 5  # rays to the centre and rim of the disc: where all agree, no more are cast
_SCATTER = (0.6180339887, 0.7548776662)  # steps that never come near a point of before: rotations of neighbours differ
_GOLDEN = np.pi * (3 - np.sqrt(5))  # radians between two points of Vogel's sunflower, which covers a disc evenly


def visible_share(
    surfaces: Surfaces,
    points: np.ndarray,
    to_lamp: np.ndarray,
    radius_m: float,
    samples: int,
    rotation: np.ndarray,
    every: int = 1,
) -> np.ndarray:
    """(n,) float32 share, 0 to 1, of a disc that faces each point and that nothing hides from it; of a point 0 or 1.

    Parameters
    ----------
    points, to_lamp : (n, 3) float32
        Points, and vectors to the disc's centre, metres.
    samples : int
        Rays a point, where some of the first ones are occluded and some are not.
    rotation : (n,) float
        Radians by which the pattern of rays is rotated: another one for each point makes grain of what would be bands.
    every : int
        Above 1, of points in the order of a picture: only every so many-th one is probed at centre and rim. Where two
        of them see the same, all or nothing, those between look at the centre alone, unless that differs nearby.
    """

    def seen(numbers: np.ndarray, pattern: np.ndarray) -> np.ndarray:
        """(m,) share of the pattern's points on the disc that points with these numbers (m,) see."""
        at, towards = _rows(numbers, points, to_lamp)
        occluded = np.zeros(len(numbers), np.float32)
        for along in _on_disc(towards, radius_m, pattern, rotation[numbers]):
            occluded += surfaces.all.occluded(at, along, 1.0)
        return 1 - occluded / np.float32(len(pattern))

    def centre_seen(numbers: np.ndarray) -> np.ndarray:
        return ~surfaces.all.occluded(*_rows(numbers, points, to_lamp), 1.0)

    if not radius_m:
        return (~surfaces.all.occluded(points, to_lamp, 1.0)).astype(np.float32)
    share = np.empty(len(points), np.float32)
    unsure = np.arange(len(points))
    if every > 1:
        unsure = _sparsely(share, every, lambda numbers: seen(numbers, _rim()), centre_seen)
    share[unsure] = seen(unsure, _rim())
    soft = np.flatnonzero((share > 0) & (share < 1))
    if len(soft):
        share[soft] = seen(soft, _sunflower(samples))
    return share


def _sparsely(
    share: np.ndarray, every: int, rim_seen: Callable[..., np.ndarray], centre_seen: Callable[..., np.ndarray]
) -> np.ndarray:
    """Write the share of points (n,) that lie among alike ones; numbers of the others.

    `rim_seen`, `centre_seen`: (m,) what points with numbers (m,) see, as a share and as bool.
    """
    count = len(share)
    probed = np.minimum(np.arange(0, count + every - 1, every), max(count - 1, 0)) if count else np.zeros(0, np.int64)
    found = rim_seen(probed)
    between = np.minimum(np.arange(count) // every, len(probed) - 2) if len(probed) > 1 else np.zeros(count, np.int64)
    first, second = found[between], found[np.minimum(between + 1, len(probed) - 1)]
    alike = np.flatnonzero((first == second) & ((first == 0) | (first == 1)))
    differs = np.zeros(count + 2 * every, np.int64)  # a margin on both sides
    differs[every + alike[centre_seen(alike) != (first[alike] == 1)]] = 1
    so_far = np.concatenate([[0], differs.cumsum()])
    near = so_far[every + every // 2 + 1 :][:count] - so_far[every - every // 2 :][:count] > 0
    sure = alike[~near[alike]]
    share[sure] = first[sure]
    return np.delete(np.arange(count), sure)


def _rows(numbers: np.ndarray, points: np.ndarray, to_lamp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if len(numbers) == len(points):
        return points, to_lamp
    return points.take(numbers, axis=0), to_lamp.take(numbers, axis=0)


def _rim() -> np.ndarray:
    """(PROBES, 2) centre and rim of the unit disc: radius and angle."""
    return np.array([[0, 0], *((1, quarter * np.pi / 2) for quarter in range(PROBES - 1))], float)


def _sunflower(samples: int) -> np.ndarray:
    """(samples, 2) points that cover the unit disc evenly: radius and angle."""
    number = np.arange(samples)
    return np.stack([np.sqrt((number + 0.5) / samples), number * _GOLDEN], axis=1)


def to_disc(to_lamp: np.ndarray, radius_m: float, samples: int, rotation: np.ndarray) -> Iterator[np.ndarray]:
    """The vectors (n, 3) along which `visible_share` looks at a disc; first to its centre, as `to_lamp` (n, 3) does."""
    yield to_lamp
    if radius_m:
        yield from _on_disc(to_lamp, radius_m, np.concatenate([_rim()[1:], _sunflower(samples)]), rotation)


def rotations(pixel: np.ndarray, first_row: int | np.ndarray) -> np.ndarray:
    """(n,) radians by which the pattern of rays to a disc is rotated at pixels (n,) of a strip: each its own."""
    return np.asarray(2 * np.pi * ((pixel * _SCATTER[0] + first_row * _SCATTER[1]) % 1))


def _on_disc(to_lamp: np.ndarray, radius_m: float, pattern: np.ndarray, rotation: np.ndarray) -> Iterator[np.ndarray]:
    across, upward = _facing(to_lamp)
    for radius, angle in pattern:
        rotated, far = (angle + rotation).astype(np.float32), np.float32(radius * radius_m)
        offset = scaled(across, far * np.cos(rotated)) + scaled(upward, far * np.sin(rotated))
        yield to_lamp + offset


def _facing(to_lamp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (n, 3) each, at right angles to each other and to vectors (n, 3)."""
    axis = unit(to_lamp)
    steep = np.abs(axis[:, 2]) > np.float32(0.9)
    helper = np.where(steep[:, None], np.array([1, 0, 0], axis.dtype), np.array([0, 0, 1], axis.dtype))
    across = unit(cross(axis, helper))
    return across, cross(axis, across)


def lighting(
    surfaces: Surfaces, hits: Hits, lamp: Lamp, *, falloff: bool, samples: int = 1, share: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers (m,) of the hits that a lamp lights, unit vectors (m, 3) to it, irradiance (m,) of the surface there.

    `samples`: rays to a lamp that is a disc, where it is seen in part. `share` (n,): how much of the disc the hits see,
    where `disc_share` has told it already.
    """
    to_lamp, irradiance = lamp.light_at(hits.point, falloff=falloff)
    vectors = [array.reshape(-1) for array in (hits.plane, hits.normal, to_lamp)]
    lit = np.empty(len(irradiance), np.int64)
    # A flat face that looks away gets no light, whatever its smooth normal says: else light leaks past the terminator.
    lit = lit[: hit_kernels.facing(*vectors, irradiance, lit)]
    if share is not None:
        irradiance *= share
        lit = lit[share[lit] > 0]
    elif lamp.radius_m:
        rotation = rotations(hits.pixel[lit], hits.rows.start)
        points, towards = hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0)
        seen = visible_share(surfaces, points, towards, lamp.radius_m, samples, rotation)
        irradiance[lit] *= seen
        lit = lit[seen > 0]
    else:
        hidden = surfaces.all.occluded(hit_kernels.rows(hits.point, lit), hit_kernels.rows(to_lamp, lit), 1.0)
        lit = lit[: hit_kernels.kept(lit, hidden)]
    direction, received = np.empty((len(lit), 3), to_lamp.dtype), np.empty(len(lit), irradiance.dtype)
    hit_kernels.beams(lit, *vectors[1:], irradiance, direction.reshape(-1), received)
    return lit, direction, received


def disc_share(surfaces: Surfaces, hits: Hits, lamp: Lamp, samples: int, every: int = 1) -> np.ndarray:
    """(n,) float32 share of a lamp's disc that each hit sees, whatever its smooth normal; 0 where its face looks away.

    `every`: see `visible_share`.
    """
    to_lamp, _ = lamp.light_at(hits.point, falloff=False)
    facing = np.flatnonzero(dot(hits.plane, to_lamp) > 0)
    points, towards = hits.point.take(facing, axis=0), to_lamp.take(facing, axis=0)
    rotation = rotations(hits.pixel[facing], hits.rows.start)
    share = np.zeros(len(hits.pixel), np.float32)
    share[facing] = visible_share(surfaces, points, towards, lamp.radius_m, samples, rotation, every)
    return share


def lit_share(surfaces: Surfaces, hits: Hits, lamp: Lamp, samples: int) -> np.ndarray:
    """(n,) float32 share of a lamp that each hit sees, 0 to 1, exact to 1e-5; 0 where the surface faces away."""
    lit, to_lamp, irradiance = lighting(surfaces, hits, replace(lamp, intensity=1.0), falloff=False, samples=samples)
    share = np.zeros(len(hits.pixel), np.float32)
    share[lit] = np.round(irradiance / dot(hits.normal.take(lit, axis=0), to_lamp), 5)
    return share
