"""How well masks of ground, rocks and shadows agree with the polygons that people drew of the same photos."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from math import log2
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import LabelError
from polarsim.formats import tables
from polarsim.geometry.masks import confusion, iou
from polarsim.geometry.polygons import paint
from polarsim.intervals import draws, interval
from polarsim.photo import PhotoKey
from polarsim.run_files import class_masks
from polarsim.schemas.covers import MASK_SCORES
from polarsim.scoring.outlines import Polygons, read_polygon_files

ALL = "all"  # photos together
SAND, PHOTO = "sand", "photo"
REGIONS = {SAND: class_masks.IGNORED, PHOTO: class_masks.CLASSES.index("ground")}  # what people's background counts as
log = logging.getLogger("polarsim")


def score_masks(*, masks: Sequence[Path], root: Path, scores: Path, resamples: int, seed: int = 0) -> None:
    """Write the IoU of each class, of every photo with polygons and of all of them, see `MASK_SCORES`.

    People drew one set of polygons for all exposures of an exposure bracket: that of the nearest exposure counts.

    Parameters
    ----------
    masks : sequence of Path
        Folders of `KEY.png`, see `formats.class_masks`.
    root : Path
        Of a release.
    seed, resamples
        Of the bootstrap over photos.

    Raises
    ------
    PolarsimError
        A broken mask, one of another size than its photo, or polygons of no photo.
    """
    found = {PhotoKey.parse(path.stem): path for folder in masks for path in sorted(folder.glob("*.png"))}
    counts: dict[str, dict[str, np.ndarray]] = {region: {} for region in REGIONS}
    for key, polygons in _drawn(root, list(found)):
        truth, mask = paint(polygons), class_masks.read(found[key])
        if truth.shape != mask.shape:
            raise LabelError(f"{mask.shape[1]} x {mask.shape[0]} pixels, expected a photo's", path=found[key])
        for region, background in REGIONS.items():
            classes = class_masks.of_grey_map(truth, background)
            counts[region][str(key)] = confusion(classes, mask, len(class_masks.CLASSES))
    if not counts[SAND]:
        raise LabelError(f"no polygons of any of {len(found)} photos", path=root)
    log.info("masks of %d of %d photos are scored: of the others there are no polygons", len(counts[SAND]), len(found))
    rows = [row for region, of_photos in counts.items() for row in _rows(region, of_photos, seed, resamples)]
    table = pd.DataFrame(rows, columns=list(MASK_SCORES.columns)).astype(MASK_SCORES.dtypes)
    tables.write_parquet(scores, table)


def _drawn(root: Path, keys: list[PhotoKey]) -> Iterator[tuple[PhotoKey, Polygons]]:
    for terrain in sorted({key.terrain for key in keys}):
        polygons = read_polygon_files(root, terrain)
        for key in (key for key in keys if key.terrain == terrain):
            of_bracket = [other for other in polygons if other.bracket == key.bracket]
            if of_bracket:
                yield key, polygons[min(of_bracket, key=lambda o: (abs(log2(o.exposure_ms / key.exposure_ms)), o))]


def _rows(region: str, counts: Mapping[str, np.ndarray], seed: int, resamples: int) -> list[tuple[object, ...]]:
    """A row a photo and class, and those of all photos: their pixels pooled, an interval where there are several."""
    rows: list[tuple[object, ...]] = []
    for key, own in counts.items():
        rows += _of_classes(region, key, 1, own, np.full((2, len(own)), np.nan))
    each = np.stack(list(counts.values()))
    resampled = iou(np.tensordot(draws(len(each), resamples, seed, "masks", "bootstrap"), each, axes=1))
    bounds = np.array([interval(values, len(each)) for values in resampled.T]).T
    return rows + _of_classes(region, ALL, len(each), each.sum(axis=0), bounds)


def _of_classes(region: str, key: str, photos: int, counts: np.ndarray, bounds: np.ndarray) -> list[tuple[object, ...]]:
    pixels, values = counts.sum(axis=1), iou(counts)
    return [
        (key, region, kind, photos, pixels[n], values[n], bounds[0, n], bounds[1, n])
        for n, kind in enumerate(class_masks.CLASSES)
    ]
