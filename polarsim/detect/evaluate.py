"""Figures of every judge in every domain, and of the difference between domains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import metrics
from polarsim.detect.dataset import BOX_COLUMNS, count_left_out, read_pictures
from polarsim.detect.ipd import INSTANCE_COLUMNS, instance_performance, instance_performance_difference
from polarsim.detect.judges import judge_name
from polarsim.detect.options import DetectOptions
from polarsim.detect.predict import PREDICTION_COLUMNS
from polarsim.detect.split import PHOTO, TEST, TRAIN, VAL, leaks, read_split
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES

ALL = "all"
DETECTION_COLUMNS = (
    "trained", "evaluated", "kind", "split", "leaks_views", "judge", "start", "epochs", "imgsz",
    "images", "left_out", "labels", "map50", "map50_95", "iou_mean",
)  # fmt: skip
IPD_COLUMNS = (
    "trained", "first", "second", "kind", "pairs",
    "ipd", "ipd_abs", "ipd_low", "ipd_high", "ipd_abs_low", "ipd_abs_high",
)  # fmt: skip
_DIGITS = 6


def evaluate(
    *,
    predictions: Sequence[Path],
    labels: Mapping[str, Path],
    datasets: Mapping[str, Path],
    split: Path,
    by: str = PHOTO,
    detection: Path,
    ipd: Path,
    instances: Path,
    options: DetectOptions,
) -> None:
    """Write the detection, IPD and instance tables of all pairs of domains.

    Parameters
    ----------
    predictions : sequence of Path
        Files named `<trained>_on_<evaluated>.parquet`.
    labels, datasets : mapping of str to Path
        Label table and data set of each evaluated domain; only pictures that the data set has in its test part count.
        Data sets of domains that are trained on only may be among them, for what they leave out.
    split : Path
        The split that the data sets were made by.
    by : str
        What it is by: photo, view, position or terrain.

    Raises
    ------
    PolarsimError
        A broken file, a name that is none, or a domain without labels or data set.
    """
    named = {trained_and_evaluated(path): path for path in predictions}
    leaked = bool(leaks(read_split(split, by)))
    keys, truth = {}, {}
    for domain in sorted({evaluated for _, evaluated in named}):
        if domain not in labels or domain not in datasets:
            raise DetectError(f"domain {domain!r} is predicted on, but has no labels or no data set")
        keys[domain] = read_pictures(datasets[domain], TEST)
        truth[domain] = _read_labels(labels[domain], keys[domain])
    rows: list[dict[str, object]] = []
    performances: dict[tuple[str, str], pd.DataFrame] = {}
    for (trained, evaluated), path in sorted(named.items()):
        found = tables.read_parquet(path, PREDICTION_COLUMNS)
        found = found[found["key"].isin(keys[evaluated])]
        performance = instance_performance(truth[evaluated], found, options.iou_confidence)
        performances[trained, evaluated] = performance
        facts = {
            "trained": trained,
            "evaluated": evaluated,
            "split": by,
            "leaks_views": leaked,
            "judge": judge_name(options.model),
            "start": options.pretrained.name if options.pretrained else "scratch",
            "epochs": options.epochs,
            "imgsz": options.imgsz,
            "images": len(keys[evaluated]),
            "left_out": _left_out(datasets, trained, evaluated),
        }
        rows += [
            facts | figures for figures in detection_figures(keys[evaluated], truth[evaluated], found, performance)
        ]
    tables.write_parquet(detection, pd.DataFrame(rows, columns=list(DETECTION_COLUMNS)).round(_DIGITS))
    tables.write_parquet(ipd, _ipd_table(performances, options).round(_DIGITS))
    tables.write_parquet(instances, _instance_table(performances).round(_DIGITS))


def trained_and_evaluated(path: Path) -> tuple[str, str]:
    """Domains in the name of a prediction file.

    Raises
    ------
    DetectError
        The name is not `<trained>_on_<evaluated>.parquet`.
    """
    trained, between, evaluated = path.stem.partition("_on_")
    if not (trained and between and evaluated):
        raise DetectError(f"{path}: expected a name such as real_on_hapke.parquet")
    return trained, evaluated


def detection_figures(
    keys: Sequence[str], labels: pd.DataFrame, predictions: pd.DataFrame, performance: pd.DataFrame
) -> list[dict[str, object]]:
    """Kind, labels, map50, map50_95, iou_mean of each class, and as `all` the mean over classes that have labels.

    `performance` has the row of `instance_performance` of each label; the other two tables have kinds and boxes.
    """
    rows: list[dict[str, object]] = []
    for kind in BOX_CLASSES:
        labelled = _by_photo(labels[labels["kind"] == kind], BOX_COLUMNS, keys)
        predicted = _by_photo(predictions[predictions["kind"] == kind], (*BOX_COLUMNS, "confidence"), keys)
        precision = metrics.average_precision(labelled, [p[:, :4] for p in predicted], [p[:, 4] for p in predicted])
        overlap = performance.loc[performance["kind"] == kind, "iou"].to_numpy(float)
        rows.append(
            {
                "kind": kind,
                "labels": len(overlap),
                "map50": precision[0],
                "map50_95": precision.mean(),
                "iou_mean": overlap.mean() if len(overlap) else np.nan,
            }
        )
    figures = pd.DataFrame(rows)[["map50", "map50_95", "iou_mean"]]
    means = {str(name): float(value) for name, value in figures.mean().items()}  # a class without labels has none
    return [*rows, {"kind": ALL, "labels": len(performance)} | means]


def _left_out(datasets: Mapping[str, Path], trained: str, evaluated: str) -> int:
    """Corrupt pictures that a judge was not trained on or not tested on."""
    training = count_left_out(datasets[trained], (TRAIN, VAL)) if trained in datasets else 0
    return training + count_left_out(datasets[evaluated], (TEST,))


def _by_photo(table: pd.DataFrame, columns: Sequence[str], keys: Sequence[str]) -> list[np.ndarray]:
    """(n, columns) values of each photo, in the order of the keys."""
    found = {str(key): rows.to_numpy(float) for key, rows in table.groupby("key")[list(columns)]}
    return [found.get(key, np.zeros((0, len(columns)))) for key in keys]


def _read_labels(path: Path, keys: Sequence[str]) -> pd.DataFrame:
    """Labels of the evaluated pictures, cut at the photo's border as the data set's are."""
    table = tables.read_parquet(path, tables.LABEL_COLUMNS)
    table = table[table["key"].isin(keys)].copy()
    corners = boxes.clip(table[list(BOX_COLUMNS)].to_numpy(float))
    table[list(BOX_COLUMNS)] = corners
    return table[boxes.area(corners) > 0]


def _ipd_table(performances: Mapping[tuple[str, str], pd.DataFrame], options: DetectOptions) -> pd.DataFrame:
    rows = []
    for trained in sorted({trained for trained, _ in performances}):
        domains = sorted(evaluated for judge, evaluated in performances if judge == trained)
        for first, second in combinations(domains, 2):
            for kind in BOX_CLASSES:
                sides = (performances[trained, domain] for domain in (first, second))
                difference = instance_performance_difference(
                    *(side[side["kind"] == kind] for side in sides), seed=options.seed, resamples=options.resamples
                )
                rows.append({"trained": trained, "first": first, "second": second, "kind": kind, **asdict(difference)})
    return pd.DataFrame(rows, columns=list(IPD_COLUMNS))


def _instance_table(performances: Mapping[tuple[str, str], pd.DataFrame]) -> pd.DataFrame:
    parts = [
        table[list(INSTANCE_COLUMNS)].assign(trained=trained, evaluated=evaluated)
        for (trained, evaluated), table in sorted(performances.items())
    ]
    return pd.concat(parts, ignore_index=True)[["trained", "evaluated", *INSTANCE_COLUMNS]]
