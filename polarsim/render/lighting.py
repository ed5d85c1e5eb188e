"""Which places a lamp lights, and how much."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.vectors import dot, length, scaled
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.penumbra import visible_share
from polarsim.render.surfaces import Surfaces

_SCATTER = (0.6180339887, 0.7548776662)  # steps that never come near a place of before: turns of neighbours differ


def lighting(
    surfaces: Surfaces, hits: Hits, lamp: Lamp, *, falloff: bool, samples: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers (m,) of the hits that a lamp lights, unit vectors (m, 3) to it, irradiance (m,) of the surface there.

    `samples`: rays to a lamp that is a disc, where it is seen in part.
    """
    to_lamp, irradiance = lamp.light_at(hits.point, falloff=falloff)
    # A flat face that looks away gets no light, whatever its smooth normal says: else light leaks past the terminator.
    along_normal = dot(hits.normal, to_lamp)
    lit = np.flatnonzero((dot(hits.plane, to_lamp) > 0) & (along_normal > 0))
    if lamp.radius_m:
        turn = 2 * np.pi * ((hits.pixel[lit] * _SCATTER[0] + hits.rows.start * _SCATTER[1]) % 1)
        points, towards = hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0)
        share = visible_share(surfaces, points, towards, lamp.radius_m, samples, turn)
        irradiance[lit] *= share
        lit = lit[share > 0]
    else:
        lit = lit[~surfaces.all.blocked(hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0), 1.0)]
    to_lamp = to_lamp.take(lit, axis=0)
    nearness = 1 / length(to_lamp)
    return lit, scaled(to_lamp, nearness), irradiance.take(lit) * along_normal.take(lit) * nearness
