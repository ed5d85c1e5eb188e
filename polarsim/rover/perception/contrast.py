"""Contrast of labels in a picture: rocks and shadows inside a larger shadow are labelled, but not visible."""

from __future__ import annotations

import numpy as np

_RIM_PX = 2  # margin around a box that is included in the contrast
_DARK_PERCENT, _BRIGHT_PERCENT = 2, 98
WHITE = 255
# Minimum contrast of a visible label, as a share of white. Rocks in the rover's shadow are below it.
MIN_CONTRAST = 0.06


def boxes_with_contrast(picture: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Return (n,) bool: boxes with a contrast of at least `MIN_CONTRAST` in the picture, margin included.

    Contrast is the difference of bright (98 %) and dark pixels (2 %), as a share of white.

    Parameters
    ----------
    picture : (h, w) uint8
        Input of the detector.
    boxes : (n, 4)
        x0, y0, x1, y1 in pixels of the picture.
    """
    visible = np.zeros(len(boxes), bool)
    height, width = picture.shape
    for number, (x0, y0, x1, y1) in enumerate(np.asarray(boxes, float).reshape(-1, 4)):
        left, top = max(int(np.floor(x0)) - _RIM_PX, 0), max(int(np.floor(y0)) - _RIM_PX, 0)
        right, bottom = min(int(np.ceil(x1)) + _RIM_PX, width), min(int(np.ceil(y1)) + _RIM_PX, height)
        if right > left and bottom > top:
            part = picture[top:bottom, left:right]
            dark, bright = np.percentile(part, [_DARK_PERCENT, _BRIGHT_PERCENT])
            visible[number] = bright - dark >= MIN_CONTRAST * WHITE
    return visible
