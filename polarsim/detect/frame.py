"""Pictures as a network takes them, and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats import png
from polarsim.geometry.images import resize_longer_side
from polarsim.photo import HEIGHT, WIDTH

STRIDE = 32  # a network's pictures have sides that are multiples of it
PADDING = 114  # grey value around the picture, as in training


def widest_look(width: int) -> int:
    """The largest width at which a picture that is so wide is looked at without being made larger."""
    return max(width // STRIDE, 1) * STRIDE


def read_picture(path: Path) -> np.ndarray:
    """(h, w) uint8.

    Raises
    ------
    PolarsimError
        No picture, or not of one channel of 8 bits.
    """
    pixels = png.read(path)
    if pixels.ndim != 2 or pixels.dtype != np.uint8:
        raise DetectError(f"{pixels.dtype} with shape {pixels.shape}, expected one channel of 8 bits", path=path)
    return pixels


def frame(
    picture: np.ndarray, imgsz: int, full: tuple[int, int] = (WIDTH, HEIGHT)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture (h, w) uint8 as the network takes it: longer side `imgsz`, padded to whole strides.

    Returns the pixels, the (x, y) offset of the picture in them, and the (x, y) pixels to one of them of the whole
    picture, which is `full` wide and high.
    """
    picture = resize_longer_side(picture, imgsz)
    height, width = picture.shape
    rows, columns = -height % STRIDE, -width % STRIDE
    top, left = rows // 2, columns // 2
    pixels = np.pad(picture, ((top, rows - top), (left, columns - left)), constant_values=PADDING)
    return pixels, np.array([left, top], float), np.array([full[0] / width, full[1] / height])
