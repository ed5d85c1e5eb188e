"""Evaluation of the masks of rocks and shadows against annotated polygons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from polarsim.formats import release, yolo
from polarsim.formats.coco import Annotation, read_coco
from polarsim.geometry.boxes import box_of_mask, iou
from polarsim.geometry.polygons import rasterised
from polarsim.photo import BOX_CLASSES, HEIGHT, POLYGON_CLASSES, WIDTH, CameraSide, PhotoKey
from polarsim.scoring.labels import box_metrics, read_sound_boxes
from polarsim.scoring.metrics import write_metrics
from polarsim.scoring.options import ScoringOptions
from polarsim.scoring.score import MatchCounts, PhotoLabels, count_boxes, count_overlaps, read_sound

TASKS: dict[CameraSide, str] = {"L": "seeds' camera", "R": "Left to Right"}

Polygons = list[tuple[int, np.ndarray]]  # class number, ring (n, 2) in pixels


@dataclass(frozen=True)
class PlacedMask:
    """Mask (h, w) with the first pixel at a corner (x, y) in the photo."""

    mask: np.ndarray
    corner: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """Width and height of the mask."""
        return np.array(self.mask.shape[::-1])

    @property
    def box(self) -> np.ndarray:
        """Bounding box (4,) of the mask, which must not be empty."""
        box = box_of_mask(self.mask)
        assert box is not None
        return box + np.tile(self.corner, 2)

    def part(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the mask between two points of the photo inside the mask."""
        (left, top), (right, bottom) = low - self.corner, high - self.corner
        return self.mask[top:bottom, left:right]


Item = TypeVar("Item")  # a polygon or an annotation


def score_outlines(
    *, terrain: int, keys: Sequence[PhotoKey], annotations: Path, root: Path, evaluation: Path, options: ScoringOptions
) -> None:
    """Write the evaluation of the masks of a terrain under the Sun lamps, and of annotated polygons against boxes.

    Annotators drew a single set of polygons for all exposures of an exposure bracket. The file with most polygons is
    compared with the labels with most masks. As a reference for the accuracy of annotations, the boxes around polygons
    are compared with the annotated boxes of the same photo. Shadows are included only in photos with annotated shadow
    boxes, because shadows are not annotated at short exposures. `keys` are the labelled photos, `annotations` is the
    COCO file of the terrain, and `root` the root of a release; a terrain without polygons has no metrics.
    """
    annotated = _of_brackets(read_polygon_files(root, terrain), keys)
    predicted = _of_brackets(read_coco(annotations), keys)
    boxes = read_sound_boxes(release.label_folder(root, terrain), terrain)
    total: dict[str, MatchCounts] = {}
    for bracket in sorted(set(annotated) & set(predicted)):
        key, polygons = annotated[bracket]
        task = TASKS[key.camera]
        for kind in BOX_CLASSES:
            true_masks = _rasterised(polygons, kind)
            counts = count_overlaps(overlaps(true_masks, _masks(predicted[bracket][1], kind)), options.iou_threshold)
            subject = f"{kind} outline: {task}"
            total[subject] = total.get(subject, MatchCounts()) + counts
            of_polygons = _polygons_against_boxes(true_masks, boxes.get(key), kind, options)
            if of_polygons is not None:
                subject = f"{kind} polygon's box against annotated box: {task}"
                total[subject] = total.get(subject, MatchCounts()) + of_polygons
    metrics = [metric for subject in sorted(total) for metric in box_metrics(subject, total[subject], "labels")]
    write_metrics(evaluation, "labels", terrain, metrics)


def read_polygon_files(root: Path, terrain: int) -> dict[PhotoKey, Polygons]:
    """Read the annotated polygons of a terrain; invalid files are skipped with a warning."""
    return read_sound(release.polygon_files(root, terrain), yolo.read_polygons)[0]


def overlaps(first: Sequence[PlacedMask], second: Sequence[PlacedMask]) -> np.ndarray:
    """Return the IoU (n, m) of masks."""
    near = iou(_boxes(first), _boxes(second)) > 0
    overlap = np.zeros(near.shape)
    for row, column in np.argwhere(near):
        overlap[row, column] = mask_iou(first[row], second[column])
    return overlap


def mask_iou(first: PlacedMask, second: PlacedMask) -> float:
    """Return the IoU of two masks."""
    low = np.maximum(first.corner, second.corner)
    high = np.minimum(first.corner + first.size, second.corner + second.size)
    if (high <= low).any():
        return 0.0
    common = int((first.part(low, high) & second.part(low, high)).sum())
    return common / float(first.mask.sum() + second.mask.sum() - common)


def _of_brackets(
    files: Mapping[PhotoKey, list[Item]], keys: Sequence[PhotoKey]
) -> dict[tuple[object, ...], tuple[PhotoKey, list[Item]]]:
    """Return the photo with most items of each exposure bracket under a Sun lamp; ties: the longest exposure."""
    largest: dict[tuple[object, ...], tuple[PhotoKey, list[Item]]] = {}
    brackets = {key.bracket for key in keys if key.azimuth != "no"}
    for key, items in sorted(files.items(), key=lambda entry: (len(entry[1]), entry[0].exposure_ms)):
        if key.bracket in brackets:
            largest[key.bracket] = key, items
    return largest


def _rasterised(polygons: Polygons, kind: str) -> list[PlacedMask]:
    """Return the masks of the polygons of a class that cover at least a pixel."""
    masks = [_mask_of(ring) for number, ring in polygons if number == POLYGON_CLASSES.index(kind)]
    return [placed for placed in masks if placed.mask.any()]


def _mask_of(ring: np.ndarray) -> PlacedMask:
    low = np.clip(np.floor(ring.min(axis=0)), 0, [WIDTH, HEIGHT]).astype(int)
    high = np.clip(np.ceil(ring.max(axis=0)), 0, [WIDTH, HEIGHT]).astype(int)
    width, height = np.maximum(high - low, 1)
    return PlacedMask(rasterised(ring - low, (int(height), int(width))), low)


def _masks(annotations: Sequence[Annotation], kind: str) -> list[PlacedMask]:
    masks = []
    for annotation in annotations:
        if annotation.kind == kind and annotation.mask is not None:
            mask = annotation.mask.mask()
            box = box_of_mask(mask)
            if box is not None:
                left, top, right, bottom = box.astype(int)
                masks.append(PlacedMask(mask[top:bottom, left:right], np.array([left, top])))
    return masks


def _boxes(masks: Sequence[PlacedMask]) -> np.ndarray:
    return np.array([mask.box for mask in masks]).reshape(-1, 4)


def _polygons_against_boxes(
    polygons: Sequence[PlacedMask], boxes: PhotoLabels | None, kind: str, options: ScoringOptions
) -> MatchCounts | None:
    """Compare boxes around polygons with the annotated boxes of the photo; None without boxes of the class."""
    of_kind = np.zeros((0, 4)) if boxes is None else boxes.boxes[boxes.classes == BOX_CLASSES.index(kind)]
    if not len(of_kind):
        return None
    return count_boxes(of_kind, _boxes(polygons), options.iou_threshold)
