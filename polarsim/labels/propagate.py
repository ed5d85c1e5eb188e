"""Propagation of the seed labels of a terrain to every exposure, light, azimuth and camera of its grid.

`labels_of_terrain` runs the steps in order; the docstring of the package lists the steps with their modules.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import LabelError
from polarsim.formats import tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry.boxes import area
from polarsim.labels.annotator import Annotator
from polarsim.labels.association import TerrainRocks, associate_rocks
from polarsim.labels.bodies import active_lamp
from polarsim.labels.brightness import Brightness, OlatBrightness, PhotoBrightness
from polarsim.labels.fusion import PositionRocks
from polarsim.labels.label import Label
from polarsim.labels.options import LabelsOptions, rig_lamp_ms
from polarsim.labels.seeds import (
    MinExposures,
    PhotoAnnotations,
    choose_seeds,
    drop_mislabelled,
    is_unlit,
    read_corrections,
    read_seeds,
    seed_labels,
)
from polarsim.labels.shadows import PositionShadows
from polarsim.labels.visibility import omitted_in_dark, visible_labels
from polarsim.photo import (
    BOX_CLASSES,
    NO_SUN,
    Azimuth,
    Bracket,
    CameraSide,
    Light,
    PhotoKey,
    Terrain,
    by_bracket,
    terrain_text,
)
from polarsim.photo_format import step_dn
from polarsim.run_files import lamps, rigs
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.scene import read_terrain
from polarsim.site import Site

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PropagationInputs:
    """Input files of the propagation on one terrain."""

    site: Site
    terrain: Terrain
    keys: Sequence[PhotoKey]  # photos to label
    photos: Path  # index of the photos, empty for a source without photos
    inventory: Path
    seeds: Path
    cameras: Path
    meshes: Path
    annotator: Annotator | None = None  # habits of the annotators; None: read `annotator.json`


def propagate_labels(inputs: PropagationInputs, *, boxes: Path, table: Path, options: LabelsOptions) -> None:
    """Write `boxes`/KEY.txt for every key and the label table; a photo without labels gets an empty file.

    Seeds stored under the name of a wrong position are skipped with a warning.
    """
    keys, labels = inputs.keys, labels_of_terrain(inputs, options)
    with writing_folder(boxes) as folder:
        for key in keys:
            classes = np.array([BOX_CLASSES.index(label.kind) for label in labels[key]], int)
            label_boxes = np.array([label.box for label in labels[key]]).reshape(-1, 4)
            yolo.write_boxes(folder / f"{key}.txt", classes, label_boxes, inputs.site.images.size)
    tables.write_parquet(table, tables.label_table([_row(key, label) for key in keys for label in labels[key]]))


def labels_of_terrain(inputs: PropagationInputs, options: LabelsOptions) -> dict[PhotoKey, list[Label]]:
    """Return the labels that `propagate_labels` writes."""
    terrain = inputs.terrain
    if (inventoried := read_inventory(inputs.inventory).terrain) != terrain:
        raise LabelError(
            f"inventory of terrain {terrain_text(inventoried)}, expected {terrain_text(terrain)}", path=inputs.inventory
        )
    _warn_of_gaps(inputs.photos, inputs.keys)
    localised = rigs.read_all_localised(inputs.cameras)
    suns = lamps.read_suns(inputs.cameras, localised, inputs.site, terrain)
    scene = read_terrain(inputs.meshes, terrain, inputs.site.sandbox_of(terrain), cameras=inputs.cameras)
    seeded = read_seeds(inputs.seeds, terrain, inputs.site.images.size)
    corrected = read_corrections(options.corrections, inputs.site, terrain)
    if unknown := [key for key in options.excluded(terrain) if key not in {*seeded, *corrected}]:
        raise LabelError(
            f"labels.excluded_annotations: {unknown[0]} is neither a seed nor a correction", path=inputs.seeds
        )
    corrections = _left(corrected, options)
    drawings = _left(drop_mislabelled(seeded, scene, localised), options)
    by_people = {**drawings, **corrections}
    usual_ms = inputs.site.usual_exposure_ms
    min_exposures = MinExposures.of(by_people, options.shadow_start(terrain, usual_ms), rig_lamp_ms(inputs.site))
    terrain_rocks = associate_rocks(
        scene, localised, suns, inputs.site.rig_lamp, choose_seeds(drawings, corrections, min_exposures)
    )
    return grid_labels(terrain_rocks, inputs, options, min_exposures, drawings, corrections)


def _left(drawings: PhotoAnnotations, options: LabelsOptions) -> PhotoAnnotations:
    """Return the annotations without the excluded photos."""
    return {key: annotated for key, annotated in drawings.items() if str(key) not in options.excluded_annotations}


def grid_labels(
    terrain_rocks: TerrainRocks,
    inputs: PropagationInputs,
    options: LabelsOptions,
    min_exposures: MinExposures,
    drawings: PhotoAnnotations,
    corrections: PhotoAnnotations,
) -> dict[PhotoKey, list[Label]]:
    """Return the labels of every key. Results shared by several photos are computed once.

    With `visibility: annotator`, only photos without any lamp are read. An annotated photo keeps its boxes unchanged.
    Propagated boxes are added to seeds, but not to corrections.
    """
    keys, photos = inputs.keys, PhotoBrightness(inputs.photos, inputs.terrain, step_dn(inputs.site.images))
    by_people = options.visibility == "annotator"
    readable, olat_images = (None, None) if by_people else (photos, OlatBrightness(terrain_rocks, inputs.site))
    positions = {
        position: PositionLabels(terrain_rocks, position, options, readable, inputs.annotator)
        for position in terrain_rocks.localised
    }
    for position in sorted({key.position for key in keys} - set(positions)):
        log.warning("position %s: no camera pose, its photos get no labels", position)
    for position in terrain_rocks.unverified:
        effect = "labels are moved in the image only" if position in terrain_rocks.seeds else "no seed, no labels"
        log.warning("position %s: unverified camera pose: %s", position, effect)
    labels: dict[PhotoKey, list[Label]] = {key: [] for key in keys}
    for bracket, members in by_bracket(key for key in keys if key.position in positions).items():
        _, position, light, azimuth, camera = bracket
        shared, width = positions[position].labels(camera, light, azimuth), inputs.site.images.width
        brightness = _first_known(bracket, photos if is_unlit(light, azimuth) else readable, olat_images)
        for key in members:
            if key in corrections:
                labels[key] = seed_labels(corrections[key], shared, width)
                continue
            labels[key] = visible_labels(shared, key, brightness, min_exposures, options)
            if key in drawings:
                added = [label for label in labels[key] if label.source != "seed"]
                labels[key] = seed_labels(drawings[key], shared, width) + added
    return labels


def _first_known(bracket: Bracket, *sources: PhotoBrightness | OlatBrightness | None) -> Brightness | None:
    candidates = (source.brightness(bracket) for source in sources if source is not None)
    return next((brightness for brightness in candidates if brightness is not None), None)


def _warn_of_gaps(photos: Path, keys: Sequence[PhotoKey]) -> None:
    """Log missing photos. A source without any photo is not a gap, since labels can be propagated without photos."""
    available = set(tables.read_parquet(photos, ["key"])["key"])
    missing = [str(key) for key in keys if str(key) not in available]
    if available and missing:
        log.warning("%d of %d photos are missing but get labels: %s ...", len(missing), len(keys), missing[0])


def _row(key: PhotoKey, label: Label) -> dict[str, object]:
    edges = dict(zip(("x0", "y0", "x1", "y1"), (float(edge) for edge in label.box), strict=True))
    named = {"kind": label.kind, "rock": label.rock, "source": label.source, "confidence": label.confidence}
    return {**tables.key_columns(key), **named, **edges}


class PositionLabels:
    """Labels of one position, from the contrast in photos if `photos` is given, else from habits of annotators."""

    def __init__(
        self,
        terrain_rocks: TerrainRocks,
        position: str,
        options: LabelsOptions,
        photos: PhotoBrightness | None = None,
        annotator: Annotator | None = None,
    ) -> None:
        self.position, self.photos, self.options = position, photos, options
        self.rocks = PositionRocks(terrain_rocks, position, options, annotator)
        self.shadows = PositionShadows(self.rocks, options)
        self._cache: dict[tuple[CameraSide, Light, Azimuth], list[Label]] = {}

    def labels(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> list[Label]:
        """Return the labels of the longest exposure of a camera under a lamp.

        With photos, the labels include visible rocks and shadows that were not annotated.
        """
        lamps: tuple[CameraSide, Light, Azimuth] = (camera, light if azimuth == NO_SUN else "off", azimuth)
        if lamps not in self._cache:  # a Sun lamp outshines the rover light
            self._cache[lamps] = self._labels(camera, light, azimuth)
        return self._cache[lamps]

    def _labels(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> list[Label]:
        brightness = self._brightness(camera, light, azimuth)
        labels = self.rocks.labels(camera, azimuth)
        if self.options.visibility == "annotator" and azimuth not in self.rocks.azimuths:
            world, annotated = self.rocks.world, self.rocks.annotated_azimuths
            labels = [
                label for label in labels if not omitted_in_dark(world, label.rock, azimuth, annotated(label.rock))
            ]
        if brightness is not None:
            labels += self.rocks.unannotated(camera, labels)
        if active_lamp(self.rocks.world, self.rocks.localised, light, azimuth) is not None:
            labels += self.shadows.labels(camera, light, azimuth, labels, brightness)
        return [label for label in labels if area(label.box) > 0]

    def _brightness(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> Brightness | None:
        """Return the brightness of the photos; under a Sun lamp preferably without rover light, which fills shadows."""
        if self.photos is None:
            return None
        lights: tuple[Light, ...] = (light,) if azimuth == NO_SUN else ("off", "on")
        brackets = ((self.photos.terrain, self.position, rover_light, azimuth, camera) for rover_light in lights)
        candidates = (self.photos.brightness(bracket) for bracket in brackets)
        return next((brightness for brightness in candidates if brightness is not None), None)
