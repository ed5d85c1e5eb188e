"""Class masks, 8-bit PNG: class of every pixel of an image, ground, rock or shadow."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.readers import reader
from polarsim.photo import GREY_VALUES, ROCK, SHADOW
from polarsim.run_files.instances import BACKGROUND, GROUND, RELIEF_SHADOW, SHADOW_IDS

CLASSES = (
    "ground",
    ROCK,
    SHADOW,
)  # pixel values are indices in this tuple; ground is everything except rock and shadow
IGNORED = 255  # unknown or excluded from the evaluation; not used in the masks of detectors


@reader("class mask")
def read_class_mask(path: str | Path) -> np.ndarray:
    """Read a mask (h, w) uint8 of indices in `CLASSES` and of `IGNORED`."""
    mask = png.read_png(path)
    if mask.dtype != np.uint8 or mask.ndim != 2:
        raise FormatError(f"{mask.dtype} with shape {mask.shape}, expected a single channel of 8 bits", path=path)
    wrong = (mask >= len(CLASSES)) & (mask != IGNORED)
    if wrong.any():
        names = ", ".join(f"{number} {name}" for number, name in enumerate(CLASSES))
        raise FormatError(f"value {mask[wrong][0]}, expected {names}, {IGNORED} ignored", path=path)
    return mask


def write_class_mask(path: str | Path, mask: np.ndarray) -> None:
    """Write a mask (h, w) uint8."""
    png.write_png(path, mask)


def of_ids(ids: np.ndarray, labelled: Collection[int]) -> np.ndarray:
    """Convert an instance map (h, w), see `instances`, to a class mask.

    Parameters
    ----------
    labelled
        Ids of the rocks and shadows with a label. Rocks and shadows without a label, too small or without contrast,
        are ignored. Shadows of relief and walls are ground, as in the annotated polygons.
    """
    largest = max(RELIEF_SHADOW, int(ids.max(initial=0)), *labelled)  # a labelled rock may be occluded in this image
    class_of_id = np.full(largest + 1, IGNORED, np.uint8)
    class_of_id[[BACKGROUND, GROUND, RELIEF_SHADOW]] = CLASSES.index("ground")
    for number in labelled:
        class_of_id[number] = CLASSES.index(SHADOW if number >= SHADOW_IDS else ROCK)
    return class_of_id[ids]


def of_grey_map(grey: np.ndarray, background: int = CLASSES.index("ground")) -> np.ndarray:
    """Convert a grey map (h, w) of polygons to a class mask; `background` is the value of background pixels."""
    class_of_grey = np.full(256, IGNORED, np.uint8)
    for number, name in enumerate(CLASSES):
        class_of_grey[GREY_VALUES[name]] = number
    class_of_grey[GREY_VALUES["background"]] = background
    return class_of_grey[grey]


def resized(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Resize a mask (h, w) to a width and height by nearest-neighbour interpolation."""
    import cv2

    return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST_EXACT))
