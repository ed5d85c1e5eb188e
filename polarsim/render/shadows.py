"""Whose shadow a piece of ground lies in."""

from __future__ import annotations

import numpy as np

from polarsim.formats.instances import GROUND, RELIEF_SHADOW, ROCK_IDS, SHADOW_IDS
from polarsim.geometry.rays import START_OFFSET
from polarsim.render.hits import Hits, dot
from polarsim.render.lamps import Lamp
from polarsim.render.surfaces import Surfaces

_RELIEF_REACH = 0.15  # metres: ground nearer than this is roughness of the place, not another thing that hides the lamp


def ground_shadows(
    surfaces: Surfaces, hits: Hits, ids: np.ndarray, lamp: Lamp, lit: np.ndarray | None = None
) -> np.ndarray:
    """The ids (n,) of the hits with the lamp's shadows on the ground written in.

    `lit` (m,) numbers hits that the lamp is known to light, so that no ray is cast for them.

    Ground belongs to the shadow of the first rock on its way to the lamp, unless a wall or the relief farther than
    15 cm away keeps it dark anyway: there nobody sees the rock's shadow. Grains of sand in the dark inside a rock's
    shadow are part of it.
    """
    ids = ids.copy()
    in_question = ids == GROUND
    if lit is not None:
        in_question[lit] = False
    ground = np.flatnonzero(in_question)
    point = hits.point[ground]
    to_lamp, _ = lamp.light_at(point, falloff=False)
    length = np.sqrt(dot(to_lamp, to_lamp))[:, None]
    along = to_lamp / length
    distance, face = surfaces.rocks.nearest(point + START_OFFSET * along, along)
    behind = np.flatnonzero(distance < length[:, 0])
    start = point[behind] + _RELIEF_REACH * along[behind]
    dark_anyway = surfaces.rest.blocked(start, along[behind], length[behind, 0] - _RELIEF_REACH)
    behind = behind[~dark_anyway]
    rock_id = surfaces.id_of_face[surfaces.rock_faces[face[behind]]] if len(behind) else np.zeros(0, np.int32)
    ids[ground[behind]] = rock_id - ROCK_IDS + SHADOW_IDS
    others = np.flatnonzero(ids[ground] == GROUND)
    facing = dot(hits.plane[ground[others]], along[others]) > 0
    dark = ~facing
    lit = others[facing]
    dark[facing] = surfaces.rest.blocked(point[lit], along[lit], length[lit, 0])
    ids[ground[others[dark]]] = RELIEF_SHADOW
    return ids
