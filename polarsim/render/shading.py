"""What keeps a lamp from the pixels that it does not light."""

from __future__ import annotations

import numpy as np

from polarsim.formats.instances import BACKGROUND, GROUND, ROCK_IDS, SHADOW_IDS
from polarsim.formats.shading import BY_RELIEF, BY_WALL, FACES_AWAY, LIT
from polarsim.geometry.rays import START_OFFSET, Caster
from polarsim.geometry.vectors import dot, length, moved, scaled
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.penumbra import to_disc, turns
from polarsim.render.surfaces import Surfaces

NOBODY = -1  # in the place of an id
_OPEN = 0  # nothing was found in the way


def shading_of(surfaces: Surfaces, hits: Hits, lamp: Lamp, dark: np.ndarray, samples: int) -> np.ndarray:
    """(n,) uint16 codes of `formats.shading` of the hits; `dark` (n,) bool: those that count as shadow.

    Surface that faces away is in shadow for that alone. On rocks the first thing on the way to the lamp is named. On
    ground and walls a rock is named, the first one, only where the rest of ground and walls leaves the lamp free:
    they would be lit without rocks. Pictures of ids (`shadows.ground_shadows`) fill such grains in. Of a disc the
    centre counts; where nothing hides that, the first of as many other places of it that something hides.
    """
    shading = np.full(len(hits.pixel), LIT, np.uint16)
    to_lamp, _ = lamp.light_at(hits.point, falloff=False)
    away = (dot(hits.plane, to_lamp) <= 0) | (dot(hits.normal, to_lamp) <= 0)
    shading[dark & away] = FACES_AWAY
    left = np.flatnonzero(dark & ~away)
    own = surfaces.id_of_face.take(hits.face)
    turn = turns(hits.pixel[left], hits.rows.start)
    for towards in to_disc(to_lamp.take(left, axis=0), lamp.radius_m, samples, turn):
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
    met = distance < far
    first = np.full(len(point), NOBODY, np.int32)
    first[met] = id_of_face[face[met]]
    return first
