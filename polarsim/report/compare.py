"""The evaluation of several runs side by side: of other seeds, other options, other versions of the code."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from polarsim.errors import PolarsimError
from polarsim.formats.tables import read_csv
from polarsim.report.evaluation_table import ROW_NAMES, in_order, join_metrics, shown_value
from polarsim.report.layout import MISSING, write_table
from polarsim.scoring.metrics import COLUMNS

CAPTION = "Quality of several runs. Unit 1: a share or ratio; against: what a metric is measured against."


def compare_runs(*, runs: Sequence[Path], stem: Path) -> None:
    """Write stem.{csv,md,tex,parquet}: every metric that the stages of the runs have measured so far.

    CSV and Parquet hold a row a run, terrain and metric; Markdown and LaTeX a row a metric and a column a terrain, in
    which the runs follow each other.

    Raises
    ------
    PolarsimError
        A run has measured nothing.
    FormatError
        A file of metrics is broken.
    """
    table = in_order(pd.concat([_measured(run) for run in runs], ignore_index=True))
    notes = [f"Cells: {' / '.join(run.name for run in runs)}. The median is over runs and terrains; n is in the CSV."]
    write_table(stem, table, CAPTION, layout=format_table(table, [run.name for run in runs]), notes=notes)


def _measured(run: Path) -> pd.DataFrame:
    """The metrics of a run, its name in front."""
    parts = sorted((run / "evaluation").glob("*.csv"))
    tables = [table for table in (read_csv(path) for path in parts) if set(COLUMNS) <= set(table.columns)]
    if not tables:
        raise PolarsimError("no metrics; run `snakemake geometry` or `snakemake tables` first", path=run / "evaluation")
    table = join_metrics(tables)
    table.insert(0, "run", run.name)
    return table


def format_table(table: pd.DataFrame, runs: Sequence[str]) -> pd.DataFrame:
    """A row a metric, a column a terrain with the value of every run in turn, and the median of them all."""
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
        median = shown_value(float(metrics["value"].median()), unit)
        rows.append({**dict(zip(ROW_NAMES, map(str, names), strict=True)), **cells, "median": median})
    return pd.DataFrame(rows)
