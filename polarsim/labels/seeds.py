"""Seed labels and corrections: the only label files that propagation may read."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from polarsim.formats import yolo
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, Azimuth, Camera, PhotoKey

log = logging.getLogger(__name__)

Sight = tuple[Camera, Azimuth]  # what one drawing of a position shows
Ranked = tuple[tuple[bool, bool, int], "Drawn"]  # a correction, light off, number of boxes: the highest wins


@dataclass(frozen=True)
class Drawn:
    """What a person drew in one photo: boxes (n, 4) in pixels. Shadows: None where the photo is too dark to tell."""

    rocks: np.ndarray
    shadows: np.ndarray | None


Seeds = dict[str, dict[Sight, Drawn]]  # by position


def read_seeds(folder: Path, terrain: int, corrections: Sequence[Path] = (), shadow_start_ms: int = 0) -> Seeds:
    """Every `KEY.txt` of a terrain, one drawing a position, camera and azimuth.

    Parameters
    ----------
    corrections
        Files that a person edited: they win over seeds. Where one shows no shadow at an exposure at which nobody
        draws any, it has the seed's.
    shadow_start_ms
        Shortest exposure at which people draw shadows: what is shorter and has none says nothing about them.

    Raises
    ------
    FormatError
        A broken label line.
    LabelError
        A file name that is no photo key.
    """
    found: dict[tuple[str, Sight], list[Ranked]] = {}
    for path, corrected in [*((p, False) for p in sorted(folder.glob("*.txt"))), *((p, True) for p in corrections)]:
        key = PhotoKey.parse(path.stem)
        if key.terrain != terrain:
            log.warning("%s: no seed of terrain %02d, left out", path, terrain)
            continue
        drawn = _read(path, key.exposure_ms < shadow_start_ms)
        count = len(drawn.rocks) + (0 if drawn.shadows is None else len(drawn.shadows))
        rank = (corrected, key.light == "off", count)
        found.setdefault((key.position, (key.camera, key.azimuth)), []).append((rank, drawn))
    seeds: Seeds = {}
    for (position, sight), ranked in sorted(found.items(), key=lambda item: item[0]):
        seeds.setdefault(position, {})[sight] = _best(ranked)
    return seeds


def cameras_first(sights: Sequence[Sight]) -> list[Sight]:
    """Sights of the camera that has most of them first; left before right where they are even."""
    count = {camera: sum(own == camera for own, _ in sights) for camera, _ in sights}
    return sorted(sights, key=lambda sight: (-count[sight[0]], sight))


def _read(path: Path, dark: bool) -> Drawn:
    classes, boxes = yolo.read_boxes(path)
    shadows = boxes[classes == BOX_CLASSES.index(SHADOW)]
    return Drawn(boxes[classes == BOX_CLASSES.index(ROCK)], None if dark and not len(shadows) else shadows)


def _best(ranked: list[Ranked]) -> Drawn:
    """The drawing that wins; its shadows, where it knows of none, from the next that does."""
    in_order = [drawn for _, drawn in sorted(ranked, key=lambda item: item[0], reverse=True)]
    shadows = next((drawn.shadows for drawn in in_order if drawn.shadows is not None), None)
    return replace(in_order[0], shadows=shadows)
