"""Instance maps of twins, 16-bit PNG: which pixel shows which rock, or ground in the shadow of which rock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.readers import reader
from polarsim.photo import ROCK, SHADOW

# RELIEF_SHADOW is ground that relief or a wall hides from the lamp; rock k is ROCK_IDS + k, its shadow SHADOW_IDS + k.
# BODY and the ids up to the rocks' are parts of a rover's own body, on its own pictures.
BACKGROUND, GROUND, RELIEF_SHADOW, BODY, ROCK_IDS, SHADOW_IDS = 0, 1, 2, 3, 1000, 2000


@reader("instance map")
def read(path: str | Path) -> np.ndarray:
    """(h, w) uint16.

    Raises
    ------
    FormatError
        No picture of one channel with 16 bits.
    """
    ids = png.read(path)
    if ids.dtype != np.uint16 or ids.ndim != 2:
        raise FormatError(f"{ids.dtype} with shape {ids.shape}, an instance map is one channel of 16 bits", path=path)
    return ids


@reader("instance map")
def read_kind_masks(path: str | Path) -> dict[str, np.ndarray]:
    """Where a map shows rocks and where their shadows: (h, w) bool by kind.

    Raises
    ------
    FormatError
        See `read`.
    """
    ids = read(path)
    return {ROCK: (ids >= ROCK_IDS) & (ids < SHADOW_IDS), SHADOW: ids >= SHADOW_IDS}
