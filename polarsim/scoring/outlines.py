"""Evaluation of the masks of rocks and shadows against annotated polygons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.sparse import csr_array

from polarsim.formats import release, yolo
from polarsim.formats.coco import read_coco
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.polygons import rasterised
from polarsim.photo import BOX_CLASSES, POLYGON_CLASSES, CameraSide, PhotoKey, Terrain
from polarsim.scoring.labels import box_metrics, read_sound_boxes
from polarsim.scoring.metrics import write_metrics
from polarsim.scoring.score import MatchCounts, PhotoLabels, count_boxes, count_overlaps, read_sound
from polarsim.site import Site

TASKS: dict[CameraSide, str] = {"L": "seeds' camera", "R": "Left to Right"}

Polygons = list[tuple[int, np.ndarray]]  # class number, ring (n, 2) in pixels
Mask = np.ndarray  # (n,) indices of the pixels in the flattened photo, row by row
Item = TypeVar("Item")  # a polygon or an annotation


def score_outlines(
    *,
    site: Site,
    terrain: Terrain,
    keys: Sequence[PhotoKey],
    annotations: Path,
    root: Path,
    evaluation: Path,
) -> None:
    """Write the evaluation of the masks of a terrain under the Sun lamps, and of annotated polygons against boxes.

    Annotators drew a single set of polygons for all exposures of an exposure bracket. The file with most polygons is
    compared with the labels with most masks. As a reference for the accuracy of annotations, the boxes around polygons
    are compared with the annotated boxes of the same photo. Shadows are included only in photos with annotated shadow
    boxes, because shadows are not annotated at short exposures. `keys` are the labelled photos, `annotations` is the
    COCO file of the terrain, and `root` the root of a release; a terrain without polygons has no metrics.
    """
    size = site.images.size
    annotated = _of_brackets(read_polygon_files(root, terrain, size), keys)
    predicted = _of_brackets(read_coco(annotations, size, PhotoKey.parse), keys)
    boxes = read_sound_boxes(release.label_folder(root, terrain), terrain, size)
    total: dict[str, MatchCounts] = {}
    for bracket in sorted(set(annotated) & set(predicted)):
        key, polygons = annotated[bracket]
        task = TASKS[key.camera]
        for kind in BOX_CLASSES:
            true_masks = _rasterised(polygons, kind, size)
            counts = count_overlaps(overlaps(true_masks, _masks(predicted[bracket][1], kind)))
            subject = f"{kind} outline: {task}"
            total[subject] = total.get(subject, MatchCounts()) + counts
            of_polygons = _polygons_against_boxes(true_masks, boxes.get(key), kind, size[0])
            if of_polygons is not None:
                subject = f"{kind} polygon's box against annotated box: {task}"
                total[subject] = total.get(subject, MatchCounts()) + of_polygons
    metrics = [metric for subject in sorted(total) for metric in box_metrics(subject, total[subject], "labels")]
    write_metrics(evaluation, "labels", terrain, metrics)


def read_polygon_files(root: Path, terrain: Terrain, size: tuple[int, int]) -> dict[PhotoKey, Polygons]:
    """Read the annotated polygons of a terrain; invalid files are skipped with a warning."""
    return read_sound(release.polygon_files(root, terrain), partial(yolo.read_polygons, size=size))[0]


def overlaps(first: Sequence[Mask], second: Sequence[Mask]) -> np.ndarray:
    """Return the IoU (n, m) of masks that are not empty."""
    count = 1 + max((int(mask.max()) for mask in (*first, *second)), default=0)
    common = (_incidence(first, count) @ _incidence(second, count).T).toarray()
    areas = np.array([len(mask) for mask in first])[:, None] + [len(mask) for mask in second]
    return common / (areas - common)


def _incidence(masks: Sequence[Mask], count: int) -> csr_array:
    """Return a sparse matrix (masks, `count` pixels) that is 1 for the pixels of a mask."""
    pixels, starts = np.concatenate([[], *masks]).astype(int), np.cumsum([0, *map(len, masks)])
    return csr_array((np.ones(len(pixels), int), pixels, starts), shape=(len(masks), count))


def _of_brackets(
    files: Mapping[PhotoKey, list[Item]], keys: Sequence[PhotoKey]
) -> dict[tuple[object, ...], tuple[PhotoKey, list[Item]]]:
    """Return the photo with most items of each exposure bracket under a Sun lamp; ties: the longest exposure."""
    largest: dict[tuple[object, ...], tuple[PhotoKey, list[Item]]] = {}
    brackets = {key.bracket for key in keys if key.has_sun}
    for key, items in sorted(files.items(), key=lambda entry: (len(entry[1]), entry[0].exposure_ms)):
        if key.bracket in brackets:
            largest[key.bracket] = key, items
    return largest


def _rasterised(polygons: Polygons, kind: str, size: tuple[int, int]) -> list[Mask]:
    """Return the masks of the polygons of a class that cover at least a pixel."""
    masks = [rasterised(ring, size[::-1]) for number, ring in polygons if number == POLYGON_CLASSES.index(kind)]
    return [np.flatnonzero(mask) for mask in masks if mask.any()]


def _masks(annotations: Sequence[Annotation], kind: str) -> list[Mask]:
    masks = [one.mask.mask() for one in annotations if one.kind == kind and one.mask is not None]
    return [np.flatnonzero(mask) for mask in masks if mask.any()]


def _boxes(masks: Sequence[Mask], width: int) -> np.ndarray:
    """Return the bounding boxes (n, 4) of masks of photos of a width, px."""
    corners = [(mask % width, mask // width) for mask in masks]
    return np.array([(x.min(), y.min(), x.max() + 1, y.max() + 1) for x, y in corners], float).reshape(-1, 4)


def _polygons_against_boxes(
    polygons: Sequence[Mask], boxes: PhotoLabels | None, kind: str, width: int
) -> MatchCounts | None:
    """Compare boxes around polygons with the annotated boxes of the photo; None without boxes of the class."""
    of_kind = np.zeros((0, 4)) if boxes is None else boxes.boxes[boxes.classes == BOX_CLASSES.index(kind)]
    if not len(of_kind):
        return None
    return count_boxes(of_kind, _boxes(polygons, width))
