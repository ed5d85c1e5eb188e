"""Photos and twins as JPEG files with a fixed tone curve, so that the page can change the exposure."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.tone import to_8bit

SMALL_PX = 240  # width of the images in the grid
QUALITY, SMALL_QUALITY = 88, 80  # JPEG quality


def jpeg(path: Path, width: int, quality: int = QUALITY) -> bytes:
    """Scale an image to a width and encode it: linear from black to the sensor's white, then gamma 2.2."""
    import cv2

    pixels = _read(path)
    if min(pixels.shape[:2]) < 1:
        raise FormatError("image without pixels", path=path)
    size = (width, max(1, round(width * pixels.shape[0] / pixels.shape[1])))
    if width < pixels.shape[1]:
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    shown = to_8bit(pixels, WHITE_LEVEL - BLACK_LEVEL)
    grey = shown[..., 0] if pixels.ndim == 2 else np.ascontiguousarray(shown[..., ::-1])
    done, content = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert done
    return content.tobytes()


@lru_cache(maxsize=4)  # large and small copies are encoded in succession
def _read(path: Path) -> np.ndarray:
    return png.read_png(path)


def small_jpeg(path: Path) -> bytes:
    return jpeg(path, SMALL_PX, SMALL_QUALITY)
