"""polarsim's photo format, 12-bit values with fixed black and white level, and conversion from the format of a site."""

from __future__ import annotations

import numpy as np

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.site_parts import Images

_GREY_OF_RGB = np.array([0.2126, 0.7152, 0.0722], np.float32)  # luminance of linear values, ITU-R BT.709
_SRGB_SLOPE, _SRGB_LINEAR, _SRGB_OFFSET, _SRGB_POWER = 12.92, 0.0031308, 0.055, 2.4  # IEC 61966-2-1


def in_photo_format(values: np.ndarray, form: Images) -> np.ndarray:
    """Return the values (h, w) of a photo in polarsim's photo format, uint16, from those of the files of a site.

    `values`: (h, w) or, for their luminance, (h, w, 3) in RGB order.
    """
    if _is_photo_format(form) and values.ndim != 3:
        return values
    signal = _linear(values.astype(np.float32) - np.float32(form.black), form) * np.float32(step_dn(form))
    scaled = (signal @ _GREY_OF_RGB if values.ndim == 3 else signal) + np.float32(BLACK_LEVEL)
    return np.clip(np.rint(scaled), 0, WHITE_LEVEL).astype(np.uint16)


def as_stored(photo: np.ndarray, form: Images) -> np.ndarray:
    """Return a photo (h, w) uint16 in polarsim's photo format with the steps that a file of a site would have."""
    if _is_photo_format(form):
        return photo
    signal = np.arange(WHITE_LEVEL + 1, dtype=np.float32) - np.float32(BLACK_LEVEL)
    coded = _coded(signal / np.float32(step_dn(form)), form)
    values = np.clip(np.rint(coded) + np.float32(form.black), 0, form.white_level)
    return in_photo_format(values, form)[photo]


def _is_photo_format(form: Images) -> bool:
    return (form.black, form.white_level, form.curve) == (BLACK_LEVEL, WHITE_LEVEL, "linear")


def step_dn(form: Images) -> float:
    """Return the difference in polarsim's photo format of two adjacent values of a site."""
    return (WHITE_LEVEL - BLACK_LEVEL) / (form.white_level - form.black)


def _linear(signal: np.ndarray, form: Images) -> np.ndarray:
    """Return values above black that are proportional to light, with the same value of white."""
    if form.curve == "linear":
        return signal
    white = np.float32(form.white_level - form.black)
    share = signal / white
    power = ((np.maximum(share, 0) + _SRGB_OFFSET) / (1 + _SRGB_OFFSET)) ** _SRGB_POWER
    return np.asarray(np.where(share <= _SRGB_SLOPE * _SRGB_LINEAR, share / _SRGB_SLOPE, power) * white, np.float32)


def _coded(signal: np.ndarray, form: Images) -> np.ndarray:
    """Return values above black as coded in files: the inverse of `_linear`."""
    if form.curve == "linear":
        return signal
    white = np.float32(form.white_level - form.black)
    share = signal / white
    power = (1 + _SRGB_OFFSET) * np.maximum(share, 0) ** (1 / _SRGB_POWER) - _SRGB_OFFSET
    return np.asarray(np.where(share <= _SRGB_LINEAR, share * _SRGB_SLOPE, power) * white, np.float32)
