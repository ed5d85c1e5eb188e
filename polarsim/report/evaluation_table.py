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
DIFFERENCE_NOTE = "Difference: the median of each further run less that of {run}."
MOST_LINES = 8  # of a summary
_OF_TERRAIN = ["terrain", *ROW_NAMES]


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


def compare_runs(*, runs: Sequence[Path], stem: Path, common: bool = False, differences: bool = False) -> pd.DataFrame:
    """Write stem.{csv,md,tex,parquet}: the metrics that the stages of the runs have measured so far.

    CSV and Parquet hold a row a run, terrain and metric; Markdown and LaTeX a row a metric and a column a terrain, in
    which the runs follow each other. Returns the rows.

    Parameters
    ----------
    runs
        Folders of the runs.
    stem
        Tables to write, without their ending.
    common
        Leave out each metric of a terrain that a run has not measured there.
    differences
        Add the column `difference`: the value less that of the first run; of Markdown and LaTeX, of the medians.

    Raises
    ------
    PolarsimError
        A run has measured nothing, or is named twice; the runs have no metric in common.
    FormatError
        A file of metrics is broken.
    """
    if twice := [run.name for number, run in enumerate(runs) if run in runs[:number]]:
        raise PolarsimError(f"run {twice[0]!r} is named twice")
    table = in_order(pd.concat([_measured(run) for run in runs], ignore_index=True))
    names = [run.name for run in runs]
    if common:
        table = _common(table, len(runs))
        if table.empty:
            raise PolarsimError(f"runs {', '.join(names)} have no metric of a terrain in common; --all compares all")
    if differences:
        first = table[table["run"] == names[0]].set_index(_OF_TERRAIN)["value"]
        of_first = first.reindex(pd.MultiIndex.from_frame(table[_OF_TERRAIN])).to_numpy()
        table["difference"] = np.where(table["run"] == names[0], np.nan, (table["value"] - of_first).round(9))
    caption = RUNS_CAPTION.format(runs=" / ".join(names))
    notes = [MEDIAN_NOTE, *([DIFFERENCE_NOTE.format(run=names[0])] if differences else [])]
    write_table(stem, table, caption, layout=format_runs(table, names, differences=differences), notes=notes)
    return table


def _common(table: pd.DataFrame, runs: int) -> pd.DataFrame:
    """Return the rows of the metrics that all runs have measured on the same terrain."""
    measured = table[table["value"].notna()]
    counts = measured.groupby(_OF_TERRAIN)["run"].transform("nunique")
    return measured[counts == runs].reset_index(drop=True)


def compared(table: pd.DataFrame, runs: Sequence[str]) -> list[str]:
    """Return lines that summarise a comparison: F1 of the labels, else the first metrics; at most `MOST_LINES`.

    Each has the medians of the runs in turn, the difference of each to the first run, and what each was measured on.
    """
    rows = format_runs(table, runs, differences=True)
    sizes = table.groupby([*ROW_NAMES, "run"], sort=False)["n"].sum().to_dict()
    of_labels = rows[(rows["stage"] == "labels") & (rows["metric"] == "f1")]
    chosen = (of_labels if len(of_labels) else rows).head(MOST_LINES)
    lines = []
    for row in chosen.to_dict("records"):
        names = tuple(row[name] for name in ROW_NAMES)
        counts = " / ".join(str(sizes.get((*names, run), MISSING)) for run in runs)
        unit = "" if row["unit"] == "1" else f" {row['unit']}"
        lines.append(
            f"{row['stage']}, {row['subject']}, {row['metric']}: {row['median']}{unit}, difference "
            f"{row['difference']}, n {counts}"
        )
    return lines


def _measured(run: Path) -> pd.DataFrame:
    """The metrics of a run, its name in front."""
    parts = sorted((run / "evaluation").glob("*.csv"))
    tables = [table for table in (read_csv(path) for path in parts) if set(COLUMNS) <= set(table.columns)]
    if not tables:
        raise PolarsimError("no metrics; run `snakemake geometry` or `snakemake tables` first", path=run / "evaluation")
    table = join_metrics(tables)
    table.insert(0, "run", run.name)
    return table


def format_runs(table: pd.DataFrame, runs: Sequence[str], *, differences: bool = False) -> pd.DataFrame:
    """A row a metric, a column a terrain with the value of every run in turn, and each run's median.

    With `differences` also the median of each further run less that of the first.
    """
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
        medians = _medians(values, runs)
        median = " / ".join(shown_value(value, unit) for value in medians)
        row = {**dict(zip(ROW_NAMES, map(str, names), strict=True)), **cells, "median": median}
        rows.append(row | ({"difference": _differences(medians, unit)} if differences else {}))
    return pd.DataFrame(rows)


def _differences(values: Sequence[float], unit: str) -> str:
    """Text of each further value less the first, with a sign."""
    found = [value - values[0] for value in values[1:]]
    return " / ".join(MISSING if math.isnan(one) else f"{one:+.{_SHOWN.get(unit, 3)}f}" for one in found) or MISSING


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
