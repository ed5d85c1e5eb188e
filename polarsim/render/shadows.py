"""Whose shadow a piece of ground lies in, and what keeps a lamp from the pixels that it does not light."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.rays import START_OFFSET, Caster
from polarsim.geometry.vectors import dot, length, moved, scaled
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import rotations, to_disc
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import BACKGROUND, GROUND, RELIEF_SHADOW, ROCK_IDS, SHADOW_IDS

_RELIEF_REACH = (
    0.15  # metres: ground nearer than this is roughness of the ground there, not another thing that hides the lamp
)
# Codes of shading pictures besides ids. FACES_AWAY: attached shadow. ROCK_IDS + k: rock k's own surface, which rock k
# itself hides from the lamp: self shadow. SHADOW_IDS + k: whatever else rock k hides: cast shadow. BY_RELIEF, BY_WALL:
# cast by the ground or a wall.
NOTHING, LIT, BY_RELIEF, BY_WALL, FACES_AWAY = 0, 1, 2, 3, 4
NOBODY = -1  # in the place of an id
SHADOW_BELOW = 0.5  # visible share of a lamp's disc below which a pixel counts as shadow: the middle of a penumbra
_OPEN = 0  # nothing was found in the way


def ground_shadows(
    surfaces: Surfaces, hits: Hits, ids: np.ndarray, lamp: Lamp, dark: np.ndarray, samples: int
) -> np.ndarray:
    """The ids (n,) of the hits with the lamp's shadows on the ground written in.

    `dark` (n,) bool: hits that may lie in shadow; of a lamp that is a disc those that see too little of it.

    Ground belongs to the shadow of the first rock on its way to the lamp, unless a wall or the relief farther than
    15 cm away keeps it dark anyway: there nobody sees the rock's shadow. Grains of sand in the dark inside a rock's
    shadow are part of it. Of a disc the centre counts; where nothing hides that, the first of as many other points of
    it that something hides.
    """
    ids = ids.copy()
    ground = np.flatnonzero(dark & (ids == GROUND))
    point, plane = hits.point.take(ground, axis=0), hits.plane.take(ground, axis=0)
    rotation = rotations(hits.pixel[ground], hits.rows.start)
    for towards in to_disc(lamp.light_at(point, falloff=False)[0], lamp.radius_m, samples, rotation):
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
        Points, unit normals of the faces there, vectors to the lamp; metres.
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


def shading_of(surfaces: Surfaces, hits: Hits, lamp: Lamp, dark: np.ndarray, samples: int) -> np.ndarray:
    """(n,) uint16 codes of the hits in a shading picture; `dark` (n,) bool: those that count as shadow.

    Surface that faces away is in shadow for that alone. On rocks the first thing on the way to the lamp is named. On
    ground and walls a rock is named, the first one, only where the rest of ground and walls leaves the lamp free:
    they would be lit without rocks. Pictures of ids (`ground_shadows`) fill such grains in. Of a disc the
    centre counts; where nothing hides that, the first of as many other points of it that something hides.
    """
    shading = np.full(len(hits.pixel), LIT, np.uint16)
    to_lamp, _ = lamp.light_at(hits.point, falloff=False)
    away = (dot(hits.plane, to_lamp) <= 0) | (dot(hits.normal, to_lamp) <= 0)
    shading[dark & away] = FACES_AWAY
    left = np.flatnonzero(dark & ~away)
    own = surfaces.id_of_face.take(hits.face)
    rotation = rotations(hits.pixel[left], hits.rows.start)
    for towards in to_disc(to_lamp.take(left, axis=0), lamp.radius_m, samples, rotation):
        open_still = np.flatnonzero(shading[left] == LIT)
        if not len(open_still):
            break
        asked = left[open_still]
        found = _in_the_way(surfaces, hits, asked, own[asked], towards.take(open_still, axis=0))
        shading[asked] = np.where(found == _OPEN, LIT, found)
    left = left[shading[left] == LIT]  # hidden by a hair's breadth, so by what is nearest
    shading[left] = np.select([own[left] >= ROCK_IDS, own[left] == GROUND], [own[left], BY_RELIEF], BY_WALL)
    return shading


def _in_the_way(surfaces: Surfaces, hits: Hits, asked: np.ndarray, own: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """(m,) codes of the hits numbered `asked`, whose ids are `own`, along vectors to the lamp; `_OPEN` for none."""
    point = hits.point.take(asked, axis=0)
    first = np.full(len(asked), NOBODY, np.int32)
    on_rock, on_rest = np.flatnonzero(own >= ROCK_IDS), np.flatnonzero(own < ROCK_IDS)
    for numbers, rays, faces in (
        (on_rock, surfaces.all, slice(None)),
        (on_rest, surfaces.rest, surfaces.rest_faces),
        (on_rest, surfaces.rocks, surfaces.rock_faces),
    ):
        left = numbers[first[numbers] == NOBODY]
        ids = surfaces.id_of_face[faces]
        first[left] = _first(rays, ids, point.take(left, axis=0), towards.take(left, axis=0))
    return np.select(
        [first == NOBODY, first == BACKGROUND, first == GROUND, first == own],
        [_OPEN, BY_WALL, BY_RELIEF, first],
        first - ROCK_IDS + SHADOW_IDS,
    )


def _first(rays: Caster, id_of_face: np.ndarray, point: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """(n,) id of the first surface between points and lamp, `NOBODY` for none."""
    far = length(towards)
    along = scaled(towards, 1 / far)
    distance, face = rays.nearest(moved(point, along, np.float32(START_OFFSET)), along)
    hit = distance < far
    first = np.full(len(point), NOBODY, np.int32)
    first[hit] = id_of_face[face[hit]]
    return first
