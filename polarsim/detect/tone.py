"""From the 12 linear bits of a photo or twin to the 8 bits that a detector is trained on."""

from __future__ import annotations

import numpy as np

from polarsim.detect.options import PicturesOptions
from polarsim.errors import DetectError
from polarsim.geometry.images import resize_longer_side
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.tone import GAMMA

_WHITE, _UNDEREXPOSED, _LARGEST_GAIN = 255, 128, 8  # of pictures of 8 bits


def shrink(pixels: np.ndarray, longer_side: int) -> np.ndarray:
    """Return pixels (h, w) averaged to a longer side, float32; light is averaged, so before the tone curve."""
    return resize_longer_side(pixels.astype(np.float32), longer_side)


def bits_in_use(pixels: np.ndarray, kind: np.dtype) -> int:
    """8, 12 or 16: how many bits hold the grey values of a picture that is stored as uint8 or uint16."""
    if kind == np.uint8:
        return 8
    return 12 if pixels.max(initial=0) <= WHITE_LEVEL else 16


def to_8_bits(pixels: np.ndarray, options: PicturesOptions, exposure_ms: float | None = None) -> np.ndarray:
    """(h, w) uint8 picture of linear 12-bit pixels (h, w), by the curve that the options name.

    Curve `fixed` needs the picture's exposure in ms: light is scaled to what `tone_exposure_ms` would have gathered, so
    pictures of one scene look alike. A longer exposure's clipped pixels come out grey: what they were is not known.

    Raises
    ------
    DetectError
        Curve `fixed`, and no exposure.
    """
    light = np.clip(pixels.astype(np.float32) - BLACK_LEVEL, 0, None)
    white = float(WHITE_LEVEL - BLACK_LEVEL)
    if options.tone == "fixed":
        if not exposure_ms:
            raise DetectError("tone curve fixed needs the picture's exposure")
        white *= exposure_ms / options.tone_exposure_ms
    elif options.tone != "linear":
        white = min(white, max(float(np.percentile(light, options.tone_percentile)), options.tone_floor_dn))
    bright = np.clip(light / white, 0, 1)
    if options.tone in ("gamma", "fixed"):
        bright **= 1 / GAMMA
    return np.rint(255 * bright).astype(np.uint8)


def brightened(picture: np.ndarray, options: PicturesOptions) -> np.ndarray:
    """A picture (h, w) of 8 bits that is too dark, made as bright as detectors are trained on; others as they are.

    Of an underexposed picture `tone_percentile` lies below half of white: it becomes white, by a gain of 8 at most, for
    what is darker still is noise.
    """
    bright = float(np.percentile(picture[::4, ::4], options.tone_percentile))  # every 16th pixel tells as much
    if bright >= _UNDEREXPOSED:
        return picture
    gain = min(_WHITE / max(bright, 1), _LARGEST_GAIN)
    return np.rint(np.minimum(picture * np.float32(gain), _WHITE)).astype(np.uint8)


def mean_dn(pixels: np.ndarray) -> float:
    """Mean value above the black level."""
    return float(pixels.mean()) - BLACK_LEVEL
