"""Shading pictures of twins, 16-bit PNG: which pixels a lamp lights, and what keeps it from the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.instances import ROCK_IDS, SHADOW_IDS

# FACES_AWAY: attached shadow. ROCK_IDS + k: rock k's own surface, which rock k itself hides from the lamp: self shadow.
# SHADOW_IDS + k: whatever else rock k hides: cast shadow. BY_RELIEF, BY_WALL: cast by the ground or a wall.
NOTHING, LIT, BY_RELIEF, BY_WALL, FACES_AWAY = 0, 1, 2, 3, 4


def read_shading(path: str | Path) -> np.ndarray:
    """The picture (h, w) uint16.

    Raises
    ------
    FormatError
        No picture of one channel with 16 bits, or a value that has no meaning.
    """
    shading = png.read(path)
    if shading.dtype != np.uint16 or shading.ndim != 2:
        raise FormatError(f"{shading.dtype} with shape {shading.shape}, expected one channel of 16 bits", path=path)
    unknown = shading[(shading > FACES_AWAY) & (shading < ROCK_IDS)]
    if len(unknown):
        raise FormatError(f"value {unknown[0]} has no meaning in a shading picture", path=path)
    return shading


def self_shadow(shading: np.ndarray) -> np.ndarray:
    """(h, w) bool: surface without light for its own sake, because it faces away or its own rock hides the lamp."""
    return (shading == FACES_AWAY) | ((shading >= ROCK_IDS) & (shading < SHADOW_IDS))


def cast_shadow(shading: np.ndarray) -> np.ndarray:
    """(h, w) bool: surface without light because something else hides the lamp."""
    return (shading == BY_RELIEF) | (shading == BY_WALL) | (shading >= SHADOW_IDS)
