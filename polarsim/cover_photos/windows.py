"""Windows of labelled cover photos, as large as the pictures of scenes: what detectors are fine-tuned on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.cover_photos.options import WIDEST_PX
from polarsim.detect.frame import read_picture
from polarsim.detect.grouping import BOX_COLUMNS
from polarsim.detect.training_windows import draw_windows, make_folders, write_window
from polarsim.errors import DetectError, about
from polarsim.formats import tables
from polarsim.formats.files import writing_folder
from polarsim.photo import BOX_CLASSES, HEIGHT, WIDTH, PhotoKey
from polarsim.randomness import generator

_SIZE = WIDTH, HEIGHT  # of the photos that labels lie in


def cut_windows(*, photos: Path, labels: Path, windows: Path, count: int, stored_px: int, seed: int) -> None:
    """Write windows of every cover photo as pictures of a data set: `images/`, `labels/`, `masks/` of `KEY_wNN`.

    Parameters
    ----------
    photos, labels : Path
        What `read_covers` wrote.
    count : int
        Windows of each photo.
    stored_px : int
        Width of a window, px: that of the pictures of scenes.

    Raises
    ------
    PolarsimError
        A file is missing or broken.
    """
    table = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    with writing_folder(windows) as folder:
        make_folders(folder)
        for path in sorted(photos.glob("*.png")):
            own = table[table["key"] == path.stem]
            classes = own["kind"].map(BOX_CLASSES.index).to_numpy(int)
            with about(path):
                photo = read_picture(path)
            boxes = own[list(BOX_COLUMNS)].to_numpy(float) * np.tile(photo.shape[::-1], 2) / (*_SIZE, *_SIZE)
            random = generator(seed, "covers", "windows", path.stem)
            numbers = range(count)
            drawn = draw_windows(photo, classes, boxes, numbers, stored_px, WIDEST_PX, random)
            for number, window in zip(numbers, drawn, strict=True):
                write_window(folder, window_name(PhotoKey.parse(path.stem), number), window)


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
