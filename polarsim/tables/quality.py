"""Figures of quality, one row each, and the table that gathers them over terrains and stages."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_csv, write_csv
from polarsim.tables.complaints import complaints
from polarsim.tables.layout import MISSING, format_value, origin_note, with_origin, write_table

COLUMNS = ("stage", "terrain", "subject", "figure", "value", "unit", "n", "against")
STAGES = ("cameras", "rocks", "consistency", "labels", "render", "materials")
CAPTION = "Quality of every stage. Unit 1: a share or ratio; against: what a figure is measured against."

BOX_FIGURES = ("precision", "recall", "f1", "miou")  # of every box score, in this order

Against = Literal["truth", "labels", "photos", "own"]
TRUTH_NAMES = {"truth": "the analog's truth", "labels": "hand-drawn labels"}
ROW_NAMES = ("stage", "subject", "figure", "unit", "against")
_SHOWN = {"mm": 2, "px": 2, "deg": 4, "1": 3, "%": 1, "m": 3}  # decimals by unit


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


def gather_quality(*, parts: list[Path], stem: Path, origin: dict[str, str]) -> None:
    """Write tables/quality.{csv,md,tex,parquet} from the quality files of all stages and terrains.

    What does not agree with itself is said below the table.
    """
    table = join_quality([read_csv(path, COLUMNS) for path in parts])
    notes = ["Terrains stand side by side; n is in the CSV form.", *complaints(table), origin_note(origin)]
    write_table(stem, with_origin(table, origin), CAPTION, layout=lay_out_quality(table), notes=notes)


def join_quality(parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """All rows in the order of the stages, then of the terrains."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return quality_table("", 0, [])
    table = pd.concat(parts, ignore_index=True)[list(COLUMNS)]
    table = table.astype({"unit": "str", "subject": "str", "value": "float64", "terrain": "int64", "n": "int64"})
    return in_order(table)


def in_order(table: pd.DataFrame) -> pd.DataFrame:
    """Rows in the order of the stages, then of the terrains, else as they came."""
    place = [STAGES.index(stage) if stage in STAGES else len(STAGES) for stage in table["stage"]]
    order = np.lexsort((np.arange(len(table)), table["terrain"].to_numpy(), np.array(place)))
    return table.iloc[order].reset_index(drop=True)


def lay_out_quality(table: pd.DataFrame) -> pd.DataFrame:
    """A row a figure, a column a terrain; the four figures of a box score share a row."""
    terrains = sorted(set(table["terrain"]))
    order: list[tuple[str, ...]] = []
    shown: dict[tuple[tuple[str, ...], int], str] = {}
    for terrain in terrains:
        at = 0  # a terrain's new rows stand behind those that went before them there
        for place, text in _shown_rows(table[table["terrain"] == terrain]):
            if place not in order:
                order.insert(at, place)
            at = order.index(place) + 1
            shown[place, terrain] = text
    order.sort(key=lambda place: STAGES.index(place[0]) if place[0] in STAGES else len(STAGES))
    rows = [[*place, *(shown.get((place, terrain), MISSING) for terrain in terrains)] for place in order]
    return pd.DataFrame(rows, columns=[*ROW_NAMES, *(f"T{terrain:02d}" for terrain in terrains)])


def _shown_rows(table: pd.DataFrame) -> list[tuple[tuple[str, ...], str]]:
    """What names a row, and its cell, for one terrain in order."""
    found: dict[tuple[str, ...], list[str]] = {}
    scored = {(row["stage"], row["subject"]) for row in table.to_dict("records") if row["figure"] == "f1"}
    for entry in table.to_dict("records"):
        joined = entry["figure"] in BOX_FIGURES and (entry["stage"], entry["subject"]) in scored
        names = {**entry, "figure": " / ".join(BOX_FIGURES) if joined else entry["figure"]}
        text = shown_value(float(entry["value"]), str(entry["unit"]))
        found.setdefault(tuple(str(names[name]) for name in ROW_NAMES), []).append(text)
    return [(place, " / ".join(texts)) for place, texts in found.items()]


def shown_value(value: float, unit: str) -> str:
    """Text of a figure, with the decimals of its unit."""
    if math.isnan(value):
        return MISSING
    counted = unit == "1" and value > 1 and value == round(value)  # no share is larger
    if unit in _SHOWN and not counted:
        return f"{value:.{_SHOWN[unit]}f}"
    return f"{value:.0f}" if value == round(value) else format_value(value)
