"""Conversion of linear 12-bit photos and twins to the 8-bit input of detectors."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.images import resize_longer_side
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.tone import encode_tone, white_level

_WHITE_PERCENTILE = 99.5  # percentile of the light that becomes white; glints may be clipped
_MIN_WHITE = 64  # minimum white level, DN above black, so that the noise of dark images remains dark
_WHITE, _UNDEREXPOSED, _MAX_GAIN = 255, 128, 8  # 8-bit images: white, underexposure threshold, maximum gain


def shrink(pixels: np.ndarray, longer_side: int) -> np.ndarray:
    """Return linear pixels (h, w) averaged to a longer side, float32. Apply before the tone curve."""
    return resize_longer_side(pixels.astype(np.float32), longer_side)


def bits_in_use(pixels: np.ndarray, kind: np.dtype) -> int:
    """Return the bit depth (8, 12 or 16) of the grey values of an image stored as uint8 or uint16."""
    if kind == np.uint8:
        return 8
    return 12 if pixels.max(initial=0) <= WHITE_LEVEL else 16


def to_8_bits(pixels: np.ndarray) -> np.ndarray:
    """Convert linear 12-bit pixels (h, w) to uint8: scaling to the white level of the image, then gamma."""
    light = np.clip(pixels.astype(np.float32) - BLACK_LEVEL, 0, None)
    return encode_tone(light, white_level(light, _WHITE_PERCENTILE, _MIN_WHITE))


def brighten(picture: np.ndarray) -> np.ndarray:
    """Brighten an underexposed 8-bit image (h, w) to the brightness of training images, by a gain of at most 8.

    An image is underexposed if the white percentile is below half of white. Images that need a higher gain are noise.
    """
    bright = float(np.percentile(picture[::4, ::4], _WHITE_PERCENTILE))  # every 16th pixel gives the same value
    if bright >= _UNDEREXPOSED:
        return picture
    gain = min(_WHITE / max(bright, 1), _MAX_GAIN)
    return np.rint(np.minimum(picture * np.float32(gain), _WHITE)).astype(np.uint8)
