"""Evaluation metrics, written to a file per stage and terrain with a row per metric."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from polarsim.formats.tables import typed, write_csv
from polarsim.photo import Terrain
from polarsim.schemas.evaluation import EVALUATION

COLUMNS = EVALUATION.columns
STAGES = ("cameras", "rocks", "consistency", "labels", "render", "materials")

BOX_METRICS = ("precision", "recall", "f1", "miou")  # of every box score, in this order

Against = Literal["truth", "labels", "photos", "own"]
TRUTH_NAMES = {"truth": "the analog's truth", "labels": "hand-annotated labels"}


@dataclass(frozen=True)
class Metric:
    """Value of a metric. `n` is the sample size; an undefined value is NaN."""

    subject: str  # evaluated part: a position, a kind of label and the task, a class of rocks
    metric: str
    value: float
    unit: str  # "mm", "px", "deg", "1" (a share or ratio), or the name of counted items
    n: int
    against: Against  # reference: truth of the analog, annotated labels, photos, or "own" for values of the stage


def summary_metric(
    subject: str, metric: str, values: np.ndarray, unit: str, against: Against, p90: bool = True
) -> list[Metric]:
    """Return the median and the 90th percentile of values (n,); empty without finite values."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if not len(values):
        return []
    metrics = [Metric(subject, f"{metric}_median", float(np.median(values)), unit, len(values), against)]
    if p90:
        metrics.append(Metric(subject, f"{metric}_p90", float(np.percentile(values, 90)), unit, len(values), against))
    return metrics


def metrics_of(subject: str, n: int, against: Against, **values: tuple[float, str]) -> list[Metric]:
    """Return metrics of a subject: values and units by name."""
    return [Metric(subject, name, float(value), unit, n, against) for name, (value, unit) in values.items()]


def metrics_table(stage: str, terrain: Terrain, metrics: Iterable[Metric]) -> pd.DataFrame:
    """Return metrics as a table with `COLUMNS`, in the given order."""
    table = typed([(stage, terrain, *astuple(metric)) for metric in metrics], EVALUATION)
    return table.round({"value": 9})  # removes rounding noise


def write_metrics(path: Path, stage: str, terrain: Terrain, metrics: Sequence[Metric]) -> None:
    write_csv(path, metrics_table(stage, terrain, metrics))
