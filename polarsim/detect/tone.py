"""From the 12 linear bits of a photo or twin to the 8 bits that a detector is trained on."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.images import resize_longer_side
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.tone import encoded, white_level

_WHITE_PERCENTILE = 99.5  # of the picture's light that becomes white: a few glints may clip
_LEAST_WHITE = 64  # DN above black: noise of a dark picture stays dark
_WHITE, _UNDEREXPOSED, _LARGEST_GAIN = 255, 128, 8  # of pictures of 8 bits


def shrink(pixels: np.ndarray, longer_side: int) -> np.ndarray:
    """Return pixels (h, w) averaged to a longer side, float32; light is averaged, so before the tone curve."""
    return resize_longer_side(pixels.astype(np.float32), longer_side)


def bits_in_use(pixels: np.ndarray, kind: np.dtype) -> int:
    """8, 12 or 16: how many bits hold the grey values of a picture that is stored as uint8 or uint16."""
    if kind == np.uint8:
        return 8
    return 12 if pixels.max(initial=0) <= WHITE_LEVEL else 16


def to_8_bits(pixels: np.ndarray) -> np.ndarray:
    """Return a uint8 picture of linear 12-bit pixels (h, w): stretched to the picture's white, then gamma."""
    light = np.clip(pixels.astype(np.float32) - BLACK_LEVEL, 0, None)
    return encoded(light, white_level(light, _WHITE_PERCENTILE, _LEAST_WHITE))


def brightened(picture: np.ndarray) -> np.ndarray:
    """Return a picture (h, w) of 8 bits as bright as detectors are trained on, by a gain of 8 at most.

    Of an underexposed picture the white percentile is below half of white. What a gain of 8 leaves dark is noise.
    """
    bright = float(np.percentile(picture[::4, ::4], _WHITE_PERCENTILE))  # every 16th pixel gives the same value
    if bright >= _UNDEREXPOSED:
        return picture
    gain = min(_WHITE / max(bright, 1), _LARGEST_GAIN)
    return np.rint(np.minimum(picture * np.float32(gain), _WHITE)).astype(np.uint8)
