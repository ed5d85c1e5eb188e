"""From 12-bit values to eight bits for display: linear above black, then the display's gamma.

Pictures that detectors are trained on, published ones included, have the curve of `detect.tone`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

GAMMA = 2.2
WHITE_PERCENTILE = 99.7  # of the pixels; brighter ones are shown white
DARKEST_WHITE = 40  # DN above black: a photo of nothing stays black instead of becoming noise


def white_of(pixels: np.ndarray) -> float:
    """DN above black that is shown as white."""
    if pixels.dtype == np.uint8:
        return 255.0
    return float(np.clip(np.percentile(pixels, WHITE_PERCENTILE) - BLACK_LEVEL, DARKEST_WHITE, WHITE_LEVEL))


def to_8bit(pixels: np.ndarray, white: float | None = None) -> np.ndarray:
    """(h, w, 3) uint8 of a photo or twin (h, w) uint16; pictures of eight bits are passed through.

    Parameters
    ----------
    white
        DN above black that becomes 255: give one to several pictures to compare their brightness. Its own when None.
    """
    shown = pixels
    if pixels.dtype != np.uint8:
        shown = _curve(white_of(pixels) if white is None else white).take(pixels)
    return np.repeat(shown[..., None], 3, axis=2) if shown.ndim == 2 else shown[..., :3]


@lru_cache(maxsize=8)
def _curve(white: float) -> np.ndarray:
    """uint8 of every uint16 value."""
    values = np.arange(np.iinfo(np.uint16).max + 1, dtype=float)
    share = np.clip((values - BLACK_LEVEL) / white, 0, 1)
    return np.asarray(np.round(255 * share ** (1 / GAMMA)), np.uint8)
