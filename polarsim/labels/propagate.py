"""Seed boxes of a terrain, carried to every exposure, light, azimuth and camera of its grid."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.errors import LabelError
from polarsim.formats import lamps, rigs, tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.formats.inventory import read_inventory
from polarsim.formats.scene import read_terrain
from polarsim.labels.known import Known, gather
from polarsim.labels.options import LabelsOptions
from polarsim.labels.position import Label, PositionLabels
from polarsim.labels.seeds import read_seeds
from polarsim.photo import BOX_CLASSES, SHADOW, Azimuth, Camera, Light, PhotoKey

log = logging.getLogger(__name__)


def at_exposure(labels: list[Label], key: PhotoKey, options: LabelsOptions) -> list[Label]:
    """The labels that a photo's exposure lets a person see: rocks from the start, shadows from their own start on."""
    if key.azimuth == "no":
        return labels if key.exposure_ms >= options.no_sun_start_ms else []
    dark = key.exposure_ms < options.shadow_start(key.terrain)
    return [label for label in labels if not (dark and label.kind == SHADOW)]


def propagate_labels(
    *,
    terrain: int,
    keys: Sequence[PhotoKey],
    photos: Path,
    inventory: Path,
    seeds: Path,
    cameras: Path,
    meshes: Path,
    boxes: Path,
    table: Path,
    options: LabelsOptions,
) -> None:
    """Write `boxes`/KEY.txt for every key and the label table; photos with nothing to see get an empty file.

    Raises
    ------
    LabelError
        The inventory is another terrain's.
    FormatError
        A broken seed, camera or mesh file.
    """
    if (found := read_inventory(inventory).terrain) != terrain:
        raise LabelError(f"{inventory}: inventory of terrain {found:02d}, expected {terrain:02d}")
    _warn_of_gaps(photos, keys)
    placed = rigs.read_all_placed(cameras)
    suns = lamps.read_suns(cameras, placed)
    known = gather(read_terrain(meshes, terrain), placed, suns, read_seeds(seeds, terrain), options)
    labels = grid_labels(known, keys, options)
    with writing_folder(boxes) as folder:
        for key in keys:
            classes = np.array([BOX_CLASSES.index(label.kind) for label in labels[key]], int)
            drawn = np.array([label.box for label in labels[key]]).reshape(-1, 4)
            yolo.write_boxes(folder / f"{key}.txt", classes, drawn)
    tables.write_parquet(table, tables.label_table([_row(key, label) for key in keys for label in labels[key]]))


def grid_labels(known: Known, keys: Sequence[PhotoKey], options: LabelsOptions) -> dict[PhotoKey, list[Label]]:
    """Labels of every key; what photos share is computed once."""
    positions = {position: PositionLabels(known, position, options) for position in known.placed}
    for position in sorted({key.position for key in keys} - set(positions)):
        log.warning("position %s: no camera pose, its photos get no labels", position)
    sets: dict[tuple[str, Camera, Light, Azimuth], list[Label]] = {}
    labels: dict[PhotoKey, list[Label]] = {}
    for key in keys:
        if key.position not in positions:
            labels[key] = []
            continue
        photo_set = (key.position, key.camera, key.light, key.azimuth)
        if photo_set not in sets:
            sets[photo_set] = positions[key.position].labels(key.camera, key.light, key.azimuth)
        labels[key] = at_exposure(sets[photo_set], key, options)
    return labels


def _warn_of_gaps(photos: Path, keys: Sequence[PhotoKey]) -> None:
    """A source without any photo is no gap: labels alone are wanted."""
    there = set(tables.read_parquet(photos, ["key"])["key"])
    missing = [str(key) for key in keys if str(key) not in there]
    if there and missing:
        log.warning("%d of %d photos are missing, labelled all the same: %s ...", len(missing), len(keys), missing[0])


def _row(key: PhotoKey, label: Label) -> dict[str, object]:
    edges = dict(zip(("x0", "y0", "x1", "y1"), (float(edge) for edge in label.box), strict=True))
    named = {"kind": label.kind, "rock": label.rock, "source": label.source, "confidence": label.confidence}
    return {**tables.key_columns(key), **named, **edges}
