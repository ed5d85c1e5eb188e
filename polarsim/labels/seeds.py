"""Seed labels and corrections: the only label files that propagation may read."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
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


def read_seeds(
    folder: Path, terrain: int, corrections: Mapping[PhotoKey, Drawn] | None = None, shadow_start_ms: int = 0
) -> Seeds:
    """Every `KEY.txt` of a terrain, one drawing a position, camera and azimuth.

    Parameters
    ----------
    corrections
        What people drew anew: it wins over seeds.
    shadow_start_ms
        Shortest exposure at which people draw shadows: what is shorter and has none says nothing about them, and
        another drawing of the same sight tells.

    Raises
    ------
    FormatError
        A broken label line.
    LabelError
        A file name that is no photo key.
    """
    found: dict[tuple[str, Sight], list[Ranked]] = {}
    drawings = [(key, False, drawn) for key, drawn in _files(folder, terrain).items()]
    drawings += [(key, True, drawn) for key, drawn in (corrections or {}).items()]
    for key, is_correction, drawn in drawings:
        count = len(drawn.rocks) + (0 if drawn.shadows is None else len(drawn.shadows))
        rank = (is_correction, key.light == "off", count)
        silent = key.exposure_ms < shadow_start_ms and (drawn.shadows is None or not len(drawn.shadows))
        told = replace(drawn, shadows=None) if silent else drawn
        found.setdefault((key.position, (key.camera, key.azimuth)), []).append((rank, told))
    seeds: Seeds = {}
    for (position, sight), ranked in sorted(found.items(), key=lambda item: item[0]):
        seeds.setdefault(position, {})[sight] = _best(ranked)
    return seeds


def cameras_first(sights: Sequence[Sight]) -> list[Sight]:
    """Sights of the camera that has most of them first; left before right where they are even."""
    count = {camera: sum(own == camera for own, _ in sights) for camera, _ in sights}
    return sorted(sights, key=lambda sight: (-count[sight[0]], sight))


def _files(folder: Path, terrain: int) -> dict[PhotoKey, Drawn]:
    found = {}
    for path in sorted(folder.glob("*.txt")):
        key = PhotoKey.parse(path.stem)
        if key.terrain != terrain:
            log.warning("%s: no seed of terrain %02d, left out", path, terrain)
            continue
        classes, boxes = yolo.read_boxes(path)
        found[key] = Drawn(boxes[classes == BOX_CLASSES.index(ROCK)], boxes[classes == BOX_CLASSES.index(SHADOW)])
    return found


def _best(ranked: list[Ranked]) -> Drawn:
    """The drawing that wins; its shadows, where it knows of none, from the next that does."""
    in_order = [drawn for _, drawn in sorted(ranked, key=lambda item: item[0], reverse=True)]
    shadows = next((drawn.shadows for drawn in in_order if drawn.shadows is not None), None)
    return replace(in_order[0], shadows=shadows)
