"""Which places a lamp lights, and how much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from polarsim.geometry.vectors import dot, length, scaled
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.penumbra import turns, visible_share
from polarsim.render.surfaces import Surfaces


def lighting(
    surfaces: Surfaces, hits: Hits, lamp: Lamp, *, falloff: bool, samples: int = 1, share: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers (m,) of the hits that a lamp lights, unit vectors (m, 3) to it, irradiance (m,) of the surface there.

    `samples`: rays to a lamp that is a disc, where it is seen in part. `share` (n,): how much of the disc the hits see,
    where `disc_share` has told it already.
    """
    to_lamp, irradiance = lamp.light_at(hits.point, falloff=falloff)
    # A flat face that looks away gets no light, whatever its smooth normal says: else light leaks past the terminator.
    along_normal = dot(hits.normal, to_lamp)
    lit = np.flatnonzero((dot(hits.plane, to_lamp) > 0) & (along_normal > 0) & (irradiance > 0))
    if share is not None:
        irradiance *= share
        lit = lit[share[lit] > 0]
    elif lamp.radius_m:
        turn = turns(hits.pixel[lit], hits.rows.start)
        points, towards = hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0)
        seen = visible_share(surfaces, points, towards, lamp.radius_m, samples, turn)
        irradiance[lit] *= seen
        lit = lit[seen > 0]
    else:
        lit = lit[~surfaces.all.occluded(hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0), 1.0)]
    to_lamp = to_lamp.take(lit, axis=0)
    nearness = 1 / length(to_lamp)
    return lit, scaled(to_lamp, nearness), irradiance.take(lit) * along_normal.take(lit) * nearness


def disc_share(surfaces: Surfaces, hits: Hits, lamp: Lamp, samples: int, every: int = 1) -> np.ndarray:
    """(n,) float32 share of a lamp's disc that each hit sees, whatever its smooth normal; 0 where its face looks away.

    `every`: see `penumbra.visible_share`.
    """
    to_lamp, _ = lamp.light_at(hits.point, falloff=False)
    facing = np.flatnonzero(dot(hits.plane, to_lamp) > 0)
    points, towards = hits.point.take(facing, axis=0), to_lamp.take(facing, axis=0)
    turn = turns(hits.pixel[facing], hits.rows.start)
    share = np.zeros(len(hits.pixel), np.float32)
    share[facing] = visible_share(surfaces, points, towards, lamp.radius_m, samples, turn, every)
    return share


def lit_share(surfaces: Surfaces, hits: Hits, lamp: Lamp, samples: int) -> np.ndarray:
    """(n,) float32 share of a lamp that each hit sees, 0 to 1, exact to 1e-5; 0 where the surface faces away."""
    lit, to_lamp, irradiance = lighting(surfaces, hits, replace(lamp, intensity=1.0), falloff=False, samples=samples)
    share = np.zeros(len(hits.pixel), np.float32)
    share[lit] = np.round(irradiance / dot(hits.normal.take(lit, axis=0), to_lamp), 5)
    return share
