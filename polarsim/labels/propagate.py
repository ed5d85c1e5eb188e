"""Seed boxes of a terrain, propagated to every exposure, light, azimuth and camera of its grid."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from polarsim.errors import LabelError
from polarsim.formats import tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry.boxes import area
from polarsim.labels.association import Known, gather
from polarsim.labels.brightness import Bracket, Brightness, Photos, contrast
from polarsim.labels.casting import lamp
from polarsim.labels.fusion import PositionRocks
from polarsim.labels.label import Label
from polarsim.labels.light import OlatLight
from polarsim.labels.options import LabelsOptions
from polarsim.labels.seeds import (
    Drawings,
    ShadowStarts,
    UnlitStarts,
    as_annotated,
    choose_seeds,
    is_unlit,
    read_corrections,
    read_drawings,
    shadow_starts,
    without_strangers,
)
from polarsim.labels.shadows import PositionShadows
from polarsim.labels.visibility import hidden_by_dark
from polarsim.photo import BOX_CLASSES, SHADOW, Azimuth, CameraSide, Light, PhotoKey
from polarsim.run_files import lamps, rigs
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.scene import read_terrain

log = logging.getLogger(__name__)

NOTHING_ANNOTATED: Drawings = MappingProxyType({})


@dataclass(frozen=True)
class Starts:
    """From which exposures on people see what, by what they drew: shadows under Sun lamps, rocks without a lamp."""

    shadows: ShadowStarts
    unlit: UnlitStarts


def visible(
    labels: list[Label], key: PhotoKey, brightness: Brightness | None, starts: Starts, options: LabelsOptions
) -> list[Label]:
    """The labels of an exposure bracket that one of its photos shows; without brightness, as people draw them."""
    if brightness is None:
        return at_exposure(labels, key, starts, options)
    return [label for label in labels if stands_out(label, brightness, key.exposure_ms, options)]


def stands_out(label: Label, brightness: Brightness, exposure_ms: int, options: LabelsOptions) -> bool:
    """Whether a person can tell a label from its surround at an exposure."""
    found = contrast(brightness, label.box, exposure_ms)
    return found.noises >= options.min_contrast and found.dn >= options.min_contrast_dn


def at_exposure(labels: list[Label], key: PhotoKey, starts: Starts, options: LabelsOptions) -> list[Label]:
    """The labels that a photo's exposure lets a person see.

    Under a Sun lamp rocks at once and shadows from their own start on, under the rover light alone all from
    `no_sun_start_ms` on. Without any lamp none, but from the exposure on at which people drew the position's own.
    """
    if is_unlit(key.light, key.azimuth):
        return labels if starts.unlit.shown(key) else []
    if key.azimuth == "no":
        return labels if key.exposure_ms >= options.no_sun_start_ms else []
    dark = key.exposure_ms < starts.shadows.of(key)
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

    Seeds that lie under another position's name are left out with a warning.

    Raises
    ------
    LabelError
        The inventory is another terrain's; or an excluded photo is neither a seed nor a correction.
    FormatError
        A broken seed, camera or mesh file.
    """
    labels = labels_of_terrain(
        terrain=terrain,
        keys=keys,
        photos=photos,
        inventory=inventory,
        seeds=seeds,
        cameras=cameras,
        meshes=meshes,
        options=options,
    )
    with writing_folder(boxes) as folder:
        for key in keys:
            classes = np.array([BOX_CLASSES.index(label.kind) for label in labels[key]], int)
            own_boxes = np.array([label.box for label in labels[key]]).reshape(-1, 4)
            yolo.write_boxes(folder / f"{key}.txt", classes, own_boxes)
    tables.write_parquet(table, tables.label_table([_row(key, label) for key in keys for label in labels[key]]))


def labels_of_terrain(
    *,
    terrain: int,
    keys: Sequence[PhotoKey],
    photos: Path,
    inventory: Path,
    seeds: Path,
    cameras: Path,
    meshes: Path,
    options: LabelsOptions,
) -> dict[PhotoKey, list[Label]]:
    """What `propagate_labels` writes; arguments and errors are its."""
    options = options.of(terrain)
    if (found := read_inventory(inventory).terrain) != terrain:
        raise LabelError(f"inventory of terrain {found:02d}, expected {terrain:02d}", path=inventory)
    _warn_of_gaps(photos, keys)
    localised = rigs.read_all_localised(cameras)
    suns = lamps.read_suns(cameras, localised)
    corrected = read_corrections(options.corrections, terrain)
    corrections = _left(corrected, options)
    scene = read_terrain(meshes, terrain)
    seeded = read_drawings(seeds, terrain)
    if unknown := [key for key in options.excluded(terrain) if key not in {*seeded, *corrected}]:
        raise LabelError(f"labels.taken_back: {unknown[0]} is neither a seed nor a correction", path=seeds)
    drawings = _left(without_strangers(seeded, scene, localised), options)
    by_people = {**drawings, **corrections}
    starts = Starts(shadow_starts(by_people, options.shadow_start(terrain)), UnlitStarts.of(by_people))
    chosen = choose_seeds(drawings, corrections, starts.shadows)
    known = gather(scene, localised, suns, chosen, options)
    return grid_labels(known, keys, options, starts, Photos(photos, terrain), drawings, corrections)


def _left(drawings: Drawings, options: LabelsOptions) -> Drawings:
    """Drawings without those that are taken back."""
    return {key: annotated for key, annotated in drawings.items() if str(key) not in options.taken_back}


def grid_labels(
    known: Known,
    keys: Sequence[PhotoKey],
    options: LabelsOptions,
    starts: Starts,
    photos: Photos | None = None,
    drawings: Drawings = NOTHING_ANNOTATED,
    corrections: Drawings = NOTHING_ANNOTATED,
) -> dict[PhotoKey, list[Label]]:
    """Labels of every key; what photos share is computed once.

    Where the annotator model decide what is seen, photos that no lamp lights are looked at all the same, if they are
    there. A photo that was annotated itself keeps its boxes as they are; others may be added, but not to a correction.
    """
    by_people = options.visibility == "annotator"
    readable = None if by_people else photos
    olat_images = None if by_people else OlatLight(known)
    positions = {position: PositionLabels(known, position, options, readable) for position in known.localised}
    for position in sorted({key.position for key in keys} - set(positions)):
        log.warning("position %s: no camera pose, its photos get no labels", position)
    for position in known.apart:
        seeded = "its labels stay in the image" if position in known.seeds else "no labels, for it has no seed"
        log.warning("position %s: nothing proves the pose of its cameras: %s", position, seeded)
    labels: dict[PhotoKey, list[Label]] = {key: [] for key in keys}
    sets: dict[Bracket, list[PhotoKey]] = {}
    for key in keys:
        if key.position in positions:
            sets.setdefault((key.position, key.camera, key.light, key.azimuth), []).append(key)
    for bracket, members in sorted(sets.items(), key=lambda item: item[0]):
        position, camera, light, azimuth = bracket
        shared = positions[position].labels(camera, light, azimuth)
        brightness = _first_known(bracket, photos if is_unlit(light, azimuth) else readable, olat_images)
        for key in members:
            if key in corrections:
                labels[key] = as_annotated(corrections[key], shared)
                continue
            labels[key] = visible(shared, key, brightness, starts, options)
            if key in drawings:
                added = [label for label in labels[key] if label.source != "seed"]
                labels[key] = as_annotated(drawings[key], shared) + added
    return labels


def _first_known(bracket: Bracket, *sources: Photos | OlatLight | None) -> Brightness | None:
    found = (source.brightness(bracket) for source in sources if source is not None)
    return next((brightness for brightness in found if brightness is not None), None)


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


class PositionLabels:
    """Labels of one position; without photos as people draw them, with photos as these show things."""

    def __init__(self, known: Known, position: str, options: LabelsOptions, photos: Photos | None = None) -> None:
        self.position, self.photos, self.options = position, photos, options
        self.rocks = PositionRocks(known, position, options)
        self.shadows = PositionShadows(self.rocks, options)
        self._known: dict[tuple[CameraSide, Light, Azimuth], list[Label]] = {}

    def labels(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> list[Label]:
        """What the photos of a camera under a lamp show, longest exposure.

        Where there are photos to tell what is seen, also what was not annotated: people forget, and draw by azimuth.
        """
        lamps: tuple[CameraSide, Light, Azimuth] = (camera, light if azimuth == "no" else "off", azimuth)
        if lamps not in self._known:  # a Sun lamp outshines the rover light
            self._known[lamps] = self._labels(camera, light, azimuth)
        return self._known[lamps]

    def _labels(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> list[Label]:
        brightness = self._brightness(camera, light, azimuth)
        labels = self.rocks.labels(camera, azimuth)
        if self.options.visibility == "annotator" and azimuth not in self.rocks.azimuths:
            own, annotated = self.rocks.world, self.rocks.annotated_azimuths
            labels = [one for one in labels if not hidden_by_dark(own, one.rock, azimuth, annotated(one.rock))]
        if brightness is not None:
            labels += self.rocks.unannotated(camera, labels)
        if lamp(self.rocks.world, self.rocks.localised, light, azimuth) is not None:
            labels += self.shadows.labels(camera, light, azimuth, labels, brightness)
        return [label for label in labels if area(label.box) > 0]

    def _brightness(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> Brightness | None:
        """What photos show under a Sun lamp: without rover light where there are such, for it brightens shadows."""
        if self.photos is None:
            return None
        lights: tuple[Light, ...] = (light,) if azimuth == "no" else ("off", "on")
        sets = (self.photos.brightness((self.position, camera, own, azimuth)) for own in lights)
        return next((brightness for brightness in sets if brightness is not None), None)
