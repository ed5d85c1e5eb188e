"""Class masks, 8-bit PNG: what every pixel of a picture shows, ground, a rock or a shadow."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.readers import reader
from polarsim.photo import GREY_VALUES, ROCK, SHADOW
from polarsim.run_files.instances import BACKGROUND, GROUND, RELIEF_SHADOW, SHADOW_IDS

CLASSES = ("ground", ROCK, SHADOW)  # a pixel's value is its index here; ground is all that is neither rock nor shadow
IGNORED = 255  # nobody can tell, or nobody asks; what detectors write has none


@reader("class mask")
def read(path: str | Path) -> np.ndarray:
    """(h, w) uint8 of indices in `CLASSES` and of `IGNORED`.

    Raises
    ------
    FormatError
        No picture of one channel with 8 bits, or another value.
    """
    mask = png.read(path)
    if mask.dtype != np.uint8 or mask.ndim != 2:
        raise FormatError(f"{mask.dtype} with shape {mask.shape}, a class mask is one channel of 8 bits", path=path)
    wrong = (mask >= len(CLASSES)) & (mask != IGNORED)
    if wrong.any():
        names = ", ".join(f"{number} {name}" for number, name in enumerate(CLASSES))
        raise FormatError(f"value {mask[wrong][0]}, expected {names}, {IGNORED} ignored", path=path)
    return mask


def write(path: str | Path, mask: np.ndarray) -> None:
    """Write a mask (h, w) uint8."""
    png.write(path, mask)


def of_ids(ids: np.ndarray, labelled: Collection[int]) -> np.ndarray:
    """The class mask of a picture of ids (h, w), see `formats.instances`.

    Parameters
    ----------
    labelled
        Ids of the rocks and shadows that have a label; all others, too small or without contrast, are ignored. The
        shade of relief and of walls is ground, as in the polygons that people drew.
    """
    largest = max(RELIEF_SHADOW, int(ids.max(initial=0)), *labelled)  # a labelled thing may be hidden in this picture
    class_of_id = np.full(largest + 1, IGNORED, np.uint8)
    class_of_id[[BACKGROUND, GROUND, RELIEF_SHADOW]] = CLASSES.index("ground")
    for number in labelled:
        class_of_id[number] = CLASSES.index(SHADOW if number >= SHADOW_IDS else ROCK)
    return class_of_id[ids]


def of_grey_map(grey: np.ndarray, background: int = CLASSES.index("ground")) -> np.ndarray:
    """The class mask of a grey map (h, w) of polygons, its background of the class that is named, or `IGNORED`."""
    class_of_grey = np.full(256, IGNORED, np.uint8)
    for number, name in enumerate(CLASSES):
        class_of_grey[GREY_VALUES[name]] = number
    class_of_grey[GREY_VALUES["background"]] = background
    return class_of_grey[grey]


def resized(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A mask (h, w) of another width and height, every pixel that of the nearest one."""
    import cv2

    return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST_EXACT))
