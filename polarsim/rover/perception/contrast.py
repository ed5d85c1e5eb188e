"""Which labelled rocks and shadows a picture shows: labels tell of those in the dark of a larger shadow too."""

from __future__ import annotations

import numpy as np

_RIM_PX = 2  # around a box that counts as its surroundings
_DARK_PERCENT, _BRIGHT_PERCENT = 2, 98
WHITE = 255


def shows(picture: np.ndarray, boxes: np.ndarray, least_contrast: float) -> np.ndarray:
    """(n,) bool: boxes in and around which a picture has at least so much contrast.

    Parameters
    ----------
    picture : (h, w) uint8
        As the detector sees it.
    boxes : (n, 4)
        x0, y0, x1, y1 in its pixels.
    least_contrast
        Between bright (98 %) and dark pixels (2 %), as a share of white.
    """
    found = np.zeros(len(boxes), bool)
    height, width = picture.shape
    for number, (x0, y0, x1, y1) in enumerate(np.asarray(boxes, float).reshape(-1, 4)):
        left, top = max(int(np.floor(x0)) - _RIM_PX, 0), max(int(np.floor(y0)) - _RIM_PX, 0)
        right, bottom = min(int(np.ceil(x1)) + _RIM_PX, width), min(int(np.ceil(y1)) + _RIM_PX, height)
        if right > left and bottom > top:
            part = picture[top:bottom, left:right]
            dark, bright = np.percentile(part, [_DARK_PERCENT, _BRIGHT_PERCENT])
            found[number] = bright - dark >= least_contrast * WHITE
    return found
