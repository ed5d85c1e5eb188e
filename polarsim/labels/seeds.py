"""Seed labels and corrections: the only label files that propagation may read."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from polarsim.formats import yolo
from polarsim.labels.photos import Bracket
from polarsim.labels.shadow_starts import ShadowStarts
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, SUNS, Azimuth, CameraSide, PhotoKey

log = logging.getLogger(__name__)

Sight = tuple[CameraSide, Azimuth]  # what one drawing of a position shows
Ranked = tuple[tuple[bool, bool, int], "Annotated"]  # a correction, light off, number of boxes: the highest wins


@dataclass(frozen=True)
class Annotated:
    """What a person drew in one photo: boxes (n, 4) in pixels. Shadows: None where the photo is too dark to tell."""

    rocks: np.ndarray
    shadows: np.ndarray | None

    @classmethod
    def of(cls, classes: np.ndarray, boxes: np.ndarray) -> Annotated:
        """Boxes (n, 4) shared out by their class numbers (n,)."""
        return cls(boxes[classes == BOX_CLASSES.index(ROCK)], boxes[classes == BOX_CLASSES.index(SHADOW)])


Drawings = Mapping[PhotoKey, Annotated]
Seeds = dict[str, dict[Sight, Annotated]]  # by position


def read_drawings(folder: Path, terrain: int) -> Drawings:
    """Every `KEY.txt` of a terrain.

    Raises
    ------
    FormatError
        A broken label line.
    LabelError
        A file name that is no photo key.
    """
    found = {}
    for path in sorted(folder.glob("*.txt")):
        key = PhotoKey.parse(path.stem)
        if key.terrain != terrain:
            log.warning("%s: no seed of terrain %02d, left out", path, terrain)
            continue
        found[key] = Annotated.of(*yolo.read_boxes(path))
    return found


def shadow_starts(drawings: Drawings, usual_ms: int) -> ShadowStarts:
    """Where shadows begin under Sun lamps: at `usual_ms`, or where somebody drew some at a shorter exposure."""
    annotated_ms: dict[Bracket, int] = {}
    for key, annotated in drawings.items():
        if key.azimuth in SUNS and annotated.shadows is not None and len(annotated.shadows):
            bracket = (key.position, key.camera, key.light, key.azimuth)
            annotated_ms[bracket] = min(annotated_ms.get(bracket, usual_ms), key.exposure_ms)
    return ShadowStarts(usual_ms, annotated_ms)


def choose_seeds(drawings: Drawings, corrections: Drawings, starts: ShadowStarts) -> Seeds:
    """One drawing a position, camera and azimuth.

    Parameters
    ----------
    corrections
        What people drew anew: it wins over seeds.
    starts
        Shortest exposures at which people draw shadows: what is shorter and has none says nothing about them, and
        another drawing of the same sight tells.
    """
    found: dict[tuple[str, Sight], list[Ranked]] = {}
    both = [
        *((key, False, annotated) for key, annotated in drawings.items()),
        *((k, True, d) for k, d in corrections.items()),
    ]
    for key, is_correction, annotated in both:
        count = len(annotated.rocks) + (0 if annotated.shadows is None else len(annotated.shadows))
        rank = (is_correction, key.light == "off", count)
        silent = key.exposure_ms < starts.of(key) and (annotated.shadows is None or not len(annotated.shadows))
        told = replace(annotated, shadows=None) if silent else annotated
        found.setdefault((key.position, (key.camera, key.azimuth)), []).append((rank, told))
    seeds: Seeds = {}
    for (position, sight), ranked in sorted(found.items(), key=lambda item: item[0]):
        seeds.setdefault(position, {})[sight] = _best(ranked)
    return seeds


def cameras_first(sights: Sequence[Sight]) -> list[Sight]:
    """Sights of the camera that has most of them first; left before right where they are even."""
    count = {camera: sum(own == camera for own, _ in sights) for camera, _ in sights}
    return sorted(sights, key=lambda sight: (-count[sight[0]], sight))


def _best(ranked: list[Ranked]) -> Annotated:
    """The drawing that wins; its shadows, where it knows of none, from the next that does."""
    in_order = [annotated for _, annotated in sorted(ranked, key=lambda item: item[0], reverse=True)]
    shadows = next((annotated.shadows for annotated in in_order if annotated.shadows is not None), None)
    return replace(in_order[0], shadows=shadows)
