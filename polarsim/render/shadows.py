"""Whose shadow a piece of ground lies in."""

from __future__ import annotations

import numpy as np

from polarsim.formats.instances import GROUND, RELIEF_SHADOW, ROCK_IDS, SHADOW_IDS
from polarsim.geometry.rays import START_OFFSET
from polarsim.geometry.vectors import dot, length, moved, scaled
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.penumbra import to_disc, turns
from polarsim.render.surfaces import Surfaces

_RELIEF_REACH = 0.15  # metres: ground nearer than this is roughness of the place, not another thing that hides the lamp


def ground_shadows(surfaces: Surfaces, hits: Hits, ids: np.ndarray, lamp: Lamp, lit: np.ndarray) -> np.ndarray:
    """The ids (n,) of the hits with the lamp's shadows on the ground written in.

    `lit` (m,) numbers hits that the lamp is known to light, so that no ray is cast for them.

    Ground belongs to the shadow of the first rock on its way to the lamp, unless a wall or the relief farther than
    15 cm away keeps it dark anyway: there nobody sees the rock's shadow. Grains of sand in the dark inside a rock's
    shadow are part of it.
    """
    ids = ids.copy()
    in_question = ids == GROUND
    in_question[lit] = False
    ground = np.flatnonzero(in_question)
    point = hits.point.take(ground, axis=0)
    to_lamp, _ = lamp.light_at(point, falloff=False)
    ids[ground] = on_ground(surfaces, point, hits.plane.take(ground, axis=0), to_lamp)
    return ids


def disc_shadows(
    surfaces: Surfaces, hits: Hits, ids: np.ndarray, lamp: Lamp, dark: np.ndarray, samples: int
) -> np.ndarray:
    """As `ground_shadows`, of a lamp that is a disc; `dark` (n,) bool: hits that see too little of it.

    The shadow is that of what hides the disc's centre; where nothing does, of what hides the first of as many other
    places of it.
    """
    ids = ids.copy()
    ground = np.flatnonzero(dark & (ids == GROUND))
    point, plane = hits.point.take(ground, axis=0), hits.plane.take(ground, axis=0)
    turn = turns(hits.pixel[ground], hits.rows.start)
    for towards in to_disc(lamp.light_at(point, falloff=False)[0], lamp.radius_m, samples, turn):
        left = np.flatnonzero(ids[ground] == GROUND)
        if not len(left):
            break
        ids[ground[left]] = on_ground(surfaces, *(vectors.take(left, axis=0) for vectors in (point, plane, towards)))
    return ids


def on_ground(surfaces: Surfaces, point: np.ndarray, plane: np.ndarray, to_lamp: np.ndarray) -> np.ndarray:
    """The ids (n,) of ground: GROUND where it is lit, RELIEF_SHADOW, or SHADOW_IDS + rock.

    Parameters
    ----------
    point, plane, to_lamp : (n, 3) float32
        Places, unit normals of the faces there, vectors to the lamp; metres.
    """
    ids = np.full(len(point), GROUND, np.int32)
    far = length(to_lamp)
    along = scaled(to_lamp, 1 / far)
    distance, face = surfaces.rocks.nearest(moved(point, along, np.float32(START_OFFSET)), along)
    behind = np.flatnonzero(distance < far)
    towards = along.take(behind, axis=0)
    start = moved(point.take(behind, axis=0), towards, np.float32(_RELIEF_REACH))
    dark_anyway = surfaces.rest.occluded(start, towards, far[behind] - _RELIEF_REACH)
    behind = behind[~dark_anyway]
    rock_id = surfaces.id_of_face[surfaces.rock_faces[face[behind]]] if len(behind) else np.zeros(0, np.int32)
    ids[behind] = rock_id - ROCK_IDS + SHADOW_IDS
    others = np.flatnonzero(ids == GROUND)
    facing = dot(plane.take(others, axis=0), along.take(others, axis=0)) > 0
    dark = ~facing
    lit = others[facing]
    dark[facing] = surfaces.rest.occluded(point.take(lit, axis=0), along.take(lit, axis=0), far[lit])
    ids[others[dark]] = RELIEF_SHADOW
    return ids
