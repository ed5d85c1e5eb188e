"""Windows of labelled cover photos for fine-tuning, in the size of scene images."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.cover_photos.options import WIDEST_PX
from polarsim.detect.frame import read_picture
from polarsim.detect.grouping import BOX_COLUMNS
from polarsim.detect.training_windows import draw_windows, make_folders, write_window
from polarsim.errors import DetectError, with_path
from polarsim.formats import tables
from polarsim.formats.files import writing_folder
from polarsim.photo import BOX_CLASSES, PhotoKey, Terrain
from polarsim.randomness import generator


def cut_windows(
    *, photos: Path, labels: Path, windows: Path, size: tuple[int, int], count: int, stored_px: int, seed: int
) -> None:
    """Write `count` windows of each cover photo as images of a data set: `images/`, `labels/`, `masks/` of `KEY_wNN`.

    Windows are `stored_px` wide, equal to scene images. Labels are in pixels of photos of a size (width, height).
    """
    table = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    with writing_folder(windows) as folder:
        make_folders(folder)
        for path in sorted(photos.glob("*.png")):
            rows = table[table["key"] == path.stem]
            classes = rows["kind"].map(BOX_CLASSES.index).to_numpy(int)
            with with_path(path):
                photo = read_picture(path)
            boxes = rows[list(BOX_COLUMNS)].to_numpy(float) * np.tile(photo.shape[::-1], 2) / np.tile(size, 2)
            random = generator(seed, "covers", "windows", path.stem)
            numbers = range(count)
            drawn = draw_windows(photo, classes, boxes, numbers, stored_px, WIDEST_PX, random)
            for number, window in zip(numbers, drawn, strict=True):
                write_window(folder, f"{path.stem}_w{number:02d}", window)


def terrain_of_window(path: Path) -> Terrain:
    """Return the terrain of a window file."""
    key, _, number = path.stem.rpartition("_w")
    if not number.isdigit():
        raise DetectError("expected the name of a window, KEY_wNN", path=path)
    with with_path(path):
        return PhotoKey.parse(key).terrain
