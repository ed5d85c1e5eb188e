"""Tone curve from linear light to 8 bits: linear between black and white level, then gamma.

The white level of displayed images (figures, previews, exports to labelling tools) is computed by
`display_white_level`, the white level of training and published images by `detect.tone`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

GAMMA = 2.2
WHITE_PERCENTILE = 99.7  # of displayed pixels; brighter pixels are white
MIN_WHITE_DN = 40  # minimum white level, DN above black: keeps a dark photo black instead of amplifying noise


def encode_tone(light: np.ndarray, white: float, gamma: float = GAMMA) -> np.ndarray:
    """Return light above black, DN, as uint8; `white` DN and more become 255."""
    share = np.clip(light / white, 0, 1)
    return np.asarray(np.rint(255 * (share if gamma == 1 else share ** (1 / gamma))), np.uint8)


def white_level(light: np.ndarray, percentile: float, darkest: float, black: int = 0) -> float:
    """Return the percentile of light above black, DN, not below `darkest` and not above what a photo can hold.

    `black` is the value of `light` without light. The percentile of integers takes half the time of that of floats.
    """
    return float(min(WHITE_LEVEL - BLACK_LEVEL, max(float(np.percentile(light, percentile)) - black, darkest)))


def display_white_level(pixels: np.ndarray) -> float:
    """Return the light, DN above black, that a displayed picture shows as white."""
    if pixels.dtype == np.uint8:
        return 255.0
    return white_level(pixels, WHITE_PERCENTILE, MIN_WHITE_DN, BLACK_LEVEL)


def to_uint8(pixels: np.ndarray, white: float | None = None) -> np.ndarray:
    """Return uint8 values, of the same shape, of a photo or twin with uint16 values; 8-bit images are not changed.

    Parameters
    ----------
    white
        DN above black that becomes 255; a common value makes the brightness of images comparable.
        None: `display_white_level`.
    """
    if pixels.dtype == np.uint8:
        return pixels
    return _curve(display_white_level(pixels) if white is None else white).take(pixels)


def to_8bit(pixels: np.ndarray, white: float | None = None) -> np.ndarray:
    """Return (h, w, 3) uint8 of a photo or twin (h, w), see `to_uint8`."""
    shown = to_uint8(pixels, white)
    return np.repeat(shown[..., None], 3, axis=2) if shown.ndim == 2 else shown[..., :3]


@lru_cache(maxsize=8)
def _curve(white: float) -> np.ndarray:
    """Return a table with the uint8 value of every uint16 value."""
    return encode_tone(np.arange(np.iinfo(np.uint16).max + 1, dtype=float) - BLACK_LEVEL, white)
