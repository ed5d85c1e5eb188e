"""Cast shadows of rocks and walls under a near lamp, and bounding boxes of these shadows in a photo."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.geometry.boxes import box_of_mask, pixel_window
from polarsim.geometry.camera import Camera
from polarsim.geometry.masks import SMALL_PART, Window, without_small_components
from polarsim.geometry.polygons import thick_parts, without_thin_parts
from polarsim.labels.bodies import TerrainCasters
from polarsim.labels.brightness import Brightness
from polarsim.labels.projection import sightlines
from polarsim.photo import NO_ROCK, photo_scale
from polarsim.run_files.walls import Walls

# Lengths in pixels are those of photos of the reference width.
THIN_PX = 4.0  # parts of a shadow thinner than this, such as rims at the foot of a mesh, do not extend its box
ROCK_ELLIPSE = 0.8  # diameter relative to the rock box of the ellipse that annotators regard as rock, not shadow
MARGIN = 0.25  # margin around a box in which the edge of a shadow is searched, relative to the sides of the box
MARGIN_PX = 10.0  # minimum of this margin
CLEAR = 6.0  # minimum contrast of lit ground and shadow, standard deviations of pixel noise
DEEP = 0.6  # maximum brightness of a shadow relative to lit ground; occluded stray light is brighter
LEVEL = 0.5  # level of the shadow edge between the brightness of shadow (0) and lit ground (1)
REACH, REACH_PX = 0.06, 4.0  # maximum error of a cast shadow: relative to sqrt(width * height), plus pixels
STREAK_PX = 5  # dark streaks thinner than this are relief of the ground
RIM_PX = 3  # width of the rim of a cast shadow that is not lit ground
SMOOTH_PX = 3  # side of the window over which brightness is averaged, pixels of the photo: reduces noise
MAX_AREA_RATIO = 2.5  # maximum ratio of the areas of the dark region and the cast shadow
MIN_COVERED_SHARE = 0.15  # minimum share of a dark region covered by the cast shadow


class VisibleIds:
    """Visible rock, and ground at or behind it, for a grid of pixels (rows, columns). The near wall occludes both."""

    def __init__(self, world: TerrainCasters, view: Camera, rows: np.ndarray, columns: np.ndarray) -> None:
        rays = sightlines(world, view, rows, columns)
        self.shape = (len(rows), len(columns))
        self.hit = rays.hit.reshape(self.shape)
        self.rock = np.where(self.hit, world.rock_of_face[rays.face].reshape(self.shape), NO_ROCK)
        on_ground = np.isfinite(rays.ground) & (rays.ground < rays.wall)
        self.ground = on_ground.reshape(self.shape)
        visible = np.flatnonzero(on_ground)
        # (n, 3), row by row
        self.points = view.centre + rays.ground[visible, None] * rays.directions.take(visible, axis=0)

    def shadow_of(self, world: TerrainCasters, lamp_position: np.ndarray) -> np.ndarray:
        """Return the rock (rows, columns) that occludes the lamp from the ground at each pixel, else `NO_ROCK`.

        A shadow is hidden by other rocks, but not by the mesh of the rock that casts it. Meshes can be wider than their
        rocks (skirts, unscanned back sides), so the label of the rock determines where the shadow starts.
        """
        distance, face = world.rocks.nearest(self.points, lamp_position - self.points)
        occluded = distance < 1
        rock = np.full(len(self.points), NO_ROCK)
        rock[occluded] = world.rock_of_rocks_face[face[occluded]]
        shadow = np.full(self.shape, NO_ROCK)
        shadow[self.ground] = rock
        shadow[(self.rock != NO_ROCK) & (self.rock != shadow)] = NO_ROCK
        return shadow

    def clearance(self, walls: Walls, lamp_position: np.ndarray) -> np.ndarray:
        """Return the height (rows, columns) above walls at which light from a lamp reaches the ground, metres.

        Infinite if the light crosses no wall or no ground is visible.
        """
        heights = np.full(self.shape, np.inf)
        heights[self.ground] = walls.clearance(self.points, lamp_position)
        return heights


def shadow_box(
    shadow: np.ndarray,
    rock: int,
    rock_box: np.ndarray | None,
    step: int,
    windows: Mapping[int, Window],
    thin_px: float = THIN_PX,
    *,
    slivers: bool = True,
) -> np.ndarray | None:
    """Return the bounding box (4,) of the visible shadow of a rock, px; None if too little is visible.

    `shadow` (rows, columns): rock that casts the shadow at every `step`-th pixel.
    `rock_box` (4,) or None: label of the rock in the same photo. Shadow inside the ellipse of the rock is ignored.
    `thin_px`: parts of the shadow thinner than this do not extend the box, px of the photo.
    `slivers`: whether to return boxes of shadows that are thinner than this everywhere.
    """
    if rock not in windows:
        return None
    mask = shadow[windows[rock]] == rock
    (top, bottom), (left, right) = ((side.start, side.stop) for side in windows[rock])
    if rock_box is not None:
        x, y = (np.arange(left, right) + 0.5) * step, (np.arange(top, bottom) + 0.5) * step
        half = np.maximum(rock_box[2:] - rock_box[:2], 1.0) / 2 * ROCK_ELLIPSE
        centre = (rock_box[2:] + rock_box[:2]) / 2
        mask = mask & ((((y - centre[1]) / half[1]) ** 2)[:, None] + ((x - centre[0]) / half[0]) ** 2 > 1)
    core = (without_thin_parts if slivers else thick_parts)(mask, round(thin_px / step))
    box = box_of_mask(without_small_components(core, connectivity=8))
    return None if box is None else (box + np.tile([left, top], 2)) * step


def fit_to_dark_region(
    box: np.ndarray, shadow: np.ndarray, rocks: np.ndarray, step: int, rock: int, brightness: Brightness
) -> np.ndarray | None:
    """Return the bounding box (4,) of the dark region under a cast shadow; None without such a region in the photo.

    The result is None if the surrounding ground is equally dark, as in the shadow of a wall or slope, or if the areas
    of the dark region and the cast shadow differ too much.

    `shadow`, `rocks` (rows, columns): rock that casts the shadow, and visible rock, at every `step`-th pixel. Shadows
    of walls are neither a rock nor `NO_ROCK`.
    `rock`: rock that casts the shadow.
    """
    import cv2

    longest = max(brightness.exposures_ms)
    height, width = brightness.rate.shape
    scale = photo_scale(width)
    part = pixel_window(box, np.maximum((box[2:] - box[:2]) * MARGIN, MARGIN_PX * scale), width, height)
    y, x = (np.arange(side.start, side.stop) for side in part)
    if min(len(x), len(y)) < 4:
        return None
    row, column = np.minimum(y // step, shadow.shape[0] - 1), np.minimum(x // step, shadow.shape[1] - 1)
    cast, occluder = shadow[np.ix_(row, column)] == rock, shadow[np.ix_(row, column)]
    bare = (rocks[np.ix_(row, column)] < 0) & ((occluder == NO_ROCK) | cast)  # ground without other shadows
    rate = cv2.blur(brightness.rate[part], (SMOOTH_PX, SMOOTH_PX))
    lit = bare & ~_dilated(cast, round(RIM_PX * scale))
    if cast.sum() < 12 or lit.sum() < 12:
        return None
    dark_level, lit_level = float(np.percentile(rate[cast], 25)), float(np.median(rate[lit]))
    clear = (lit_level - dark_level) * longest >= CLEAR * float(brightness.noise_dn(lit_level * longest))
    if not clear or dark_level > DEEP * lit_level:
        return None
    in_reach = _dilated(cast, round(REACH_PX * scale + REACH * float(np.sqrt(np.prod(box[2:] - box[:2])))))
    darker = in_reach & bare & (rate < dark_level + LEVEL * (lit_level - dark_level))
    dark = without_thin_parts(darker, round(STREAK_PX * scale))
    count, parts, statistics, _ = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=8)
    covered = np.bincount(parts[cast & dark], minlength=count)
    areas = statistics[:, cv2.CC_STAT_AREA]
    cast_area = int(cast.sum())
    selected = [part for part in range(1, count) if covered[part] >= MIN_COVERED_SHARE * areas[part]]
    if not selected or not 1 / MAX_AREA_RATIO < sum(areas[part] for part in selected) / cast_area < MAX_AREA_RATIO:
        return None
    largest = max(areas[part] for part in selected)
    dark_box = box_of_mask(np.isin(parts, [part for part in selected if areas[part] >= SMALL_PART * largest]))
    assert dark_box is not None
    return dark_box + np.tile([x[0], y[0]], 2)


def _dilated(mask: np.ndarray, reach: int) -> np.ndarray:
    """Return a mask (h, w) dilated by a square, `reach` pixels to all sides."""
    import cv2

    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)).astype(bool)
