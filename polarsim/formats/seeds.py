"""Seed labels: the label files of a run's source that its stages may read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import about
from polarsim.formats import yolo
from polarsim.photo import BOX_CLASSES, ROCK, PhotoKey


def read_rock_boxes(seeds: Path, terrain: int) -> dict[str, list[np.ndarray]]:
    """Rock boxes (n, 4) of a terrain's seeds in left photos by position, one array a file; pixels.

    Raises
    ------
    LabelError
        A file's name is no photo's, or its content no labels.
    """
    boxes: dict[str, list[np.ndarray]] = {}
    for path in sorted(Path(seeds).glob("*.txt")):
        with about(path):
            key = PhotoKey.parse(path.stem)
        if key.terrain == terrain and key.camera == "L":
            classes, annotated = yolo.read_boxes(path)
            boxes.setdefault(key.position, []).append(annotated[classes == BOX_CLASSES.index(ROCK)])
    return boxes
