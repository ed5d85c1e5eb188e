"""How well detectors find the labels of cover photos of terrains that they have not seen, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.covers.widths import truth_of
from polarsim.detect import bootstrap, metrics
from polarsim.detect.calibration import calibrated, calibration_error, fit_calibration
from polarsim.detect.dataset import BOX_COLUMNS, read_pictures
from polarsim.detect.detectors import detector_name
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.detect.split import TEST, TRAIN
from polarsim.formats import tables
from polarsim.formats.schemas import COVER_SCORES, PREDICTIONS
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.randomness import generator

ALL = "all"  # terrains together


def score_covers(
    *,
    labels: Path,
    predictions: Mapping[int, Path],
    datasets: Mapping[str, Path],
    scores: Path,
    training: TrainingOptions,
    start: str,
    options: ComparisonOptions,
) -> None:
    """Write the figures of every seed of training: over all cover photos, and of each terrain.

    Each photo's predictions are those of the fold that has not seen its terrain.

    Parameters
    ----------
    labels : Path
        Label table that `read_covers` wrote.
    predictions : mapping of seed to Path
        What the folds' detectors see in all cover photos, each in those of its own test part.
    datasets : mapping of fold to Path
        Their data sets.
    start : str
        What the detectors started from, as the table is to name it.

    Raises
    ------
    PolarsimError
        A file is missing or broken.
    """
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    folds = {fold: read_pictures(folder, TEST) for fold, folder in datasets.items()}
    keys = [key for own in folds.values() for key in own]
    pictures = [len(read_pictures(folder, TRAIN)) for folder in datasets.values()]
    parts = []
    for seed, path in sorted(predictions.items()):
        found = tables.read_parquet(path, PREDICTIONS.columns)
        boxes = calibrated_by_others(truth, found, folds)
        terrains = sorted({PhotoKey.parse(key).terrain for key in keys})
        chosen = {ALL: keys} | {
            f"{terrain:02d}": [key for key in keys if PhotoKey.parse(key).terrain == terrain] for terrain in terrains
        }
        for name, own in chosen.items():
            figures = cover_figures(truth, found, own, seed=options.seed, resamples=options.resamples)
            errors = [_calibration_error(truth, boxes, own, kind) for kind in figures["kind"]]
            parts.append(figures.assign(terrain=name, seed=seed, calibration_error=errors))
    table = pd.concat(parts, ignore_index=True).assign(
        detector=detector_name(training.model),
        start=start,
        epochs=training.epochs,
        folds=len(datasets),
        pictures=round(float(np.mean(pictures))),
    )
    tables.write_parquet(scores, table[list(COVER_SCORES.columns)].astype(COVER_SCORES.dtypes))


def cover_figures(
    labels: pd.DataFrame, predictions: pd.DataFrame, keys: Sequence[str], *, seed: int, resamples: int
) -> pd.DataFrame:
    """Average precision of each labelled kind, photos pooled, with 95 % intervals of a bootstrap over the photos.

    Columns: kind, images, labels, map50, map50_low, map50_high, map50_95, iou_mean (every prediction counts). One photo
    has no interval.
    """
    rows = []
    labels = labels[labels["key"].isin(keys)]
    for kind in (kind for kind in BOX_CLASSES if (labels["kind"] == kind).any()):
        truth = _by_photo(labels[labels["kind"] == kind], BOX_COLUMNS, keys)
        found = _by_photo(predictions[predictions["kind"] == kind], (*BOX_COLUMNS, "confidence"), keys)
        ranked = metrics.rank(truth, [rows[:, :4] for rows in found], [rows[:, 4] for rows in found])
        whole = metrics.precision_at_recalls(ranked).mean(axis=1)
        random = generator(seed, "covers", "bootstrap", kind)
        drawn = np.array([_times(len(keys), random) for _ in range(resamples)])
        precision = bootstrap.resampled_precision(ranked, 0, np.arange(len(keys)), drawn)[:, 0]
        low, high = bootstrap.interval(precision, len(keys))
        best = np.concatenate([metrics.best_overlap(t, f[:, :4]) for t, f in zip(truth, found, strict=True)])
        rows.append((kind, len(keys), len(best), whole[0], low, high, whole.mean(), best.mean()))
    names = ["kind", "images", "labels", "map50", "map50_low", "map50_high", "map50_95", "iou_mean"]
    return pd.DataFrame(rows, columns=names)


def calibrated_by_others(
    labels: pd.DataFrame, predictions: pd.DataFrame, folds: Mapping[str, Sequence[str]]
) -> dict[str, np.ndarray]:
    """Boxes (n, 6) of every photo, each fold's with confidences that the boxes of all other folds calibrate.

    Empty for one fold alone, which nothing calibrates.

    Parameters
    ----------
    folds : mapping of fold to photo keys
    """
    keys = [key for own in folds.values() for key in own]
    table = predictions.assign(kind=predictions["kind"].map(BOX_CLASSES.index))
    found = dict(zip(keys, _by_photo(table, (*BOX_COLUMNS, "confidence", "kind"), keys), strict=True))
    boxes: dict[str, np.ndarray] = {}
    for fold, own in folds.items() if len(folds) > 1 else ():
        others = [key for other, photos in folds.items() if other != fold for key in photos]
        calibration = fit_calibration(truth_of(labels, others), [found[key] for key in others])
        boxes |= {key: calibrated(found[key], calibration) for key in own}
    return boxes


def _calibration_error(labels: pd.DataFrame, boxes: Mapping[str, np.ndarray], keys: Sequence[str], kind: str) -> float:
    """Expected calibration error of one kind in some photos; NaN without calibrated boxes."""
    if not boxes:
        return float("nan")
    of_kind = [boxes[key][boxes[key][:, 5] == BOX_CLASSES.index(kind)] for key in keys]
    return calibration_error(truth_of(labels[labels["kind"] == kind], keys), of_kind)


def _times(count: int, random: np.random.Generator) -> np.ndarray:
    """(n,) how often each of n photos is drawn when n are drawn."""
    return np.bincount(random.integers(count, size=count), minlength=count).astype(float)


def _by_photo(table: pd.DataFrame, columns: Sequence[str], keys: Sequence[str]) -> list[np.ndarray]:
    found = {str(key): rows.to_numpy(float) for key, rows in table.groupby("key")[list(columns)]}
    return [found.get(key, np.zeros((0, len(columns)))) for key in keys]
