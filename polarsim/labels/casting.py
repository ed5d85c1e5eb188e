"""Shadow casting: the ground that rocks and walls take from a near lamp, as a view shows it, and its box in a photo.

The survey and the meshes give positions of lamps and walls with errors of centimetres. At a low Sun such errors move
the end of a wall's shade by decimetres. The photo shows that edge, so one fitted number absorbs all errors: the height
that the walls would have to have (`shading_height`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.geometry.boxes import of_mask, window
from polarsim.geometry.camera import Camera
from polarsim.geometry.masks import SMALL_PART, Window, without_small_components
from polarsim.geometry.polygons import thick_parts, without_thin_parts
from polarsim.labels.bodies import World
from polarsim.labels.brightness import Brightness, noise_dn
from polarsim.labels.projection import sightlines
from polarsim.photo import NO_ROCK, Azimuth, Light
from polarsim.run_files.rigs import LocalisedRig

THIN_PX = 4.0  # parts of a shadow thinner than this do not widen its box: rims under rocks, where meshes meet the sand
ROCK_ELLIPSE = 0.8  # of a rock's label box: the ellipse in which people see rock, never shadow
MARGIN = 0.25  # of a box's sides, and at least MARGIN_PX: so far outside it is looked for the shadow's end
MARGIN_PX = 10.0
CLEAR = 6.0  # noises of a pixel by which lit ground must be brighter than the shadow
DEEP = 0.6  # of lit ground's brightness: a lamp's shadow is darker, what a rock hides of stray light is not
LEVEL = 0.5  # between the shadow's brightness and that of lit ground: the edge of a shadow with a soft rim
REACH, REACH_PX = 0.06, 4.0  # of sqrt(width * height), and pixels more: so far the cast shadow may be off
STREAK_PX = 5  # dark streaks thinner than this belong to the ground's relief
SMOOTH_PX = 3  # side of the window over which brightness is averaged
LIKE_SIZE = 2.5  # largest ratio of the dark region's area and the cast shadow's
CORE_SHARE = 0.15  # least share of a dark region that the cast shadow covers

# Of the edge of a wall's shade.
WALL_STEP = 0.01  # metres between the heights that are tried
WALL_RANGE = (0.4, 1.8)  # of the stated height
WALL_BAND = 0.04  # metres of height below and above the shade's edge that are compared
FEWEST_IN_BAND = 50  # samples in a band that tell of its brightness
WALL_CLEAR = 1.6  # least ratio of the brightness above and below the edge
WALL_FAINT = 0.03  # of lit ground's brightness: differences of less, in the deepest shade, tell of no edge


def lamp(world: World, localised: LocalisedRig, light: Light, azimuth: Azimuth) -> np.ndarray | None:
    """(3,) position of the lamp that casts the shadows, sandbox frame; None in the dark.

    A Sun lamp outshines the rover light.
    """
    if azimuth != "no":
        return world.suns[azimuth]
    if light == "on":
        return localised.rover_light
    return None


class Ids:
    """What a view sees at a grid of pixels (rows, columns): the rock there, and the ground there or behind the rock.

    The near wall of the sandbox hides both.
    """

    def __init__(self, world: World, view: Camera, rows: np.ndarray, columns: np.ndarray) -> None:
        seen = sightlines(world, view, rows, columns)
        self.shape = (len(rows), len(columns))
        self.hit = seen.hit.reshape(self.shape)
        self.rock = np.where(self.hit, world.rock_of_face[seen.face].reshape(self.shape), NO_ROCK)
        on_ground = np.isfinite(seen.ground) & (seen.ground < seen.wall)
        self.ground = on_ground.reshape(self.shape)
        # (n, 3), row by row
        self.points = view.centre + seen.ground[on_ground, None] * seen.directions[on_ground]

    def shadow_of(self, world: World, lamp_position: np.ndarray) -> np.ndarray:
        """(rows, columns) rock that takes the lamp's light from the ground at each pixel; `NO_ROCK` elsewhere.

        Other rocks hide a rock's shadow, its own mesh does not: where the rock ends is for its label to say, since
        meshes may be wider than their rocks (skirts, back sides that no scan saw).
        """
        distance, face = world.rocks.nearest(self.points, lamp_position - self.points)
        occluded = distance < 1
        rock = np.full(len(self.points), NO_ROCK)
        rock[occluded] = world.rock_of_rocks_face[face[occluded]]
        shadow = np.full(self.shape, NO_ROCK)
        shadow[self.ground] = rock
        shadow[(self.rock != NO_ROCK) & (self.rock != shadow)] = NO_ROCK
        return shadow

    def over_walls(self, world: World, lamp_position: np.ndarray) -> np.ndarray:
        """(rows, columns) metres above the sand at which a lamp's light passes the walls on its way to the ground.

        Infinite where nothing is in its way, and where no ground is seen.
        """
        heights = np.full(self.shape, np.inf)
        passing = passing_heights(self.points, lamp_position, world.ground_bounds)
        heights[self.ground] = passing - world.ground_level
        return heights


def shadow_box(
    shadow: np.ndarray,
    rock: int,
    rock_box: np.ndarray | None,
    step: int,
    windows: Mapping[int, Window],
    *,
    slivers: bool = True,
) -> np.ndarray | None:
    """(4,) box around the visible shadow of a rock, px; None where too little of it is seen.

    Parameters
    ----------
    shadow : (rows, columns) int
        Rock whose shadow is seen at every `step`-th pixel.
    rock_box : (4,) float or None
        The rock's label in the same photo. People see rock in it, so that a shadow starts where the rock ends.
    windows
        The picture's, from `windows_of`.
    slivers
        Whether a shadow that is thinner than `THIN_PX` everywhere has a box.
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
    core = (without_thin_parts if slivers else thick_parts)(mask, round(THIN_PX / step))
    box = of_mask(without_small_components(core, connectivity=8))
    return None if box is None else (box + np.tile([left, top], 2)) * step


def snapped(
    box: np.ndarray, shadow: np.ndarray, rocks: np.ndarray, step: int, rock: int, brightness: Brightness
) -> np.ndarray | None:
    """The box (4,) around the dark region under a cast shadow; None where the photo does not show such a region.

    It shows none where the ground around is as dark, as in the shadow of a wall or of a slope, and where the dark
    region is much larger or smaller than the cast shadow: then something else darkens the ground.

    Parameters
    ----------
    box : (4,) float
        Around the shadow as cast, px.
    shadow, rocks : (rows, columns) int
        Whose shadow, and which rock, is seen at every `step`-th pixel; `rock` is the one that throws the shadow. What
        walls shade belongs to none, nor to `NO_ROCK`.
    """
    import cv2

    longest = max(brightness.exposures_ms)
    height, width = brightness.rate.shape
    part = window(box, np.maximum((box[2:] - box[:2]) * MARGIN, MARGIN_PX), width, height)
    y, x = (np.arange(side.start, side.stop) for side in part)
    if min(len(x), len(y)) < 4:
        return None
    row, column = np.minimum(y // step, shadow.shape[0] - 1), np.minimum(x // step, shadow.shape[1] - 1)
    cast, thrower = shadow[np.ix_(row, column)] == rock, shadow[np.ix_(row, column)]
    bare = (rocks[np.ix_(row, column)] < 0) & ((thrower == NO_ROCK) | cast)  # ground that nothing else darkens
    rate = cv2.blur(brightness.rate[part], (SMOOTH_PX, SMOOTH_PX))
    lit = bare & ~cv2.dilate(cast.astype(np.uint8), np.ones((7, 7), np.uint8)).astype(bool)
    if cast.sum() < 12 or lit.sum() < 12:
        return None
    dark_level, lit_level = float(np.percentile(rate[cast], 25)), float(np.median(rate[lit]))
    clear = (lit_level - dark_level) * longest >= CLEAR * float(noise_dn(lit_level * longest))
    if not clear or dark_level > DEEP * lit_level:
        return None
    reach = round(REACH_PX + REACH * float(np.sqrt(np.prod(box[2:] - box[:2]))))
    near = cv2.dilate(cast.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)).astype(bool)
    dark = without_thin_parts(near & bare & (rate < dark_level + LEVEL * (lit_level - dark_level)), STREAK_PX)
    count, parts, figures, _ = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=8)
    covered = np.bincount(parts[cast & dark], minlength=count)
    areas = figures[:, cv2.CC_STAT_AREA]
    cast_area = int(cast.sum())
    own = [part for part in range(1, count) if covered[part] >= CORE_SHARE * areas[part]]
    if not own or not 1 / LIKE_SIZE < sum(areas[part] for part in own) / cast_area < LIKE_SIZE:
        return None
    largest = max(areas[part] for part in own)
    found = of_mask(np.isin(parts, [part for part in own if areas[part] >= SMALL_PART * largest]))
    assert found is not None
    return found + np.tile([x[0], y[0]], 2)


def passing_heights(points: np.ndarray, lamp: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """(n,) z at which the light of a lamp (3,) to points (n, 3) passes the walls on bounds (2, 2); inf: it need not."""
    to_lamp = lamp - points
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(to_lamp[:, :2] > 0, bounds[1] - points[:, :2], bounds[0] - points[:, :2]) / to_lamp[:, :2]
    share = np.fmin.reduce(np.where(shares >= 0, shares, np.inf), axis=1)
    return np.where(share < 1, points[:, 2] + share * to_lamp[:, 2], np.inf)


def shading_height(passing: np.ndarray, rate: np.ndarray, stated: float) -> float:
    """Height of walls whose shade ends where a photo shows it to end; the stated one where it shows no such end.

    Parameters
    ----------
    passing, rate : (n,) float
        Height above the ground, metres, at which light passes the walls on its way to bare ground, and how bright that
        ground is in the photo.
    stated
        Of the walls, metres.
    """
    order = np.argsort(passing, kind="stable")
    passing, rate = passing[order], rate[order]
    faint = WALL_FAINT * float(np.percentile(rate, 90)) if len(rate) else 0.0
    best, edge, half_lit = WALL_CLEAR, stated, 0.0
    for tried in np.arange(WALL_RANGE[0] * stated, WALL_RANGE[1] * stated, WALL_STEP):
        dark, lit = _median(passing, rate, tried - WALL_BAND, tried), _median(passing, rate, tried, tried + WALL_BAND)
        if lit + faint > best * (dark + faint):
            best, edge, half_lit = (lit + faint) / (dark + faint), tried, (dark + lit) / 2
    while half_lit and _median(passing, rate, edge, edge + WALL_STEP) < half_lit:  # a lamp's disc makes the edge soft
        edge += WALL_STEP
    return float(edge)


def _median(passing: np.ndarray, rate: np.ndarray, low: float, high: float) -> float:
    """Of the brightness where light passes between two heights, passing in order; NaN where few samples tell."""
    start, end = np.searchsorted(passing, [low, high])
    return float(np.median(rate[start:end])) if end - start >= FEWEST_IN_BAND else np.nan
