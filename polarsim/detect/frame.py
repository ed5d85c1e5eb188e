"""Conversion of images to network input, and of coordinates back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats import png
from polarsim.geometry.images import resize_longer_side

STRIDE = 32  # the sides of the network input are multiples of this, px
PADDING = 114  # grey value of the padding, as in training


def max_inference_width(width: int) -> int:
    """Return the maximum inference width of an image without upscaling, px."""
    return max(width // STRIDE, 1) * STRIDE


def read_picture(path: Path) -> np.ndarray:
    """Read an 8-bit grey image (h, w)."""
    pixels = png.read_png(path)
    if pixels.ndim != 2 or pixels.dtype != np.uint8:
        raise DetectError(f"{pixels.dtype} with shape {pixels.shape}, expected one channel of 8 bits", path=path)
    return pixels


def letterbox(picture: np.ndarray, imgsz: int, full: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Resize an image (h, w) uint8 to the longer side `imgsz` and pad it to multiples of `STRIDE`.

    Return the network input, the position (x, y) of the image in it, px, and the pixels (x, y) of the original image,
    of size `full` (width, height), per pixel of the network input.
    """
    picture = resize_longer_side(picture, imgsz)
    height, width = picture.shape
    rows, columns = -height % STRIDE, -width % STRIDE
    top, left = rows // 2, columns // 2
    pixels = np.pad(picture, ((top, rows - top), (left, columns - left)), constant_values=PADDING)
    return pixels, np.array([left, top], float), np.array([full[0] / width, full[1] / height])
