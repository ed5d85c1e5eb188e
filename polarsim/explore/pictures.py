"""Photos and twins as JPEG files with a fixed tone curve, so that the page can change the exposure, and their masks."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.yolo import read_polygons
from polarsim.geometry.polygons import outlines
from polarsim.photo import BLACK_LEVEL, NO_ROCK, POLYGON_CLASSES, ROCK, SHADOW, WHITE_LEVEL
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS
from polarsim.tone import to_8bit

SMALL_PX = 240  # width of the images in the grid
QUALITY, SMALL_QUALITY = 88, 80  # JPEG quality
SIMPLIFY_PX = 1.0


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


def outlines_of_photos(polygons: Path, size: tuple[int, int]) -> list[dict[str, Any]]:
    """Return the polygons, px of a photo of a size, of a polygon file, which has no rock ids."""
    named = [(POLYGON_CLASSES[number], ring) for number, ring in read_polygons(polygons, size)]
    return [_ring(kind, NO_ROCK, ring) for kind, ring in named if kind in (ROCK, SHADOW)]


def outlines_of_twins(instances: Path) -> list[dict[str, Any]]:
    """Return the polygons of rocks and shadows in an instance map."""
    ids = png.read_png(instances)
    rings = []
    for number in np.unique(ids[ids >= ROCK_IDS]).tolist():
        kind, rock = (SHADOW, number - SHADOW_IDS) if number >= SHADOW_IDS else (ROCK, number - ROCK_IDS)
        rings += [_ring(kind, rock, ring) for ring in outlines(ids == number, SIMPLIFY_PX)]
    return rings


def _ring(kind: str, rock: int, ring: np.ndarray) -> dict[str, Any]:
    return {"kind": kind, "rock": rock, "ring": np.round(ring).astype(int).ravel().tolist()}
