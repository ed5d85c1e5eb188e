"""Edges of a cast shadow's box, moved to where the photo shows the dark region to end."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.boxes import of_mask, window
from polarsim.geometry.polygons import without_thin_parts
from polarsim.labels.parts import SMALL_PART
from polarsim.labels.photos import Brightness, noise_dn
from polarsim.photo import NO_ROCK

MARGIN = 0.25  # of a box's sides, and at least MARGIN_PX: so far outside it is looked for the shadow's end
MARGIN_PX = 10.0
CLEAR = 6.0  # noises of a pixel by which lit ground must be brighter than the shadow
DEEP = 0.6  # of lit ground's brightness: a lamp's shadow is darker, what a rock hides of stray light is not
LEVEL = 0.5  # between the shadow's brightness and that of lit ground: the edge of a shadow with a soft rim
REACH, REACH_PX = 0.06, 4.0  # of sqrt(width * height), and pixels more: so far the cast shadow may be off
THIN_PX = 5  # dark streaks thinner than this belong to the ground's relief
SMOOTH_PX = 3  # side of the window over which brightness is averaged
LIKE_SIZE = 2.5  # largest ratio of the dark region's area and the cast shadow's
CORE_SHARE = 0.15  # least share of a dark region that the cast shadow covers


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
    dark = without_thin_parts(near & bare & (rate < dark_level + LEVEL * (lit_level - dark_level)), THIN_PX)
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
