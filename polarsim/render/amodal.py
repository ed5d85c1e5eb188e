"""Whole rocks: the pixels that a rock would cover if neither other rocks nor walls stood in front of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from polarsim.formats.instances import BACKGROUND, ROCK_IDS, SHADOW_IDS
from polarsim.geometry.boxes import around, window
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.rays import NO_FACE, START_OFFSET
from polarsim.geometry.vectors import length, moved
from polarsim.render.surfaces import Surfaces

_MARGIN_PX = 2  # by which a lens bends the edges of a box out of the box around its corners


def hidden_parts(surfaces: Surfaces, camera: Camera, ids: np.ndarray) -> dict[int, np.ndarray]:
    """Pixels of each rock in the picture that other rocks and walls hide: (n,) flat numbers, sorted, by rock.

    What the ground hides of a rock, buried or behind a mound, is none of them. Rays are cast only where the picture
    shows another rock, a wall or nothing, near the rock.

    Parameters
    ----------
    ids : (h, w) uint16
        Of the view, without shadows or with them.
    """
    windows = {rock: _window(surfaces.rock_corners[rock], camera) for rock in _rocks_in(ids)}
    in_front = (ids == BACKGROUND) | ((ids >= ROCK_IDS) & (ids < SHADOW_IDS))
    asked = np.zeros(ids.shape, bool)
    for rock, near in windows.items():
        asked[near] |= in_front[near] & (ids[near] != ROCK_IDS + rock)
    pixels = np.flatnonzero(asked)
    row, column = np.divmod(pixels, camera.lens.width)
    directions = camera.directions(np.stack([column, row], axis=1) + HALF_PIXEL)
    hidden: dict[int, list[np.ndarray]] = {rock: [] for rock in windows}
    for rays, met in _rocks_along(surfaces, camera.centre, directions):
        for rock in np.intersect1d(met, list(windows)):
            behind = pixels[rays[met == rock]]
            hidden[rock].append(behind[ids.reshape(-1)[behind] != ROCK_IDS + rock])
    return {
        rock: np.unique(np.concatenate(parts)) if parts else np.zeros(0, np.int64) for rock, parts in hidden.items()
    }


def _rocks_in(ids: np.ndarray) -> list[int]:
    shown = np.flatnonzero(np.bincount(ids.ravel(), minlength=SHADOW_IDS)[ROCK_IDS:SHADOW_IDS])
    return [int(rock) for rock in shown]


def _window(corners: np.ndarray, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns of the pixels that may show what lies between corners (n, 3)."""
    # Far outside the photo a lens may bend points back into it; without distortion they stay outside.
    straight = replace(camera, lens=replace(camera.lens, distortion=(0.0,) * 5))
    pixels = np.concatenate([camera.project(corners), straight.project(corners)])
    if np.isnan(pixels).any():  # a corner behind the camera
        return slice(0, camera.lens.height), slice(0, camera.lens.width)
    return window(around(pixels), np.full(2, _MARGIN_PX), *camera.size)


def _rocks_along(
    surfaces: Surfaces, origin: np.ndarray, directions: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Numbers of rays and the rock that each meets: once for every surface of a rock before the ground."""
    ground = _distance_to_ground(surfaces, origin, directions)
    step = START_OFFSET / length(directions)
    travelled, on = np.zeros(len(directions)), np.arange(len(directions))
    while len(on):
        along = directions[on]
        distance, face = surfaces.rocks.nearest(moved(origin, along, travelled[on]), along)
        travelled[on] += distance
        before = travelled[on] < ground[on]
        on, face = on[before], face[before]
        yield on, surfaces.id_of_face[surfaces.rock_faces[face]] - ROCK_IDS
        travelled[on] += step[on]


def _distance_to_ground(surfaces: Surfaces, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n,) in units of the directions' length, through walls; inf where a ray meets no ground."""
    step = START_OFFSET / length(directions)
    travelled, on = np.zeros(len(directions)), np.arange(len(directions))
    while len(on):
        along = directions[on]
        distance, face = surfaces.rest.nearest(moved(origin, along, travelled[on]), along)
        travelled[on] += distance
        on = on[(face != NO_FACE) & (surfaces.id_of_face[surfaces.rest_faces[face]] == BACKGROUND)]
        travelled[on] += step[on]
    return travelled
