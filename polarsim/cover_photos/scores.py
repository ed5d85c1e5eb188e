"""How well detectors find the labels of cover photos of terrains that they have not seen, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect import metrics
from polarsim.detect.calibration import calibrated, calibration_error, fit_calibration
from polarsim.detect.dataset import read_pictures
from polarsim.detect.detectors import detector_name
from polarsim.detect.grouping import DETECTION, boxes_by_photo, detections_by_photo, labels_by_photo
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.detect.split import TEST, TRAIN
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.randomness import generator
from polarsim.schemas.covers import COVER_SCORES, MEAN, MERGED, NO_SEED, ONE
from polarsim.schemas.detect import PREDICTIONS

ALL = "all"  # terrains together


@dataclass(frozen=True)
class _Seen:
    """What was seen in all cover photos."""

    predictions: pd.DataFrame
    calibrated: dict[str, np.ndarray]  # as `calibrated_by_others` gives it


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
    """Write the figures of every seed of training, their mean, and those of the merged detectors.

    Over all cover photos, and of each terrain. Each photo's predictions are those of the fold that has not seen its
    terrain. One seed alone has no mean.

    Parameters
    ----------
    labels : Path
        Label table that `read_covers` wrote.
    predictions : mapping of seed to Path
        What the folds' detectors see in all cover photos, each in those of its own test part.
    merged : Path, optional
        The same of every fold's detectors of all seeds, merged.
    datasets : mapping of fold to Path
        Data sets whose test parts are the folds' cover photos.
    trained_on : sequence of Path
        Data sets that the folds' detectors were trained on last.
    trained : str
        On what the detectors were trained, RENDERED or FINE_TUNED of `formats.schemas`.
    training : TrainingOptions
        How they were trained last.
    start : str
        What the first training started from, as the table is to name it.

    Raises
    ------
    PolarsimError
        A file is missing or broken.
    """
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    folds = {fold: read_pictures(folder, TEST) for fold, folder in datasets.items()}
    of_seed = {seed: _read(path, truth, folds) for seed, path in sorted(predictions.items())}
    rows = [(ONE, seed, [seen]) for seed, seen in of_seed.items()]
    rows += [(MEAN, NO_SEED, list(of_seed.values()))] if len(of_seed) > 1 else []
    rows += [(MERGED, NO_SEED, [_read(merged, truth, folds)])] if merged else []
    found = [
        _figures(truth, seen, keys, options).assign(terrain=name, detectors=detectors, seed=seed)
        for detectors, seed, seen in rows
        for name, keys in _by_terrain([key for own in folds.values() for key in own]).items()
    ]
    table = pd.concat(found, ignore_index=True).assign(
        trained=trained,
        detector=detector_name(training.model),
        start=start,
        epochs=training.epochs,
        folds=len(datasets),
        pictures=round(float(np.mean([len(read_pictures(folder, TRAIN)) for folder in trained_on]))),
    )
    tables.write_parquet(scores, table[list(COVER_SCORES.columns)].astype(COVER_SCORES.dtypes))


def _read(path: Path, labels: pd.DataFrame, folds: Mapping[str, Sequence[str]]) -> _Seen:
    predictions = tables.read_parquet(path, PREDICTIONS.columns)
    return _Seen(predictions, calibrated_by_others(labels, predictions, folds))


def _by_terrain(keys: Sequence[str]) -> dict[str, list[str]]:
    """Photo keys of all terrains, and of each."""
    chosen = {ALL: list(keys)}
    for terrain in sorted({PhotoKey.parse(key).terrain for key in keys}):
        chosen[f"{terrain:02d}"] = [key for key in keys if PhotoKey.parse(key).terrain == terrain]
    return chosen


def _figures(
    labels: pd.DataFrame, seen: Sequence[_Seen], keys: Sequence[str], options: ComparisonOptions
) -> pd.DataFrame:
    """What `cover_figures` gives, with the calibration error."""
    predictions = [one.predictions for one in seen]
    figures = cover_figures(labels, predictions, keys, resamples=options.resamples)
    errors = [
        np.mean([_calibration_error(labels, one.calibrated, keys, kind) for one in seen]) for kind in figures["kind"]
    ]
    return figures.assign(calibration_error=errors)


def cover_figures(
    labels: pd.DataFrame, predictions: Sequence[pd.DataFrame], keys: Sequence[str], *, seed: int = 0, resamples: int
) -> pd.DataFrame:
    """Average precision of each labelled kind, photos pooled, with 95 % intervals of a bootstrap over the photos.

    Of several tables of predictions the mean, and its interval: each is scored alone, on the same drawn photos.
    Columns: kind, images, labels, map50, map50_low, map50_high, map50_95, iou_mean (every prediction counts). One photo
    has no interval.
    """
    rows = []
    labels = labels[labels["key"].isin(keys)]
    for kind in (kind for kind in BOX_CLASSES if (labels["kind"] == kind).any()):
        truth = boxes_by_photo(labels[labels["kind"] == kind], keys)
        random = generator(seed, "covers", "bootstrap", kind)
        drawn = np.array([_times(len(keys), random) for _ in range(resamples)])
        each = [_precision(truth, table[table["kind"] == kind], keys, drawn) for table in predictions]
        whole, precision, best = (np.mean(values, axis=0) for values in zip(*each, strict=True))
        low, high = intervals.interval(precision, len(keys))
        rows.append((kind, len(keys), sum(map(len, truth)), whole[0], low, high, whole.mean(), best))
    names = ["kind", "images", "labels", "map50", "map50_low", "map50_high", "map50_95", "iou_mean"]
    return pd.DataFrame(rows, columns=names)


def _precision(
    truth: Sequence[np.ndarray], predictions: pd.DataFrame, keys: Sequence[str], drawn: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Of one kind: average precision by IoU (t,), at 0.5 on drawn photos (resamples,), and mean largest IoU."""
    from polarsim.detect.bootstrap_numba import resampled_precision

    found = boxes_by_photo(predictions, keys, DETECTION[:5])
    ranked = metrics.rank(truth, [rows[:, :4] for rows in found], [rows[:, 4] for rows in found])
    resampled = resampled_precision(ranked, 0, np.arange(len(keys)), drawn)[:, 0]
    best = np.concatenate([metrics.best_overlap(t, f[:, :4]) for t, f in zip(truth, found, strict=True)])
    return metrics.precision_at_recalls(ranked).mean(axis=1), resampled, float(best.mean())


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
    found = detections_by_photo(predictions, keys)
    boxes: dict[str, np.ndarray] = {}
    for fold, own in folds.items() if len(folds) > 1 else ():
        others = [key for other, photos in folds.items() if other != fold for key in photos]
        calibration = fit_calibration(labels_by_photo(labels, others), [found[key] for key in others])
        boxes |= {key: calibrated(found[key], calibration) for key in own}
    return boxes


def _calibration_error(labels: pd.DataFrame, boxes: Mapping[str, np.ndarray], keys: Sequence[str], kind: str) -> float:
    """Expected calibration error of one kind in some photos; NaN without calibrated boxes."""
    if not boxes:
        return float("nan")
    of_kind = [boxes[key][boxes[key][:, 5] == BOX_CLASSES.index(kind)] for key in keys]
    return calibration_error(labels_by_photo(labels[labels["kind"] == kind], keys), of_kind)


def _times(count: int, random: np.random.Generator) -> np.ndarray:
    """(n,) how often each of n photos is drawn when n are drawn."""
    return np.bincount(random.integers(count, size=count), minlength=count).astype(float)
