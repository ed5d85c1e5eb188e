"""Metrics of evaluation: one row each, in a file a stage and terrain."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from polarsim.formats.tables import write_csv
from polarsim.schemas.evaluation import EVALUATION

COLUMNS = EVALUATION.columns
STAGES = ("cameras", "rocks", "consistency", "labels", "render", "materials")

BOX_METRICS = ("precision", "recall", "f1", "miou")  # of every box score, in this order

Against = Literal["truth", "labels", "photos", "own"]
TRUTH_NAMES = {"truth": "the analog's truth", "labels": "hand-annotated labels"}


@dataclass(frozen=True)
class Metric:
    """One measured metric. `n` counts what it was measured on; NaN stands for "cannot be said"."""

    subject: str  # of which part: a position, a kind of label and its task, a class of rocks
    metric: str
    value: float
    unit: str  # "mm", "px", "deg", "1" (a share or ratio), or what is counted
    n: int
    against: Against  # the analog's truth, hand-annotated labels, photos' pixels, or what the stage itself reports


def summary(
    subject: str, metric: str, values: np.ndarray, unit: str, against: Against, p90: bool = True
) -> list[Metric]:
    """Median, and 90th percentile, of values (n,); nothing when there are none."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if not len(values):
        return []
    found = [Metric(subject, f"{metric}_median", float(np.median(values)), unit, len(values), against)]
    if p90:
        found.append(Metric(subject, f"{metric}_p90", float(np.percentile(values, 90)), unit, len(values), against))
    return found


def metrics_table(stage: str, terrain: int, metrics: Iterable[Metric]) -> pd.DataFrame:
    """Rows with `COLUMNS`, in the order of the metrics."""
    table = pd.DataFrame([(stage, terrain, *astuple(metric)) for metric in metrics], columns=list(COLUMNS))
    table["value"] = table["value"].astype("float64").round(9)  # below that is the dust of sums
    return table.astype({"terrain": "int64", "n": "int64"})


def write_metrics(path: Path, stage: str, terrain: int, metrics: Sequence[Metric]) -> None:
    write_csv(path, metrics_table(stage, terrain, metrics))
