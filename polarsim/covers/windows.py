"""Windows of labelled cover photos, as large as the pictures of scenes: what detectors are fine-tuned on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.covers.options import FineTuningOptions
from polarsim.detect.dataset import BOX_COLUMNS, KINDS, MASKS
from polarsim.detect.frame import read_picture, resized
from polarsim.errors import DetectError, about
from polarsim.formats import class_masks, png, tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry.boxes import area, clip
from polarsim.photo import BOX_CLASSES, HEIGHT, WIDTH, PhotoKey
from polarsim.randomness import generator

_LEAST_SEEN = 0.3  # share of a labelled box that a window must show
_TRIES = 20  # to draw a window that shows a label
_WHOLE = 10  # of so many windows one is the whole photo


@dataclass(frozen=True)
class Window:
    """Pixels (h, w) uint8, the classes (n,) of the boxes in it, and these (n, 4), x0, y0, x1, y1 in its pixels."""

    pixels: np.ndarray
    classes: np.ndarray
    boxes: np.ndarray


def cut_windows(
    *, photos: Path, labels: Path, windows: Path, options: FineTuningOptions, stored_px: int, seed: int
) -> None:
    """Write windows of every cover photo as pictures of a data set: `images/`, `labels/`, `masks/` of `KEY_wNN`.

    Parameters
    ----------
    photos, labels : Path
        What `read_covers` wrote.
    stored_px : int
        Width of a window, px: that of the pictures of scenes.

    Raises
    ------
    PolarsimError
        A file is missing or broken.
    """
    table = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    with writing_folder(windows) as folder:
        for kind in (*(name for name, _ in KINDS), MASKS):
            (folder / kind).mkdir()
        for path in sorted(photos.glob("*.png")):
            own = table[table["key"] == path.stem]
            classes = own["kind"].map(BOX_CLASSES.index).to_numpy(int)
            with about(path):
                photo = read_picture(path)
            random = generator(seed, "covers", "windows", path.stem)
            drawn = draw_windows(photo, classes, own[list(BOX_COLUMNS)].to_numpy(float), options, stored_px, random)
            for number, window in enumerate(drawn):
                _write(folder, window_name(PhotoKey.parse(path.stem), number), window)


def window_name(key: PhotoKey, number: int) -> str:
    """Name of a window of a photo, such as `01_A_off_30_L_0256_w03`."""
    return f"{key}_w{number:02d}"


def terrain_of_window(path: Path) -> int:
    """The terrain that the window in a file shows.

    Raises
    ------
    DetectError
        The file's name is no window's.
    """
    key, _, number = path.stem.rpartition("_w")
    if not number.isdigit():
        raise DetectError("expected the name of a window, KEY_wNN", path=path)
    with about(path):
        return PhotoKey.parse(key).terrain


def draw_windows(
    photo: np.ndarray,
    classes: np.ndarray,
    boxes: np.ndarray,
    options: FineTuningOptions,
    width: int,
    random: np.random.Generator,
) -> Iterator[Window]:
    """Windows `width` px wide of a photo (h, w) uint8 that is shrunk at random, every tenth of the whole photo.

    Parameters
    ----------
    classes, boxes : (n,), (n, 4)
        Labels, x0, y0, x1, y1 in pixels of a photo of full size.
    """
    for number in range(options.windows):
        share = 0.0 if number % _WHOLE == 0 else random.random()
        shown = round(width * (max(options.widest_px, width) / width) ** share)
        pixels = resized(photo, shown)
        scaled = boxes * np.tile([shown / WIDTH, pixels.shape[0] / HEIGHT], 2)
        size = np.array([width, min(round(width * HEIGHT / WIDTH), pixels.shape[0])])
        for _ in range(_TRIES):
            start = random.integers(0, np.array(pixels.shape[::-1]) - size + 1)
            inside = clip(scaled - np.tile(start, 2), *size)
            seen = area(inside) >= _LEAST_SEEN * area(scaled)
            if seen.any():
                break
        cut = pixels[start[1] : start[1] + size[1], start[0] : start[0] + size[0]]
        yield Window(np.ascontiguousarray(cut), classes[seen], inside[seen])


def _write(folder: Path, name: str, window: Window) -> None:
    png.write(folder / "images" / f"{name}.png", window.pixels)
    yolo.write_boxes(folder / "labels" / f"{name}.txt", window.classes, window.boxes, window.pixels.shape[::-1])
    # People drew boxes, so of its pixels nothing is known.
    class_masks.write(folder / MASKS / f"{name}.png", np.full(window.pixels.shape, class_masks.IGNORED, np.uint8))
