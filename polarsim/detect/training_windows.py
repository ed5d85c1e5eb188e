"""Random crops of labelled images at random scales, for fine-tuning of detectors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.detect.dataset import KINDS, MASKS
from polarsim.formats import png, yolo
from polarsim.geometry.boxes import area, clip
from polarsim.geometry.images import resize_longer_side
from polarsim.run_files import class_masks

_MIN_VISIBLE_SHARE = 0.3  # minimum visible share of a labelled box in a window
_TRIES = 20  # maximum number of attempts to find a window with a label
_ENTIRE_STEP = 10  # every tenth window is the entire image


@dataclass(frozen=True)
class TrainingWindow:
    """Pixels (h, w) uint8, and classes (n,) and boxes (n, 4) x0, y0, x1, y1 in pixels of the window."""

    pixels: np.ndarray
    classes: np.ndarray
    boxes: np.ndarray


def draw_windows(
    picture: np.ndarray,
    classes: np.ndarray,
    boxes: np.ndarray,
    numbers: range,
    width: int,
    widest_px: int,
    random: np.random.Generator,
) -> Iterator[TrainingWindow]:
    """Yield windows of `width` px from an image (h, w) uint8 resized at random; every tenth is the entire image.

    Parameters
    ----------
    classes, boxes : (n,), (n, 4)
        Labels, x0, y0, x1, y1 in pixels of the image.
    widest_px : int
        Maximum width of the resized image; the minimum is `width`.
    """
    rows, columns = picture.shape
    height = round(width * rows / columns)
    for number in numbers:
        share = 0.0 if number % _ENTIRE_STEP == 0 else random.random()
        resized_width = round(width * (max(widest_px, width) / width) ** share)
        pixels = resize_longer_side(picture, resized_width)
        scaled = boxes * np.tile([resized_width / columns, pixels.shape[0] / rows], 2)
        size = np.array([width, min(height, pixels.shape[0])])
        for _ in range(_TRIES):
            start = random.integers(0, np.array(pixels.shape[::-1]) - size + 1)
            inside = clip(scaled - np.tile(start, 2), *size)
            visible = area(inside) >= _MIN_VISIBLE_SHARE * area(scaled)
            if visible.any():
                break
        cut = pixels[start[1] : start[1] + size[1], start[0] : start[0] + size[0]]
        yield TrainingWindow(np.ascontiguousarray(cut), classes[visible], inside[visible])


def make_folders(folder: Path) -> None:
    """Create the folders for `write_window`."""
    for kind in (*(name for name, _ in KINDS), MASKS):
        (folder / kind).mkdir(parents=True)


def write_window(folder: Path, name: str, window: TrainingWindow) -> None:
    """Write the image and labels of a window, and a mask that is ignored in training because it is unknown."""
    png.write_png(folder / "images" / f"{name}.png", window.pixels)
    yolo.write_boxes(folder / "labels" / f"{name}.txt", window.classes, window.boxes, window.pixels.shape[::-1])
    class_masks.write_class_mask(
        folder / MASKS / f"{name}.png", np.full(window.pixels.shape, class_masks.IGNORED, np.uint8)
    )
