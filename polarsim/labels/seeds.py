"""Seed labels: the only label files that propagation may read."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats import yolo
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, Azimuth, Camera, PhotoKey

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Drawn:
    """What a person drew in one photo: boxes (n, 4) in pixels."""

    rocks: np.ndarray
    shadows: np.ndarray


Seeds = dict[tuple[str, Camera], dict[Azimuth, Drawn]]  # by view, then by azimuth


def read_seeds(folder: Path, terrain: int) -> Seeds:
    """Every `KEY.txt` of a terrain; where a view and azimuth have several, light off and then most boxes win.

    Raises
    ------
    FormatError
        A broken label line.
    LabelError
        A file name that is no photo key.
    """
    found: dict[tuple[str, Camera, Azimuth], tuple[tuple[bool, int], Drawn]] = {}
    for path in sorted(folder.glob("*.txt")):
        key = PhotoKey.parse(path.stem)
        if key.terrain != terrain:
            log.warning("%s: no seed of terrain %02d, left out", path, terrain)
            continue
        classes, boxes = yolo.read_boxes(path)
        drawn = Drawn(boxes[classes == BOX_CLASSES.index(ROCK)], boxes[classes == BOX_CLASSES.index(SHADOW)])
        rank = (key.light == "off", len(boxes))
        place = (key.position, key.camera, key.azimuth)
        if place not in found or rank > found[place][0]:
            found[place] = (rank, drawn)
    seeds: Seeds = {}
    for (position, camera, azimuth), (_, drawn) in found.items():
        seeds.setdefault((position, camera), {})[azimuth] = drawn
    return seeds


def drawn_camera(seeds: Seeds, position: str) -> Camera | None:
    """The camera whose photos were drawn at a position, left before right; None without seeds."""
    cameras: Iterable[Camera] = ("L", "R")
    return next((camera for camera in cameras if seeds.get((position, camera))), None)
