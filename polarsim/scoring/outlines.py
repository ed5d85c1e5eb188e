"""How well outlines of rocks and shadows agree with the polygons that people drew, pixel by pixel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from polarsim.formats import release, yolo
from polarsim.formats.coco import Annotation, read_coco
from polarsim.geometry.boxes import iou, of_mask
from polarsim.geometry.polygons import rasterised
from polarsim.photo import BOX_CLASSES, HEIGHT, POLYGON_CLASSES, WIDTH, CameraSide, PhotoKey
from polarsim.scoring.labels import box_metrics, read_sound_boxes
from polarsim.scoring.metrics import write_metrics
from polarsim.scoring.options import ScoringOptions
from polarsim.scoring.score import Counts, Labels, count_boxes, count_overlaps, read_sound

TASKS: dict[CameraSide, str] = {"L": "seeds' camera", "R": "Left to Right"}

Polygons = list[tuple[int, np.ndarray]]  # class number, ring (n, 2) in pixels


@dataclass(frozen=True)
class Region:
    """A mask (h, w) whose first pixel is at a corner (x, y) of the photo."""

    mask: np.ndarray
    corner: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """Width and height of the mask."""
        return np.array(self.mask.shape[::-1])

    @property
    def box(self) -> np.ndarray:
        """(4,) around its true pixels, of which there are some."""
        found = of_mask(self.mask)
        assert found is not None
        return found + np.tile(self.corner, 2)

    def part(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The mask between two points of the photo that lie inside it."""
        (left, top), (right, bottom) = low - self.corner, high - self.corner
        return self.mask[top:bottom, left:right]


Thing = TypeVar("Thing")  # a polygon or an annotation


def score_outlines(
    *, terrain: int, keys: Sequence[PhotoKey], annotations: Path, root: Path, evaluation: Path, options: ScoringOptions
) -> None:
    """Write the evaluation of a terrain's outlines under the Sun lamps, and how well people's polygons fit their boxes.

    People drew one set of polygons for all exposures of an exposure bracket: the fullest file is compared with the
    fullest labels. Their boxes are the yardstick: the boxes around polygons against the boxes of the same photo.
    Shadows count there only where shadow boxes were annotated: at short exposures there are none.

    Parameters
    ----------
    keys
        The photos that were labelled.
    annotations
        The terrain's COCO file.
    root
        Of a release; a terrain without polygons there has no metrics.
    """
    annotated = _of_brackets(read_polygon_files(root, terrain), keys)
    found = _of_brackets(read_coco(annotations), keys)
    boxes = read_sound_boxes(release.label_folder(root, terrain), terrain)
    total: dict[str, Counts] = {}
    for bracket in sorted(set(annotated) & set(found)):
        key, polygons = annotated[bracket]
        task = TASKS[key.camera]
        for kind in BOX_CLASSES:
            people = _painted(polygons, kind)
            counts = count_overlaps(overlaps(people, _masks(found[bracket][1], kind)), options.iou_threshold)
            subject = f"{kind} outline: {task}"
            total[subject] = total.get(subject, Counts()) + counts
            yardstick = _yardstick(people, boxes.get(key), kind, options)
            if yardstick is not None:
                subject = f"{kind} polygon's box against annotated box: {task}"
                total[subject] = total.get(subject, Counts()) + yardstick
    metrics = [metric for subject in sorted(total) for metric in box_metrics(subject, total[subject], "labels")]
    write_metrics(evaluation, "labels", terrain, metrics)


def read_polygon_files(root: Path, terrain: int) -> dict[PhotoKey, Polygons]:
    """Hand-annotated polygons of a terrain; broken files are left out with a warning."""
    return read_sound(release.polygon_files(root, terrain), yolo.read_polygons)[0]


def overlaps(first: Sequence[Region], second: Sequence[Region]) -> np.ndarray:
    """(n, m) IoU of regions, pixel by pixel."""
    near = iou(_boxes(first), _boxes(second)) > 0
    overlap = np.zeros(near.shape)
    for row, column in np.argwhere(near):
        overlap[row, column] = region_iou(first[row], second[column])
    return overlap


def region_iou(first: Region, second: Region) -> float:
    """IoU of two regions, pixel by pixel."""
    low = np.maximum(first.corner, second.corner)
    high = np.minimum(first.corner + first.size, second.corner + second.size)
    if (high <= low).any():
        return 0.0
    common = int((first.part(low, high) & second.part(low, high)).sum())
    return common / float(first.mask.sum() + second.mask.sum() - common)


def _of_brackets(
    files: Mapping[PhotoKey, list[Thing]], keys: Sequence[PhotoKey]
) -> dict[tuple[object, ...], tuple[PhotoKey, list[Thing]]]:
    """The fullest of each exposure bracket under a Sun lamp; of several the one exposed longest."""
    fullest: dict[tuple[object, ...], tuple[PhotoKey, list[Thing]]] = {}
    sets = {key.bracket for key in keys if key.azimuth != "no"}
    for key, things in sorted(files.items(), key=lambda item: (len(item[1]), item[0].exposure_ms)):
        if key.bracket in sets:
            fullest[key.bracket] = key, things
    return fullest


def _painted(polygons: Polygons, kind: str) -> list[Region]:
    """What polygons of one kind cover, as far as it is a pixel."""
    own = [_region(ring) for number, ring in polygons if number == POLYGON_CLASSES.index(kind)]
    return [region for region in own if region.mask.any()]


def _region(ring: np.ndarray) -> Region:
    low = np.clip(np.floor(ring.min(axis=0)), 0, [WIDTH, HEIGHT]).astype(int)
    high = np.clip(np.ceil(ring.max(axis=0)), 0, [WIDTH, HEIGHT]).astype(int)
    width, height = np.maximum(high - low, 1)
    return Region(rasterised(ring - low, (int(height), int(width))), low)


def _masks(annotations: Sequence[Annotation], kind: str) -> list[Region]:
    found = []
    for annotation in annotations:
        if annotation.kind == kind and annotation.mask is not None:
            mask = annotation.mask.mask()
            box = of_mask(mask)
            if box is not None:
                left, top, right, bottom = box.astype(int)
                found.append(Region(mask[top:bottom, left:right], np.array([left, top])))
    return found


def _boxes(regions: Sequence[Region]) -> np.ndarray:
    return np.array([region.box for region in regions]).reshape(-1, 4)


def _yardstick(people: Sequence[Region], boxes: Labels | None, kind: str, options: ScoringOptions) -> Counts | None:
    """Boxes around polygons against the boxes of the same photo; None where nobody drew boxes of this kind."""
    own = np.zeros((0, 4)) if boxes is None else boxes.boxes[boxes.classes == BOX_CLASSES.index(kind)]
    if not len(own):
        return None
    return count_boxes(own, _boxes(people), options.iou_threshold)
