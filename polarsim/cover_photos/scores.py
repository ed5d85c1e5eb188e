"""Metrics of detectors on cover photos of terrains excluded from training, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect import metrics
from polarsim.detect.calibration import calibrate_boxes, calibration_error, fit_calibration
from polarsim.detect.dataset import dataset_images
from polarsim.detect.detectors import detector_name
from polarsim.detect.grouping import detections_by_photo, labels_by_photo
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.detect.split import TEST, TRAIN
from polarsim.formats import tables
from polarsim.geometry.boxes import largest_iou
from polarsim.photo import BOX_CLASSES, PhotoKey, terrain_text
from polarsim.randomness import generator
from polarsim.schemas.covers import COVER_SCORES, MEAN, MERGED, NO_SEED, SINGLE
from polarsim.schemas.detect import PREDICTIONS

ALL = "all"  # all terrains
CoverPredictions = tuple[pd.DataFrame, dict[str, np.ndarray]]  # table, and boxes from `cross_calibrated`


def score_covers(
    *,
    labels: Path,
    predictions: Mapping[int, Path],
    merged: Path | None = None,
    datasets: Mapping[str, Path],
    trained_on: Sequence[Path],
    scores: Path,
    trained: str,
    training: TrainingOptions,
    start: str,
    options: ComparisonOptions,
) -> None:
    """Write the metrics of each training seed, their mean, and the metrics of the merged seeds.

    Metrics are computed over all cover photos and for each terrain. Each photo is evaluated with the fold that excludes
    its terrain from training. A single seed has no mean.

    Parameters
    ----------
    predictions : mapping of seed to Path
        Predictions in all cover photos; each photo is predicted by the fold that tests it.
    merged : Path, optional
        Predictions merged over all seeds.
    datasets : mapping of fold to Path
        Data sets of the folds, with the cover photos as test part.
    trained_on : sequence of Path
        Data sets of the last training of each fold, which has the options `training`.
    trained : str
        Kind of training: RENDERED or FINE_TUNED of `schemas.covers`.
    start : str
        Name in the table of the initial weights of the first training.
    """
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    folds = {fold: dataset_images(folder, TEST) for fold, folder in datasets.items()}

    def read(path: Path) -> CoverPredictions:
        table = tables.read_parquet(path, PREDICTIONS.columns)
        return table, cross_calibrated(truth, table, folds)

    of_seed = {seed: read(path) for seed, path in sorted(predictions.items())}
    rows = [(SINGLE, seed, [evaluated]) for seed, evaluated in of_seed.items()]
    rows += [(MEAN, NO_SEED, list(of_seed.values()))] if len(of_seed) > 1 else []
    rows += [(MERGED, NO_SEED, [read(merged)])] if merged else []
    parts = [
        _calibrated_metrics(truth, evaluated, keys, options).assign(terrain=name, detectors=detectors, seed=seed)
        for detectors, seed, evaluated in rows
        for name, keys in _by_terrain([key for fold_keys in folds.values() for key in fold_keys]).items()
    ]
    table = pd.concat(parts, ignore_index=True).assign(
        trained=trained,
        detector=detector_name(training.model),
        start=start,
        epochs=training.epochs,
        folds=len(datasets),
        pictures=round(float(np.mean([len(dataset_images(folder, TRAIN)) for folder in trained_on]))),
    )
    tables.write_parquet(scores, table[list(COVER_SCORES.columns)].astype(COVER_SCORES.dtypes))


def _by_terrain(keys: Sequence[str]) -> dict[str, list[str]]:
    """Return the photo keys of all terrains, and of each terrain."""
    chosen = {ALL: list(keys)}
    for terrain in sorted({PhotoKey.parse(key).terrain for key in keys}):
        chosen[terrain_text(terrain)] = [key for key in keys if PhotoKey.parse(key).terrain == terrain]
    return chosen


def _calibrated_metrics(
    labels: pd.DataFrame, by_seed: Sequence[CoverPredictions], keys: Sequence[str], options: ComparisonOptions
) -> pd.DataFrame:
    """Return the metrics of `cover_metrics` with the calibration error."""
    table = cover_metrics(labels, [predictions for predictions, _ in by_seed], keys, resamples=options.resamples)
    errors = [
        np.mean([_calibration_error(labels, calibrated, keys, kind) for _, calibrated in by_seed])
        for kind in table["kind"]
    ]
    return table.assign(calibration_error=errors)


def cover_metrics(
    labels: pd.DataFrame, predictions: Sequence[pd.DataFrame], keys: Sequence[str], *, resamples: int
) -> pd.DataFrame:
    """Return average precision of each labelled kind over all photos, with 95 % bootstrap intervals over photos.

    For several prediction tables, the mean and its interval are returned; all tables share the bootstrap replicates.
    Columns: kind, images, labels, map50, map50_low, map50_high, map50_95, iou_mean (without confidence threshold). A
    single photo has no interval.
    """
    from polarsim.detect.bootstrap_numba import resampled_precision

    truth = labels_by_photo(labels, keys)
    by_table = [list(detections_by_photo(table, keys).values()) for table in predictions]
    ranked_by_table = [metrics.rank_classes(truth, detections) for detections in by_table]
    rows = []
    for number, kind in enumerate(BOX_CLASSES):
        boxes = [corners[classes == number] for classes, corners in truth]
        if not any(map(len, boxes)):
            continue
        random = generator(0, "covers", "bootstrap", kind)
        draws = (random.integers(len(keys), size=len(keys)) for _ in range(resamples))
        drawn = np.array([np.bincount(draw, minlength=len(keys)) for draw in draws], float)
        each = []
        for detections, ranked in zip(by_table, ranked_by_table, strict=True):
            resampled = resampled_precision(ranked[number], 0, np.arange(len(keys)), drawn)[:, 0]
            pairs = zip(boxes, detections, strict=True)
            best = np.concatenate([largest_iou(label, found[found[:, 5] == number, :4]) for label, found in pairs])
            each.append((metrics.precision_at_recalls(ranked[number]).mean(axis=1), resampled, best.mean()))
        by_iou, precision, iou_mean = (np.mean(values, axis=0) for values in zip(*each, strict=True))
        low, high = intervals.percentile_interval(precision, len(keys))
        rows.append((kind, len(keys), sum(map(len, boxes)), by_iou[0], low, high, by_iou.mean(), iou_mean))
    names = ["kind", "images", "labels", "map50", "map50_low", "map50_high", "map50_95", "iou_mean"]
    return pd.DataFrame(rows, columns=names)


def cross_calibrated(
    labels: pd.DataFrame, predictions: pd.DataFrame, folds: Mapping[str, Sequence[str]]
) -> dict[str, np.ndarray]:
    """Return boxes (n, 6) of each photo with confidences calibrated on the boxes of the remaining folds.

    Empty with a single fold. `folds` are the photo keys of each fold.
    """
    keys = [key for fold_keys in folds.values() for key in fold_keys]
    detections = detections_by_photo(predictions, keys)
    boxes: dict[str, np.ndarray] = {}
    for fold, fold_keys in folds.items() if len(folds) > 1 else ():
        fit_keys = [key for name, photos in folds.items() if name != fold for key in photos]
        calibration = fit_calibration(labels_by_photo(labels, fit_keys), [detections[key] for key in fit_keys])
        boxes |= {key: calibrate_boxes(detections[key], calibration) for key in fold_keys}
    return boxes


def _calibration_error(labels: pd.DataFrame, boxes: Mapping[str, np.ndarray], keys: Sequence[str], kind: str) -> float:
    """Return the expected calibration error of a kind in some photos; NaN without calibrated boxes."""
    if not boxes:
        return float("nan")
    of_kind = [boxes[key][boxes[key][:, 5] == BOX_CLASSES.index(kind)] for key in keys]
    return calibration_error(labels_by_photo(labels[labels["kind"] == kind], keys), of_kind)
