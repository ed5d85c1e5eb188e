"""Human annotations: seed labels and corrections, the only label files that propagation reads.

The annotations also determine the minimum exposures of shadows under Sun lamps and of rocks without any lamp.
"""

from __future__ import annotations

import logging
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import yolo
from polarsim.formats.coco import read_coco
from polarsim.formats.release import read_annotated_boxes
from polarsim.geometry.boxes import iou, match_by_iou
from polarsim.geometry.consensus import consensus_boxes, warn_mislabelled_positions
from polarsim.labels.label import Label, make_label
from polarsim.photo import (
    BOX_CLASSES,
    NO_ROCK,
    NO_SUN,
    ROCK,
    SHADOW,
    Azimuth,
    Bracket,
    CameraSide,
    Light,
    PhotoKey,
    Terrain,
    terrain_text,
)
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.site import Site

log = logging.getLogger(__name__)

AnnotationKey = tuple[CameraSide, Azimuth]  # annotation of a position, by camera and lamp
Ranked = tuple[
    tuple[bool, bool, int], "AnnotatedBoxes"
]  # (is a correction, rover light off, number of boxes), annotation
MIN_VOTES = 3  # minimum number of annotated brackets for a median, to limit the effect of outliers
SAME_LABEL_IOU = 0.1  # minimum IoU of an annotated and a propagated box to copy the rock id


@dataclass(frozen=True)
class AnnotatedBoxes:
    """Annotated boxes (n, 4) of one photo, px. `shadows` is None if the photo is too dark to show shadows."""

    rocks: np.ndarray
    shadows: np.ndarray | None

    @classmethod
    def of(cls, classes: np.ndarray, boxes: np.ndarray) -> AnnotatedBoxes:
        """Split boxes (n, 4) by class number (n,)."""
        return cls(boxes[classes == BOX_CLASSES.index(ROCK)], boxes[classes == BOX_CLASSES.index(SHADOW)])


PhotoAnnotations = Mapping[PhotoKey, AnnotatedBoxes]
Seeds = dict[str, dict[AnnotationKey, AnnotatedBoxes]]  # by position


def read_seeds(folder: Path, terrain: Terrain, size: tuple[int, int]) -> PhotoAnnotations:
    """Read every `KEY.txt` of a terrain; photos have a size, px."""
    drawings = {}
    for path in sorted(folder.glob("*.txt")):
        key = PhotoKey.parse(path.stem)
        if key.terrain != terrain:
            log.warning("%s: skipped, terrain %s expected", path, terrain_text(terrain))
            continue
        drawings[key] = AnnotatedBoxes.of(*yolo.read_boxes(path, size))
    return drawings


@dataclass(frozen=True)
class MinExposures:
    """Minimum exposures at which annotators draw shadows under Sun lamps and rocks without any lamp, ms.

    Exposures without a lamp are stored by position, because stray light differs between positions.
    """

    usual_ms: int  # of shadows, without annotated shadows
    rig_lamp_ms: int  # of all labels if only the rig's lamp is on
    shadows_ms: Mapping[Bracket, int] = field(default_factory=dict)
    unlit_ms: Mapping[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, drawings: PhotoAnnotations, usual_ms: int, rig_lamp_ms: int) -> MinExposures:
        """Return the shortest annotated exposures, for shadows at most `usual_ms`."""
        shadows_ms: dict[Bracket, int] = {}
        unlit_ms: dict[str, int] = {}
        for key, annotated in drawings.items():
            if key.has_sun and annotated.shadows is not None and len(annotated.shadows):
                shadows_ms[key.bracket] = min(shadows_ms.get(key.bracket, usual_ms), key.exposure_ms)
            if is_unlit(key.light, key.azimuth) and len(annotated.rocks):
                unlit_ms[key.position] = min(unlit_ms.get(key.position, key.exposure_ms), key.exposure_ms)
        return cls(usual_ms, rig_lamp_ms, shadows_ms, unlit_ms)

    def of_shadows(self, key: PhotoKey) -> int:
        """Return the minimum for the exposure bracket of a photo, else the median of the position, else of the terrain.

        With left seeds of six released terrains, this disagrees with the annotators on the presence of shadows in 45 of
        1,956 photos under a Sun lamp; the median of position and azimuth in 53; the minimum of the terrain in 143.
        """
        if key.bracket in self.shadows_ms:
            return self.shadows_ms[key.bracket]
        of_position = [exposure for (_, position, *_), exposure in self.shadows_ms.items() if position == key.position]
        for votes in (of_position, list(self.shadows_ms.values())):
            if len(votes) >= MIN_VOTES:
                return statistics.median_high(votes)
        return self.usual_ms

    def has_unlit_labels(self, key: PhotoKey) -> bool:
        """Return whether an unlit photo has labels; False if the position has no unlit annotation."""
        return key.exposure_ms >= self.unlit_ms.get(key.position, math.inf)


def choose_seeds(drawings: PhotoAnnotations, corrections: PhotoAnnotations, min_exposures: MinExposures) -> Seeds:
    """Choose an annotation per position, camera and azimuth.

    `corrections`: corrected annotations; preferred to seeds.
    `min_exposures`: minimum exposures of shadow annotations. If an annotation of a shorter exposure has no shadows, the
    shadows are taken from another annotation of the same camera and lamp.
    """
    candidates: dict[tuple[str, AnnotationKey], list[Ranked]] = {}
    entries = [
        *((key, False, annotated) for key, annotated in drawings.items()),
        *((k, True, d) for k, d in corrections.items()),
    ]
    for key, is_correction, annotated in entries:
        count = len(annotated.rocks) + (0 if annotated.shadows is None else len(annotated.shadows))
        rank = (is_correction, key.light == "off", count)
        silent = key.exposure_ms < min_exposures.of_shadows(key) and (
            annotated.shadows is None or not len(annotated.shadows)
        )
        seed = replace(annotated, shadows=None) if silent else annotated
        candidates.setdefault((key.position, (key.camera, key.azimuth)), []).append((rank, seed))
    seeds: Seeds = {}
    for (position, drawing), ranked in sorted(candidates.items(), key=lambda item: item[0]):
        seeds.setdefault(position, {})[drawing] = _best(ranked)
    return seeds


def sort_by_camera(drawings: Sequence[AnnotationKey]) -> list[AnnotationKey]:
    """Sort annotations: the camera with more annotations first, the left camera first in a tie."""
    count = {camera: sum(side == camera for side, _ in drawings) for camera, _ in drawings}
    return sorted(drawings, key=lambda drawing: (-count[drawing[0]], drawing))


def _best(ranked: list[Ranked]) -> AnnotatedBoxes:
    """Return the annotation of the highest rank. Missing shadows are taken from the next annotation that has them."""
    in_order = [annotated for _, annotated in sorted(ranked, key=lambda item: item[0], reverse=True)]
    shadows = next((annotated.shadows for annotated in in_order if annotated.shadows is not None), None)
    return replace(in_order[0], shadows=shadows)


def is_unlit(light: Light, azimuth: Azimuth) -> bool:
    """Return whether both the Sun lamps and the rover light are off."""
    return azimuth == NO_SUN and light == "off"


def drop_mislabelled(
    drawings: PhotoAnnotations, terrain: TerrainMesh, localised: Mapping[str, LocalisedRig]
) -> PhotoAnnotations:
    """Return the annotations without mislabelled positions, which are logged as warnings.

    A position is mislabelled if the meshes do not project onto the rocks of its left photos. Positions with unverified
    poses are not checked.
    """
    boxes: dict[str, list[np.ndarray]] = {}
    for key, annotated in drawings.items():
        if key.camera == "L":
            boxes.setdefault(key.position, []).append(annotated.rocks)
    agreed = {position: consensus_boxes(position_boxes) for position, position_boxes in boxes.items()}
    cameras = {position: rig.camera("L") for position, rig in localised.items() if not rig.unproven}
    names = warn_mislabelled_positions(agreed, cameras, [terrain.rock_vertices(rock) for rock in terrain.rocks])
    return {key: annotated for key, annotated in drawings.items() if key.position not in names}


def read_corrections(folder: Path | None, site: Site, terrain: Terrain) -> dict[PhotoKey, AnnotatedBoxes]:
    """Return the corrected photos of a terrain, see `read_all_corrections`; empty without a folder."""
    corrections = {} if folder is None else read_all_corrections(folder, site)
    return {key: annotated for key, annotated in corrections.items() if key.terrain == terrain}


def read_all_corrections(folder: Path, site: Site) -> dict[PhotoKey, AnnotatedBoxes]:
    """Read the corrected boxes of each photo of a site from `KEY.txt` and COCO files (`*.json`)."""
    corrections = read_annotated_boxes(folder, site.images.size, site.key)
    for path in sorted(Path(folder).rglob("*.json")):
        for key, annotated in read_coco(path, site.images.size, site.key_of_picture).items():
            if key in corrections:
                raise FormatError(f"{key} is corrected in two files of {folder}; delete a file", path=path)
            classes = np.array([BOX_CLASSES.index(annotation.kind) for annotation in annotated], int)
            corrections[key] = classes, np.array([annotation.box for annotation in annotated]).reshape(-1, 4)
    return {key: AnnotatedBoxes.of(*corrections[key]) for key in sorted(corrections)}


def seed_labels(annotated: AnnotatedBoxes, labels: Sequence[Label], photo_width: int) -> list[Label]:
    """Return annotated boxes as seed labels, with rock ids of the overlapping propagated labels of the bracket."""
    seeds = []
    for kind, boxes in ((ROCK, annotated.rocks), (SHADOW, annotated.shadows)):
        if boxes is None:
            continue
        candidates = [label for label in labels if label.kind == kind]
        candidate_boxes = np.array([label.box for label in candidates]).reshape(-1, 4)
        rocks = matched_rocks(boxes, candidate_boxes, np.array([label.rock for label in candidates], int))
        seeds += [make_label(kind, rock, "seed", box, photo_width) for rock, box in zip(rocks, boxes, strict=True)]
    return seeds


def matched_rocks(boxes: np.ndarray, labels: np.ndarray, rocks: np.ndarray) -> np.ndarray:
    """Match boxes (n, 4) with labels (m, 4) of rocks (m,) one to one; return rock ids (n,), `NO_ROCK` if unmatched."""
    rows, columns = match_by_iou(iou(boxes, labels), SAME_LABEL_IOU)
    matched = np.full(len(boxes), NO_ROCK)
    matched[rows] = rocks[columns]
    return matched
