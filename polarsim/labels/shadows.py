"""Shadows that rocks cast on the ground under a near lamp, as a view shows them."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.boxes import of_mask
from polarsim.labels.view import View
from polarsim.labels.world import World
from polarsim.photo import NO_ROCK, Azimuth, Light
from polarsim.survey import ROVER_LIGHT_FROM_LEFT

THIN_PX = 4.0  # parts of a shadow thinner than this do not widen its box: rims under rocks, where meshes meet the sand
SMALL_PART = 0.15  # of a shadow's largest connected part: smaller parts do not widen its box
ROCK_ELLIPSE = 0.8  # of a rock's label box: the ellipse in which people see rock, never shadow


def lamp(world: World, view: View, light: Light, azimuth: Azimuth) -> np.ndarray | None:
    """(3,) place of the lamp that throws the shadows, sandbox frame; None in the dark.

    A Sun lamp outshines the rover light.
    """
    if azimuth != "no":
        return world.suns[azimuth]
    if light == "on":
        return view.placed.sandbox_from_left.apply(ROVER_LIGHT_FROM_LEFT)
    return None


class Ids:
    """What a view sees at a grid of pixels (rows, columns): the rock there, and the ground there or behind the rock."""

    def __init__(self, world: World, view: View, rows: np.ndarray, columns: np.ndarray) -> None:
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
        directions = view.directions(pixels).reshape(-1, 3)
        origins = np.broadcast_to(view.centre, directions.shape)
        distance, face = world.everything.nearest(origins, directions)
        self.shape = (len(rows), len(columns))
        self.hit = np.isfinite(distance).reshape(self.shape)
        self.rock = np.where(self.hit, world.rock_of_face[face].reshape(self.shape), NO_ROCK)
        hidden = np.flatnonzero(np.isfinite(distance) & ~world.is_ground[face])  # what is seen stands before the ground
        distance[hidden] = world.ground.nearest(origins[hidden], directions[hidden])[0]
        on_ground = np.isfinite(distance)
        self.ground = on_ground.reshape(self.shape)
        self.places = view.centre + distance[on_ground, None] * directions[on_ground]  # (n, 3), row by row

    def shadow_of(self, world: World, lamp_place: np.ndarray) -> np.ndarray:
        """(rows, columns) rock that takes the lamp's light from the ground at each pixel; `NO_ROCK` elsewhere.

        Other rocks hide a rock's shadow, its own mesh does not: where the rock ends is for its label to say, since
        meshes may be wider than their rocks (skirts, back sides that no scan saw).
        """
        distance, face = world.rocks.nearest(self.places, lamp_place - self.places)
        blocked = distance < 1
        rock = np.full(len(self.places), NO_ROCK)
        rock[blocked] = world.rock_of_rocks_face[face[blocked]]
        shadow = np.full(self.shape, NO_ROCK)
        shadow[self.ground] = rock
        shadow[(self.rock != NO_ROCK) & (self.rock != shadow)] = NO_ROCK
        return shadow


def shadow_box(shadow: np.ndarray, rock: int, rock_box: np.ndarray | None, step: int) -> np.ndarray | None:
    """(4,) box around the visible shadow of a rock, px; None where too little of it is seen.

    Parameters
    ----------
    shadow : (rows, columns) int
        Rock whose shadow is seen at every `step`-th pixel.
    rock_box : (4,) float or None
        The rock's label in the same photo. People see rock in it, so that a shadow starts where the rock ends.
    """
    import cv2

    mask = shadow == rock
    whole = of_mask(mask)
    if whole is None:
        return None
    left, top, right, bottom = whole.astype(int)
    mask = mask[top:bottom, left:right]
    if rock_box is not None:
        x, y = (np.arange(left, right) + 0.5) * step, (np.arange(top, bottom) + 0.5) * step
        half = np.maximum(rock_box[2:] - rock_box[:2], 1.0) / 2 * ROCK_ELLIPSE
        centre = (rock_box[2:] + rock_box[:2]) / 2
        mask = mask & ((((y - centre[1]) / half[1]) ** 2)[:, None] + ((x - centre[0]) / half[0]) ** 2 > 1)
    core = without_thin_parts(mask, round(THIN_PX / step))
    count, parts, figures, _ = cv2.connectedComponentsWithStats(core.astype(np.uint8), connectivity=8)
    areas = figures[1:count, cv2.CC_STAT_AREA]
    if not len(areas):
        return None
    box = of_mask(np.isin(parts, 1 + np.flatnonzero(areas >= SMALL_PART * areas.max())))
    assert box is not None
    return (box + np.tile([left, top], 2)) * step


def without_thin_parts(mask: np.ndarray, size: int) -> np.ndarray:
    """(h, w) bool: a mask opened by squares of `size` samples, with the tips that this cuts off; never empty."""
    import cv2

    if size < 2:
        return mask
    whole = np.pad(mask.astype(np.uint8), size)
    opened = cv2.morphologyEx(whole, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    grown = cv2.dilate(opened, np.ones((2 * size + 1, 2 * size + 1), np.uint8)) & whole
    found = grown[size:-size, size:-size] > 0
    return found if found.any() else mask
