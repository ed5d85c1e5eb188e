"""The gap ledger: what changes of the gap between photos and twins when one ingredient of the twin is replaced.

Photos, twin and the twin with the ingredient replaced are judged by the same judges, which are not trained again, on
the same photos. What changes is paired: the same rocks, and the same resamples of views for both twins, so an interval
is that of the change and not of two figures beside each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.detect import bootstrap, metrics
from polarsim.detect.breakdown import boxes_by_photo
from polarsim.detect.dataset import BOX_COLUMNS, read_pictures
from polarsim.detect.evaluate import read_labels
from polarsim.detect.false_alarms import alarms_of_photos
from polarsim.detect.ipd import Rules, instance_performance, pair
from polarsim.detect.judges import judge_name
from polarsim.detect.options import DetectOptions
from polarsim.detect.predict import PREDICTION_COLUMNS
from polarsim.detect.split import TEST
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.progress import track

FIGURES = ("ipd", "ipd_abs", "map50", "alarms", "alarm_area")  # each: of the twin, with the ingredient, and the change
ENDS = ("_twin", "", "_change", "_change_low", "_change_high")
FIGURE_COLUMNS = tuple(f"{figure}{end}" for figure in FIGURES for end in ENDS)
LEDGER_COLUMNS = (
    "ingredient", "replaced", "model", "trained", "kind", "judge", "epochs", "imgsz", "images", "units", "unit",
    "pairs", "iou_photo", "iou_twin", "iou", "map50_photo", "alarms_photo", "alarm_area_photo", *FIGURE_COLUMNS,
)  # fmt: skip
_AT_HALF = np.array([0.5])
_PLACE = ["key", "kind", "rock"]
_DIGITS = 6


@dataclass(frozen=True)
class Seen:
    """One domain through one judge.

    Attributes
    ----------
    keys
        Of the photos that count.
    labels : DataFrame
        Columns key, kind, rock, x0, y0, x1, y1.
    predictions : DataFrame
        Columns key, kind, confidence, x0, y0, x1, y1.
    """

    keys: Sequence[str]
    labels: pd.DataFrame
    predictions: pd.DataFrame
    options: DetectOptions

    @cached_property
    def performance(self) -> pd.DataFrame:
        labels, found = (table[table["key"].isin(self.keys)] for table in (self.labels, self.predictions))
        return instance_performance(labels, found, self.options.iou_confidence)

    @cached_property
    def alarms(self) -> pd.DataFrame:
        return alarms_of_photos(
            self.keys,
            self.labels,
            self.predictions,
            confidence=self.options.iou_confidence,
            overlap=self.options.false_alarm_overlap,
        )

    @cached_property
    def precision(self) -> dict[str, np.ndarray]:
        """(1 + resamples,) mAP@0.5 by class: as it is, then of each draw."""
        unit, drawn = self.draws
        found = {}
        for kind in BOX_CLASSES:
            labels = boxes_by_photo(self.labels[self.labels["kind"] == kind], BOX_COLUMNS, self.keys)
            rows = self.predictions[self.predictions["kind"] == kind]
            predicted = boxes_by_photo(rows, (*BOX_COLUMNS, "confidence"), self.keys)
            corners, sure = [found[:, :4] for found in predicted], [found[:, 4] for found in predicted]
            ranked = metrics.rank(labels, corners, sure, _AT_HALF)
            again = bootstrap.resampled_precision(ranked, 0, unit, drawn)[:, 0]
            found[kind] = np.concatenate([metrics.precision_at_recalls(ranked).mean(axis=1), again])
        return found

    def rates(self, column: str) -> np.ndarray:
        """(1 + resamples,) a column of `alarms` over the rock-free area: as it is, then of each draw."""
        unit, drawn = self.draws
        total, free = (np.bincount(unit, self.alarms[name], drawn.shape[1]) for name in (column, "free"))
        every = np.concatenate([np.ones((1, drawn.shape[1])), drawn])
        return np.divide(every @ total, every @ free, out=np.full(len(every), np.nan), where=every @ free > 0)

    @cached_property
    def draws(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit of each photo, and how often each unit is drawn: the same for all that have the same photos."""
        unit = bootstrap.units_of(self.keys, self.options.resampled)
        return unit, bootstrap.draws(int(unit.max()) + 1, self.options.resamples, self.options.seed)


def weigh(photo: Seen, twin: Seen, replaced: Seen) -> pd.DataFrame:
    """What one judge says of one ingredient: from `images` on the columns of `LEDGER_COLUMNS`, a row a class.

    The three have the same keys and options.
    """
    units = photo.draws[1].shape[1]
    rows = []
    for kind in BOX_CLASSES:
        facts = {"kind": kind, "images": len(photo.keys), "units": units, "unit": photo.options.resampled}
        row: dict[str, object] = {**facts, **_performances(kind, photo, twin, replaced)}
        row |= {"map50_photo": float(photo.precision[kind][0])}
        row |= _change("map50", twin.precision[kind], replaced.precision[kind], units)
        for name, column in (("alarms", "alarms"), ("alarm_area", "area")) if kind == ROCK else ():
            row |= {f"{name}_photo": float(photo.rates(column)[0])}
            row |= _change(name, twin.rates(column), replaced.rates(column), units)
        rows.append(row)
    columns = LEDGER_COLUMNS[LEDGER_COLUMNS.index("images") :]
    return pd.DataFrame(rows, columns=["kind", *columns])


def write_ledger(
    *,
    predictions: Mapping[tuple[str, str], Path],
    labels: Mapping[str, Path],
    datasets: Mapping[str, Path],
    photo: str,
    twin: str,
    replaced: Mapping[str, str],
    ledger: Path,
    options: DetectOptions,
) -> None:
    """Write `LEDGER_COLUMNS`, a row an ingredient, judge and class.

    Parameters
    ----------
    predictions
        By what a judge was trained on, and the domain that it saw: photos, twin, or an ingredient.
    labels, datasets
        Label table and data set of each of these domains. Photos count that all data sets have in their test part.
    photo, twin
        The domains of the photos and of the twin as the run has it.
    replaced
        What each ingredient replaces, in words; in the order of the ledger.

    Raises
    ------
    PolarsimError
        A broken file, or no photo in all domains.
    """
    keys = sorted(set.intersection(*(set(read_pictures(dataset, TEST)) for dataset in datasets.values())))
    if not keys:
        raise DetectError("no test picture that every twin of the ledger has", path=datasets[photo])
    truth = {domain: read_labels(path) for domain, path in labels.items()}
    facts: dict[str, Any] = {
        "model": twin,
        "judge": judge_name(options.model),
        "epochs": options.epochs,
        "imgsz": options.imgsz,
    }
    parts = []
    for trained in track(sorted({trained for trained, _ in predictions}), "gap ledger"):
        seen = {
            domain: Seen(keys, truth[domain], tables.read_parquet(path, PREDICTION_COLUMNS), options)
            for (judge, domain), path in predictions.items()
            if judge == trained
        }
        for ingredient, words in replaced.items():
            rows = weigh(seen[photo], seen[twin], seen[ingredient])
            parts.append(rows.assign(ingredient=ingredient, replaced=words, trained=trained, **facts))
    table = pd.concat(parts, ignore_index=True)[list(LEDGER_COLUMNS)]
    tables.write_parquet(ledger, table.round(_DIGITS))


def _performances(kind: str, photo: Seen, twin: Seen, replaced: Seen) -> dict[str, object]:
    """Mean IoU and IPD over the rocks that photo, twin and the other twin have; IPD as in `ipd`, change by change."""
    options = photo.options
    rules = Rules(options.undetected, options.unpaired, options.resampled)
    own = [seen.performance[seen.performance["kind"] == kind] for seen in (photo, twin, replaced)]
    as_is, other = (pair(own[0], side, rules) for side in own[1:])
    pairs = as_is.merge(other.drop(columns="first"), on=_PLACE, suffixes=("", "_replaced"), validate="one_to_one")
    if pairs.empty:
        return {"pairs": 0}
    unit = bootstrap.units_of(pairs["key"].astype(str).tolist(), rules.unit)
    units = int(unit.max()) + 1
    drawn = bootstrap.draws(units, options.resamples, options.seed)
    gain, other_gain = ((pairs["first"] - pairs[name]).to_numpy(float) for name in ("second", "second_replaced"))
    row: dict[str, object] = {"pairs": len(pairs), "iou_photo": pairs["first"].mean()}
    row |= {"iou_twin": pairs["second"].mean(), "iou": pairs["second_replaced"].mean()}
    row |= _change("ipd", np.abs(_means(gain, unit, drawn)), np.abs(_means(other_gain, unit, drawn)), units)
    return row | _change("ipd_abs", _means(np.abs(gain), unit, drawn), _means(np.abs(other_gain), unit, drawn), units)


def _means(values: np.ndarray, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """(1 + resamples,) mean of values (n,), and of those whose units are drawn."""
    return np.concatenate([[values.mean()], bootstrap.resampled_means(values, unit, drawn)])


def _change(name: str, twin: np.ndarray, replaced: np.ndarray, units: int) -> dict[str, float]:
    """Both figures, their difference and its interval, from values (1 + resamples,) under the same draws."""
    low, high = bootstrap.interval(replaced[1:] - twin[1:], units)
    values = (float(twin[0]), float(replaced[0]), float(replaced[0] - twin[0]), low, high)
    return dict(zip((f"{name}{end}" for end in ENDS), values, strict=True))
