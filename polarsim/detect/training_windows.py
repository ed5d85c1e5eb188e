"""Windows of labelled pictures, shrunk at random: what detectors of small pictures are fine-tuned on."""

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

_LEAST_SEEN = 0.3  # share of a labelled box that a window must show
_TRIES = 20  # to draw a window that shows a label
_WHOLE = 10  # of so many windows one is the whole picture


@dataclass(frozen=True)
class Window:
    """Pixels (h, w) uint8, the classes (n,) of the boxes in it, and these (n, 4), x0, y0, x1, y1 in its pixels."""

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
) -> Iterator[Window]:
    """Windows `width` px wide of a picture (h, w) uint8 that is resized at random, every tenth of the whole picture.

    Parameters
    ----------
    classes, boxes : (n,), (n, 4)
        Labels, x0, y0, x1, y1 in pixels of the picture.
    numbers : range
        Numbers of the windows: those that tens divide are of the whole picture.
    widest_px : int
        Widths to which the picture is resized go from `width` to this, if it is more.
    """
    rows, columns = picture.shape
    height = round(width * rows / columns)
    for number in numbers:
        share = 0.0 if number % _WHOLE == 0 else random.random()
        shown = round(width * (max(widest_px, width) / width) ** share)
        pixels = resize_longer_side(picture, shown)
        scaled = boxes * np.tile([shown / columns, pixels.shape[0] / rows], 2)
        size = np.array([width, min(height, pixels.shape[0])])
        for _ in range(_TRIES):
            start = random.integers(0, np.array(pixels.shape[::-1]) - size + 1)
            inside = clip(scaled - np.tile(start, 2), *size)
            seen = area(inside) >= _LEAST_SEEN * area(scaled)
            if seen.any():
                break
        cut = pixels[start[1] : start[1] + size[1], start[0] : start[0] + size[0]]
        yield Window(np.ascontiguousarray(cut), classes[seen], inside[seen])


def make_folders(folder: Path) -> None:
    """Make the folders of a data set that `write_window` fills."""
    for kind in (*(name for name, _ in KINDS), MASKS):
        (folder / kind).mkdir(parents=True)


def write_window(folder: Path, name: str, window: Window) -> None:
    """Write a window's picture, its labels, and a mask that tells nothing: of pixels beside boxes nothing is known."""
    png.write(folder / "images" / f"{name}.png", window.pixels)
    yolo.write_boxes(folder / "labels" / f"{name}.txt", window.classes, window.boxes, window.pixels.shape[::-1])
    class_masks.write(folder / MASKS / f"{name}.png", np.full(window.pixels.shape, class_masks.IGNORED, np.uint8))
