"""Test whether an image is like POLAR's photos: only then `rocks.pt` is used, and its confidences are calibrated.

Photos of POLAR have deep shadows, a dark hall or clipped sand, because the lamps are low and there is no sky. Images in
daylight have neither. The measure is the share of dark and clipped pixels of the detector input.

The limit is the 4 % quantile of 12 cover photos and 240 random photos of the analog, of all lamps, exposures and rover
lights, rounded down. Photos below the limit: 0 of 12 cover photos, 16 of 432 photos of the analog (12 of them without a
lamp), 0 of 120 photos of the analog with another seed and other terrains. Of the photos of the Curiosity rover
(MarsData-V2), which were not used for the limit, 58 of 61 are below. Among 16 statistics of grey levels with limits by
the same quantile, the standard deviation over the mean separates 54 of these photos, ratios of percentiles 34 to 48,
the entropy 4. A dark or clipped image of another kind passes the test.
"""

from __future__ import annotations

import numpy as np

from polarsim.geometry.images import resize_longer_side

DARK, CLIPPED = 48, 240  # grey values of dark pixels (below) and of clipped pixels (from)
MIN_EXTREME_SHARE = 0.06  # minimum share of these pixels in an image like POLAR's
LONGER_SIDE = 320  # px: averages over noise and small texture


def extreme_share(grey: np.ndarray) -> float:
    """Return the share of dark and clipped pixels of a detector input (h, w) uint8."""
    small = resize_longer_side(grey, LONGER_SIDE) if max(grey.shape) > LONGER_SIDE else grey
    return float(((small < DARK) | (small >= CLIPPED)).mean())


def is_like_polar(grey: np.ndarray) -> bool:
    """Return whether a detector input (h, w) uint8 has enough dark and clipped pixels."""
    return extreme_share(grey) >= MIN_EXTREME_SHARE
