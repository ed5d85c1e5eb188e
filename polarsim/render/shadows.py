"""Shadow ids of ground pixels, and the occluder of each unlit pixel."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.rays import START_OFFSET, Caster
from polarsim.geometry.vectors import dot, length, points_along, scale_vectors
from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import rotations, to_disc
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import BACKGROUND, GROUND, RELIEF_SHADOW, ROCK_IDS, SHADOW_IDS

_RELIEF_REACH = 0.15  # metres: ground closer than this is local roughness, not a separate occluder
# Codes of shading maps in addition to ids. FACES_AWAY: attached shadow. ROCK_IDS + k: surface of rock k occluded by
# rock k (self shadow). SHADOW_IDS + k: other surface occluded by rock k (cast shadow). BY_RELIEF, BY_WALL: surface
# occluded by the ground or a wall.
NOTHING, LIT, BY_RELIEF, BY_WALL, FACES_AWAY = 0, 1, 2, 3, 4
NO_ID = -1  # no occluder
SHADOW_BELOW = 0.5  # visible share of a lamp's disc below which a pixel is in shadow: the middle of a penumbra
_OPEN = 0  # code of rays without occluder


def ground_shadows(
    surfaces: Surfaces, hits: Hits, ids: np.ndarray, lamp: Lamp, dark: np.ndarray, samples: int
) -> np.ndarray:
    """Return the ids (n,) of the hits with the shadows of a lamp on the ground.

    `dark` (n,) bool: hits that may be in shadow; for a disc, hits with a low visible share.

    Ground belongs to the shadow of the nearest rock in the direction of the lamp. Exception: if a wall or relief more
    than 15 cm away shades the ground anyway, the shadow of the rock is not visible there. Sand grains that are unlit
    inside the shadow of a rock are part of the shadow. For a disc, the ray to the centre decides; if it is not
    occluded, the first occluded ray of the pattern decides.
    """
    ids = ids.copy()
    ground = np.flatnonzero(dark & (ids == GROUND))
    point, plane = hits.point.take(ground, axis=0), hits.plane.take(ground, axis=0)
    rotation = rotations(hits.pixel[ground], hits.rows.start)
    for towards in to_disc(lamp.light_at(point, falloff=False)[0], lamp.radius_m, samples, rotation):
        rest = np.flatnonzero(ids[ground] == GROUND)
        if not len(rest):
            break
        ids[ground[rest]] = ground_ids(surfaces, *(vectors.take(rest, axis=0) for vectors in (point, plane, towards)))
    return ids


def ground_ids(surfaces: Surfaces, point: np.ndarray, plane: np.ndarray, to_lamp: np.ndarray) -> np.ndarray:
    """Return the ids (n,) of ground points: GROUND (lit), RELIEF_SHADOW, or SHADOW_IDS + rock.

    Points, unit normals of the faces, and vectors to the lamp are (n, 3) float32, metres.
    """
    ids = np.full(len(point), GROUND, np.int32)
    lamp_distance = length(to_lamp)
    along = scale_vectors(to_lamp, 1 / lamp_distance)
    distance, face = surfaces.rocks.nearest(points_along(point, along, np.float32(START_OFFSET)), along)
    shaded = np.flatnonzero(distance < lamp_distance)
    towards = along.take(shaded, axis=0)
    start = points_along(point.take(shaded, axis=0), towards, np.float32(_RELIEF_REACH))
    dark_anyway = surfaces.rest.occluded(start, towards, lamp_distance[shaded] - _RELIEF_REACH)
    shaded = shaded[~dark_anyway]
    rock_id = surfaces.id_of_face[surfaces.rock_faces[face[shaded]]] if len(shaded) else np.zeros(0, np.int32)
    ids[shaded] = rock_id - ROCK_IDS + SHADOW_IDS
    others = np.flatnonzero(ids == GROUND)
    facing = dot(plane.take(others, axis=0), along.take(others, axis=0)) > 0
    dark = ~facing
    lit = others[facing]
    dark[facing] = surfaces.rest.occluded(point.take(lit, axis=0), along.take(lit, axis=0), lamp_distance[lit])
    ids[others[dark]] = RELIEF_SHADOW
    return ids


def shading_of(surfaces: Surfaces, hits: Hits, lamp: Lamp, dark: np.ndarray, samples: int) -> np.ndarray:
    """Return the shading codes (n,) uint16 of the hits; `dark` (n,) bool: hits in shadow.

    Surface that faces away from the lamp gets FACES_AWAY. On rocks, the code names the nearest occluder in the
    direction of the lamp. On ground and walls, the code names the nearest rock only if ground and walls do not occlude
    the lamp, that is, if the point would be lit without rocks; `ground_shadows` assigns such points to the rock. For a
    disc, the ray to the centre decides; if it is not occluded, the first occluded ray of the pattern decides.
    """
    shading = np.full(len(hits.pixel), LIT, np.uint16)
    to_lamp, _ = lamp.light_at(hits.point, falloff=False)
    away = (dot(hits.plane, to_lamp) <= 0) | (dot(hits.normal, to_lamp) <= 0)
    shading[dark & away] = FACES_AWAY
    shaded = np.flatnonzero(dark & ~away)
    ids = surfaces.id_of_face.take(hits.face)
    rotation = rotations(hits.pixel[shaded], hits.rows.start)
    for towards in to_disc(to_lamp.take(shaded, axis=0), lamp.radius_m, samples, rotation):
        unresolved = np.flatnonzero(shading[shaded] == LIT)
        if not len(unresolved):
            break
        numbers = shaded[unresolved]
        codes = _occluder_codes(surfaces, hits, numbers, ids[numbers], towards.take(unresolved, axis=0))
        shading[numbers] = np.where(codes == _OPEN, LIT, codes)
    rest = shaded[shading[shaded] == LIT]  # occluded within rounding: assign the surface of the point
    shading[rest] = np.select([ids[rest] >= ROCK_IDS, ids[rest] == GROUND], [ids[rest], BY_RELIEF], BY_WALL)
    return shading


def _occluder_codes(
    surfaces: Surfaces, hits: Hits, chosen: np.ndarray, ids: np.ndarray, towards: np.ndarray
) -> np.ndarray:
    """Return the codes (m,) of the occluders of chosen hits with ids (m,) along vectors to the lamp; `_OPEN`: none."""
    point = hits.point.take(chosen, axis=0)
    first = np.full(len(chosen), NO_ID, np.int32)
    on_rock, on_rest = np.flatnonzero(ids >= ROCK_IDS), np.flatnonzero(ids < ROCK_IDS)
    for numbers, rays, faces in (
        (on_rock, surfaces.all, slice(None)),
        (on_rest, surfaces.rest, surfaces.rest_faces),
        (on_rest, surfaces.rocks, surfaces.rock_faces),
    ):
        rest = numbers[first[numbers] == NO_ID]
        id_of_face = surfaces.id_of_face[faces]
        first[rest] = _first_id(rays, id_of_face, point.take(rest, axis=0), towards.take(rest, axis=0))
    return np.select(
        [first == NO_ID, first == BACKGROUND, first == GROUND, first == ids],
        [_OPEN, BY_WALL, BY_RELIEF, first],
        first - ROCK_IDS + SHADOW_IDS,
    )


def _first_id(rays: Caster, id_of_face: np.ndarray, point: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Return the id (n,) of the nearest surface between points and lamp; `NO_ID` if there is none."""
    lamp_distance = length(towards)
    along = scale_vectors(towards, 1 / lamp_distance)
    distance, face = rays.nearest(points_along(point, along, np.float32(START_OFFSET)), along)
    hit = distance < lamp_distance
    first = np.full(len(point), NO_ID, np.int32)
    first[hit] = id_of_face[face[hit]]
    return first
