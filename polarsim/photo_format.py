"""polarsim's photo format, 12-bit values with fixed black and white level, and conversion from the format of a site."""

from __future__ import annotations

import numpy as np

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.site import Images


def in_photo_format(values: np.ndarray, form: Images) -> np.ndarray:
    """Return the values (h, w) of a photo in polarsim's photo format, uint16, from those of the files of a site."""
    if _is_photo_format(form):
        return values
    scaled = (values.astype(np.float32) - np.float32(form.black)) * np.float32(_step(form)) + np.float32(BLACK_LEVEL)
    return np.clip(np.rint(scaled), 0, WHITE_LEVEL).astype(np.uint16)


def as_stored(photo: np.ndarray, form: Images) -> np.ndarray:
    """Return a photo (h, w) uint16 in polarsim's photo format with the steps that a file of a site would have."""
    if _is_photo_format(form):
        return photo
    signal = np.arange(WHITE_LEVEL + 1, dtype=np.float32) - np.float32(BLACK_LEVEL)
    values = np.clip(np.rint(signal / np.float32(_step(form))) + np.float32(form.black), 0, form.white_level)
    return in_photo_format(values, form)[photo]


def _is_photo_format(form: Images) -> bool:
    return (form.black, form.white_level) == (BLACK_LEVEL, WHITE_LEVEL)


def _step(form: Images) -> float:
    """Return the difference in polarsim's photo format of two adjacent values of a site."""
    return (WHITE_LEVEL - BLACK_LEVEL) / (form.white_level - form.black)
