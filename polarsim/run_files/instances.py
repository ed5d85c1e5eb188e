"""Instance maps of twins, 16-bit PNG: rock, or rock that casts the shadow, of every pixel."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.readers import reader
from polarsim.photo import ROCK, SHADOW, PhotoKey

# RELIEF_SHADOW is ground in the shadow of relief or a wall; rock k is ROCK_IDS + k, shadow of rock k is SHADOW_IDS + k.
# Ids from BODY to ROCK_IDS are parts of the rover in images of the rover cameras.
BACKGROUND, GROUND, RELIEF_SHADOW, BODY, ROCK_IDS, SHADOW_IDS = 0, 1, 2, 3, 1000, 2000


def instance_map_name(key: PhotoKey) -> str:
    """Return the file name of the instance map of an exposure bracket, whose photos share a map."""
    return f"{str(key).rpartition('_')[0]}.png"


@reader("instance map")
def read_instances(path: str | Path) -> np.ndarray:
    """Read an instance map (h, w), uint16."""
    ids = png.read_png(path)
    if ids.dtype != np.uint16 or ids.ndim != 2:
        raise FormatError(f"{ids.dtype} with shape {ids.shape}, expected a single channel of 16 bits", path=path)
    return ids


@reader("instance map")
def read_kind_masks(path: str | Path) -> dict[str, np.ndarray]:
    """Read the masks (h, w) bool of rocks and of shadows from an instance map."""
    ids = read_instances(path)
    return {ROCK: (ids >= ROCK_IDS) & (ids < SHADOW_IDS), SHADOW: ids >= SHADOW_IDS}
