"""Evaluation of class masks (ground, rocks, shadows) against annotated polygons of the same photos."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from math import log2
from pathlib import Path

import numpy as np

from polarsim.errors import LabelError
from polarsim.formats import tables
from polarsim.geometry.masks import class_iou, confusion_matrix
from polarsim.geometry.polygons import paint
from polarsim.intervals import bootstrap_draws, percentile_interval
from polarsim.photo import PhotoKey
from polarsim.run_files import class_masks
from polarsim.schemas.covers import MASK_SCORES
from polarsim.scoring.outlines import Polygons, read_polygon_files

ALL = "all"  # photos together
SAND, PHOTO = "sand", "photo"
REGIONS = {SAND: class_masks.IGNORED, PHOTO: class_masks.CLASSES.index("ground")}  # class of the background of polygons
log = logging.getLogger("polarsim")


def score_masks(
    *, masks: Sequence[Path], root: Path, scores: Path, size: tuple[int, int], resamples: int, seed: int = 0
) -> None:
    """Write the IoU of each class for every photo with polygons and for all photos, see `MASK_SCORES`.

    Annotators drew a single set of polygons for all exposures of an exposure bracket. If a bracket has several files,
    that of the nearest exposure is used. `masks` are folders of `KEY.png`, see `run_files.class_masks`; `root` is the
    root of a release, `size` the width and height of the photos, px.
    """
    path_of = {PhotoKey.parse(path.stem): path for folder in masks for path in sorted(folder.glob("*.png"))}
    counts: dict[str, dict[str, np.ndarray]] = {region: {} for region in REGIONS}
    for key, polygons in _annotated(root, list(path_of), size):
        truth, mask = paint(polygons, size[::-1]), class_masks.read_class_mask(path_of[key])
        if truth.shape != mask.shape:
            reason = f"{mask.shape[1]} x {mask.shape[0]} pixels, expected {truth.shape[1]} x {truth.shape[0]}"
            raise LabelError(reason, path=path_of[key])
        for region, background in REGIONS.items():
            classes = class_masks.of_grey_map(truth, background)
            counts[region][str(key)] = confusion_matrix(classes, mask, len(class_masks.CLASSES))
    if not counts[SAND]:
        raise LabelError(f"no polygons of the {len(path_of)} photos", path=root)
    log.info("scoring masks of %d of %d photos; other photos have no polygons", len(counts[SAND]), len(path_of))
    rows = [row for region, of_photos in counts.items() for row in _rows(region, of_photos, seed, resamples)]
    table = tables.typed(rows, MASK_SCORES)
    tables.write_parquet(scores, table)


def _annotated(root: Path, keys: list[PhotoKey], size: tuple[int, int]) -> Iterator[tuple[PhotoKey, Polygons]]:
    for terrain in sorted({key.terrain for key in keys}):
        polygons = read_polygon_files(root, terrain, size)
        for key in (key for key in keys if key.terrain == terrain):
            of_bracket = [other for other in polygons if other.bracket == key.bracket]
            if of_bracket:
                yield key, polygons[min(of_bracket, key=lambda o: (abs(log2(o.exposure_ms / key.exposure_ms)), o))]


def _rows(region: str, counts: Mapping[str, np.ndarray], seed: int, resamples: int) -> list[tuple[object, ...]]:
    """Return a row per photo and class, and rows for the pooled pixels of all photos with bootstrap intervals."""
    rows: list[tuple[object, ...]] = []
    for key, of_photo in counts.items():
        rows += _of_classes(region, key, 1, of_photo, np.full((2, len(of_photo)), np.nan))
    each = np.stack(list(counts.values()))
    resampled = class_iou(np.tensordot(bootstrap_draws(len(each), resamples, seed, "masks", "bootstrap"), each, axes=1))
    bounds = np.array([percentile_interval(values, len(each)) for values in resampled.T]).T
    return rows + _of_classes(region, ALL, len(each), each.sum(axis=0), bounds)


def _of_classes(region: str, key: str, photos: int, counts: np.ndarray, bounds: np.ndarray) -> list[tuple[object, ...]]:
    pixels, values = counts.sum(axis=1), class_iou(counts)
    return [
        (key, region, kind, photos, pixels[n], values[n], bounds[0, n], bounds[1, n])
        for n, kind in enumerate(class_masks.CLASSES)
    ]
