"""Table of the metrics of all stages and terrains, and comparison of runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.errors import PolarsimError
from polarsim.formats.tables import read_csv, typed
from polarsim.photo import Terrain, terrain_text
from polarsim.report.layout import MISSING, format_value, write_table
from polarsim.schemas.evaluation import EVALUATION
from polarsim.scoring.consistency_warnings import warnings_of
from polarsim.scoring.metrics import BOX_METRICS, COLUMNS, STAGES, metrics_table
from polarsim.site import Site

CAPTION = "Metrics of every stage, a column per terrain. Unit 1: share or ratio; against: reference of the metric."
ROW_NAMES = ("stage", "subject", "metric", "unit", "against")
_SHOWN = {"mm": 2, "px": 2, "deg": 4, "1": 3, "%": 1, "m": 3}  # decimals by unit
RUNS_CAPTION = (
    "Metrics of the runs {runs}, in this order in every cell. Unit 1: share or ratio; against: reference of the metric."
)
MEDIAN_NOTE = (
    "Median: over the terrains shared by all runs that have the metric; no value if they share no terrain. The CSV "
    "file contains n."
)
DIFFERENCE_NOTE = "Difference: median of each further run minus median of {run}."
MAX_LINES = 8  # of a summary
_TERRAIN_METRIC = ["terrain", *ROW_NAMES]


def gather_evaluation(*, parts: list[Path], stem: Path, site: Site, origin: dict[str, str]) -> None:
    """Write tables/evaluation.{csv,md,tex,parquet} from the metric files of all stages and terrains.

    Notes below the table list the disagreements that the run's checks of consistency found.
    """
    table = join_metrics([read_csv(path, COLUMNS) for path in parts])
    notes = ["The CSV file contains n.", *warnings_of(table, site.images.width)]
    write_table(stem, table, CAPTION, layout=format_evaluation(table), notes=notes, origin=origin)


def join_metrics(parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Concatenate tables of metrics and sort the rows by stage and terrain."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return metrics_table("", 0, [])
    return sort_by_stage(typed(pd.concat(parts, ignore_index=True), EVALUATION))


def sort_by_stage(table: pd.DataFrame) -> pd.DataFrame:
    """Sort rows by stage, then by terrain; the sort is stable."""
    index = [STAGES.index(stage) if stage in STAGES else len(STAGES) for stage in table["stage"]]
    order = np.lexsort((np.arange(len(table)), table["terrain"].rank(method="dense"), np.array(index)))
    return table.iloc[order].reset_index(drop=True)


def format_evaluation(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per metric and a column per terrain; the four metrics of a box score share a row."""
    terrains = sorted(set(table["terrain"]))
    order: list[tuple[str, ...]] = []
    shown: dict[tuple[tuple[str, ...], int], str] = {}
    for terrain in terrains:
        at = 0  # a row that only this terrain has is inserted after the preceding row of this terrain
        for index, text in _shown_rows(table[table["terrain"] == terrain]):
            if index not in order:
                order.insert(at, index)
            at = order.index(index) + 1
            shown[index, terrain] = text
    order.sort(key=lambda index: STAGES.index(index[0]) if index[0] in STAGES else len(STAGES))
    rows = [[*index, *(shown.get((index, terrain), MISSING) for terrain in terrains)] for index in order]
    return pd.DataFrame(rows, columns=[*ROW_NAMES, *map(_heading, terrains)])


def _heading(terrain: Terrain) -> str:
    """Return the name of the column of a terrain."""
    return terrain if isinstance(terrain, str) else f"T{terrain_text(terrain)}"


def _shown_rows(table: pd.DataFrame) -> list[tuple[tuple[str, ...], str]]:
    """Return the index (`ROW_NAMES`) and the cell of each row of one terrain."""
    texts_of: dict[tuple[str, ...], list[str]] = {}
    scored = {(row["stage"], row["subject"]) for row in table.to_dict("records") if row["metric"] == "f1"}
    for entry in table.to_dict("records"):
        joined = entry["metric"] in BOX_METRICS and (entry["stage"], entry["subject"]) in scored
        names = {**entry, "metric": " / ".join(BOX_METRICS) if joined else entry["metric"]}
        text = shown_value(float(entry["value"]), str(entry["unit"]))
        texts_of.setdefault(tuple(str(names[name]) for name in ROW_NAMES), []).append(text)
    return [(index, " / ".join(texts)) for index, texts in texts_of.items()]


def shown_value(value: float, unit: str) -> str:
    """Return the value as text with the decimals of the unit."""
    if math.isnan(value):
        return MISSING
    counted = unit == "1" and value > 1 and value == round(value)  # no share is larger
    if unit in _SHOWN and not counted:
        return f"{value:.{_SHOWN[unit]}f}"
    return f"{value:.0f}" if value == round(value) else format_value(value)


def compare_runs(*, runs: Sequence[Path], stem: Path, common: bool = False, differences: bool = False) -> pd.DataFrame:
    """Write the available metrics of several runs as stem.{csv,md,tex,parquet} and return the rows.

    CSV and Parquet have a row per run, terrain and metric. Markdown and LaTeX have a row per metric and one column per
    terrain; a cell lists the values of all runs. `common` keeps only the metrics of a terrain that all runs have.
    `differences` adds the column `difference`: the value minus that of the first run (in Markdown and LaTeX: of the
    medians).
    """
    if twice := [run.name for number, run in enumerate(runs) if run in runs[:number]]:
        raise PolarsimError(f"run {twice[0]!r} is given twice, name each run once")
    table = sort_by_stage(pd.concat([_read_metrics(run) for run in runs], ignore_index=True))
    names = [run.name for run in runs]
    if common:
        table = _common(table, len(runs))
        if table.empty:
            raise PolarsimError(
                f"runs {', '.join(names)} have no metric of a terrain in common; use --all to list all metrics"
            )
    if differences:
        first = table[table["run"] == names[0]].set_index(_TERRAIN_METRIC)["value"]
        of_first = first.reindex(pd.MultiIndex.from_frame(table[_TERRAIN_METRIC])).to_numpy()
        table["difference"] = np.where(table["run"] == names[0], np.nan, (table["value"] - of_first).round(9))
    caption = RUNS_CAPTION.format(runs=" / ".join(names))
    notes = [MEDIAN_NOTE, *([DIFFERENCE_NOTE.format(run=names[0])] if differences else [])]
    write_table(stem, table, caption, layout=format_runs(table, names, differences=differences), notes=notes)
    return table


def _common(table: pd.DataFrame, runs: int) -> pd.DataFrame:
    """Return the rows of the metrics that all runs have for the same terrain."""
    measured = table[table["value"].notna()]
    counts = measured.groupby(_TERRAIN_METRIC)["run"].transform("nunique")
    return measured[counts == runs].reset_index(drop=True)


def comparison_lines(table: pd.DataFrame, runs: Sequence[str]) -> list[str]:
    """Return at most `MAX_LINES` lines that summarise a comparison: F1 of the labels, else the first metrics.

    Each line contains the median of each run, the differences to the first run and the number of samples n of each run.
    """
    rows = format_runs(table, runs, differences=True)
    sizes = table.groupby([*ROW_NAMES, "run"], sort=False)["n"].sum().to_dict()
    of_labels = rows[(rows["stage"] == "labels") & (rows["metric"] == "f1")]
    chosen = (of_labels if len(of_labels) else rows).head(MAX_LINES)
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


def _read_metrics(run: Path) -> pd.DataFrame:
    """Return the metrics of a run with the name of the run in the first column."""
    parts = sorted((run / "evaluation").glob("*.csv"))
    tables = [table for table in (read_csv(path) for path in parts) if set(COLUMNS) <= set(table.columns)]
    if not tables:
        raise PolarsimError("no metrics; run `snakemake geometry` or `snakemake tables` first", path=run / "evaluation")
    table = join_metrics(tables)
    table.insert(0, "run", run.name)
    return table


def format_runs(table: pd.DataFrame, runs: Sequence[str], *, differences: bool = False) -> pd.DataFrame:
    """Return a row per metric: a column per terrain with the values of all runs, and the medians of the runs.

    `differences` adds the median of each further run minus that of the first run.
    """
    rows = []
    for names, metrics in table.groupby(list(ROW_NAMES), sort=False):
        unit = str(metrics["unit"].iloc[0])
        values = metrics.set_index(["terrain", "run"])["value"].to_dict()
        cells = {
            _heading(terrain): " / ".join(
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
    """Return the differences of the further values to the first as text with signs."""
    changes = [value - values[0] for value in values[1:]]
    decimals = _SHOWN.get(unit, 3)
    return " / ".join(MISSING if math.isnan(change) else f"{change:+.{decimals}f}" for change in changes) or MISSING


def _medians(values: Mapping[Any, float], runs: Sequence[str]) -> list[float]:
    """Return the median of each run over the terrains where all runs that have the metric have a finite value."""
    finite = {at: value for at, value in values.items() if not math.isnan(value)}
    terrains_of = {run: {terrain for terrain, run_of_value in finite if run_of_value == run} for run in runs}
    measured = [terrains for terrains in terrains_of.values() if terrains]
    shared = set.intersection(*measured) if measured else set()
    medians = []
    for run in runs:
        shared_values = [finite[terrain, run] for terrain in sorted(shared & terrains_of[run])]
        medians.append(float(np.median(shared_values)) if shared_values else math.nan)
    return medians
