"""The evaluation of every stage in one table, over terrains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.errors import PolarsimError
from polarsim.formats.tables import read_csv
from polarsim.report.layout import MISSING, format_value, origin_note, with_origin, write_table
from polarsim.scoring.complaints import complaints
from polarsim.scoring.metrics import BOX_METRICS, COLUMNS, STAGES, metrics_table

CAPTION = "Quality of every stage. Unit 1: a share or ratio; against: what a metric is measured against."
ROW_NAMES = ("stage", "subject", "metric", "unit", "against")
_SHOWN = {"mm": 2, "px": 2, "deg": 4, "1": 3, "%": 1, "m": 3}  # decimals by unit
RUNS_CAPTION = (
    "Quality of {runs}, in this order in every cell. Unit 1: a share or ratio; against: what a metric is measured "
    "against."
)
MEDIAN_NOTE = (
    "Medians: of each run over the terrains that all runs with this metric have; none where they share no terrain. "
    "n is in the CSV form."
)


def gather_evaluation(*, parts: list[Path], stem: Path, origin: dict[str, str]) -> None:
    """Write tables/evaluation.{csv,md,tex,parquet} from the metric files of all stages and terrains.

    What does not agree with itself is said below the table.
    """
    table = join_metrics([read_csv(path, COLUMNS) for path in parts])
    notes = ["Terrains stand side by side; n is in the CSV form.", *complaints(table), origin_note(origin)]
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_evaluation(table), notes=notes)


def join_metrics(parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """All rows in the order of the stages, then of the terrains."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return metrics_table("", 0, [])
    table = pd.concat(parts, ignore_index=True)[list(COLUMNS)]
    table = table.astype({"unit": "str", "subject": "str", "value": "float64", "terrain": "int64", "n": "int64"})
    return in_order(table)


def in_order(table: pd.DataFrame) -> pd.DataFrame:
    """Rows in the order of the stages, then of the terrains, else as they came."""
    index = [STAGES.index(stage) if stage in STAGES else len(STAGES) for stage in table["stage"]]
    order = np.lexsort((np.arange(len(table)), table["terrain"].to_numpy(), np.array(index)))
    return table.iloc[order].reset_index(drop=True)


def format_evaluation(table: pd.DataFrame) -> pd.DataFrame:
    """A row a metric, a column a terrain; the four metrics of a box score share a row."""
    terrains = sorted(set(table["terrain"]))
    order: list[tuple[str, ...]] = []
    shown: dict[tuple[tuple[str, ...], int], str] = {}
    for terrain in terrains:
        at = 0  # a terrain's new rows stand behind those that went before them there
        for index, text in _shown_rows(table[table["terrain"] == terrain]):
            if index not in order:
                order.insert(at, index)
            at = order.index(index) + 1
            shown[index, terrain] = text
    order.sort(key=lambda index: STAGES.index(index[0]) if index[0] in STAGES else len(STAGES))
    rows = [[*index, *(shown.get((index, terrain), MISSING) for terrain in terrains)] for index in order]
    return pd.DataFrame(rows, columns=[*ROW_NAMES, *(f"T{terrain:02d}" for terrain in terrains)])


def _shown_rows(table: pd.DataFrame) -> list[tuple[tuple[str, ...], str]]:
    """What names a row, and its cell, for one terrain in order."""
    found: dict[tuple[str, ...], list[str]] = {}
    scored = {(row["stage"], row["subject"]) for row in table.to_dict("records") if row["metric"] == "f1"}
    for entry in table.to_dict("records"):
        joined = entry["metric"] in BOX_METRICS and (entry["stage"], entry["subject"]) in scored
        names = {**entry, "metric": " / ".join(BOX_METRICS) if joined else entry["metric"]}
        text = shown_value(float(entry["value"]), str(entry["unit"]))
        found.setdefault(tuple(str(names[name]) for name in ROW_NAMES), []).append(text)
    return [(index, " / ".join(texts)) for index, texts in found.items()]


def shown_value(value: float, unit: str) -> str:
    """Text of a metric, with the decimals of its unit."""
    if math.isnan(value):
        return MISSING
    counted = unit == "1" and value > 1 and value == round(value)  # no share is larger
    if unit in _SHOWN and not counted:
        return f"{value:.{_SHOWN[unit]}f}"
    return f"{value:.0f}" if value == round(value) else format_value(value)


def compare_runs(*, runs: Sequence[Path], stem: Path) -> None:
    """Write stem.{csv,md,tex,parquet}: every metric that the stages of the runs have measured so far.

    CSV and Parquet hold a row a run, terrain and metric; Markdown and LaTeX a row a metric and a column a terrain, in
    which the runs follow each other.

    Raises
    ------
    PolarsimError
        A run has measured nothing, or is named twice.
    FormatError
        A file of metrics is broken.
    """
    if twice := [run.name for number, run in enumerate(runs) if run in runs[:number]]:
        raise PolarsimError(f"run {twice[0]!r} is named twice")
    table = in_order(pd.concat([_measured(run) for run in runs], ignore_index=True))
    names = [run.name for run in runs]
    caption = RUNS_CAPTION.format(runs=" / ".join(names))
    write_table(stem, table, caption, layout=format_runs(table, names), notes=[MEDIAN_NOTE])


def _measured(run: Path) -> pd.DataFrame:
    """The metrics of a run, its name in front."""
    parts = sorted((run / "evaluation").glob("*.csv"))
    tables = [table for table in (read_csv(path) for path in parts) if set(COLUMNS) <= set(table.columns)]
    if not tables:
        raise PolarsimError("no metrics; run `snakemake geometry` or `snakemake tables` first", path=run / "evaluation")
    table = join_metrics(tables)
    table.insert(0, "run", run.name)
    return table


def format_runs(table: pd.DataFrame, runs: Sequence[str]) -> pd.DataFrame:
    """A row a metric, a column a terrain with the value of every run in turn, and each run's median."""
    rows = []
    for names, metrics in table.groupby(list(ROW_NAMES), sort=False):
        unit = str(metrics["unit"].iloc[0])
        values = metrics.set_index(["terrain", "run"])["value"].to_dict()
        cells = {
            f"T{terrain:02d}": " / ".join(
                shown_value(values[terrain, run], unit) if (terrain, run) in values else MISSING for run in runs
            )
            for terrain in sorted(set(table["terrain"]))
        }
        median = " / ".join(shown_value(value, unit) for value in _medians(values, runs))
        rows.append({**dict(zip(ROW_NAMES, map(str, names), strict=True)), **cells, "median": median})
    return pd.DataFrame(rows)


def _medians(values: Mapping[Any, float], runs: Sequence[str]) -> list[float]:
    """Median of each run over what can be compared: terrains where every run that has the metric has a number."""
    there = {at: value for at, value in values.items() if not math.isnan(value)}
    terrains_of = {run: {terrain for terrain, own in there if own == run} for run in runs}
    measured = [terrains for terrains in terrains_of.values() if terrains]
    shared = set.intersection(*measured) if measured else set()
    medians = []
    for run in runs:
        own = [there[terrain, run] for terrain in sorted(shared & terrains_of[run])]
        medians.append(float(np.median(own)) if own else math.nan)
    return medians
