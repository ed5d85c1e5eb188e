"""Figures of quality: one row each, in a file a stage and terrain."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from polarsim.formats.tables import write_csv

COLUMNS = ("stage", "terrain", "subject", "figure", "value", "unit", "n", "against")
STAGES = ("cameras", "rocks", "consistency", "labels", "render", "materials")

BOX_FIGURES = ("precision", "recall", "f1", "miou")  # of every box score, in this order

Against = Literal["truth", "labels", "photos", "own"]
TRUTH_NAMES = {"truth": "the analog's truth", "labels": "hand-drawn labels"}


@dataclass(frozen=True)
class Figure:
    """One measured figure. `n` counts what it was measured on; NaN stands for "cannot be said"."""

    subject: str  # of which part: a position, a kind of label and its task, a class of rocks
    figure: str
    value: float
    unit: str  # "mm", "px", "deg", "1" (a share or ratio), or what is counted
    n: int
    against: Against  # truth: the analog's own; labels: hand-drawn; photos: pixels; own: what the stage itself reports


def summary(
    subject: str, figure: str, values: np.ndarray, unit: str, against: Against, p90: bool = True
) -> list[Figure]:
    """Median, and 90th percentile, of values (n,); nothing when there are none."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if not len(values):
        return []
    found = [Figure(subject, f"{figure}_median", float(np.median(values)), unit, len(values), against)]
    if p90:
        found.append(Figure(subject, f"{figure}_p90", float(np.percentile(values, 90)), unit, len(values), against))
    return found


def quality_table(stage: str, terrain: int, figures: Iterable[Figure]) -> pd.DataFrame:
    """Rows with `COLUMNS`, in the order of the figures."""
    table = pd.DataFrame([(stage, terrain, *astuple(figure)) for figure in figures], columns=list(COLUMNS))
    table["value"] = table["value"].astype("float64").round(9)  # below that is the dust of sums
    return table.astype({"terrain": "int64", "n": "int64"})


def write_quality(path: Path, stage: str, terrain: int, figures: Sequence[Figure]) -> None:
    write_csv(path, quality_table(stage, terrain, figures))
