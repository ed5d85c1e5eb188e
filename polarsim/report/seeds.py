"""Several trainings that differ in their seed alone: one figure with its spread."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from polarsim.report.layout import MISSING

SEED = "seed"


def over_seeds(values: pd.Series, decimals: int = 3) -> str:
    """The value, or mean ± standard deviation (of a sample) of several; values that are missing do not count."""
    known = values.dropna()
    if not len(known):
        return MISSING
    if len(known) == 1:
        return f"{known.iloc[0]:.{decimals}f}"
    return f"{known.mean():.{decimals}f} ± {known.std(ddof=1):.{decimals}f}"


def with_interval(row: pd.Series, name: str, decimals: int = 3) -> str:
    """A figure and its 95 % interval, where it has one."""
    value, low, high = (float(row[column]) for column in (name, f"{name}_low", f"{name}_high"))
    if value != value:  # NaN
        return MISSING
    interval = f" [{low:.{decimals}f}, {high:.{decimals}f}]" if low == low and high == high else ""
    return f"{value:.{decimals}f}{interval}"


def shown(part: pd.DataFrame, name: str, decimals: int = 3) -> str:
    """A cell of one training with its interval, or of several with their spread."""
    if len(part) == 1:
        return with_interval(part.iloc[0], name, decimals)
    return over_seeds(part[name], decimals)


def panels(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """What figures show beside each other: the rows of each split by its name, or all rows where no split is told."""
    if "split" not in table.columns or not len(table):
        return [("", table.reset_index(drop=True))]
    return [(str(split), rows.reset_index(drop=True)) for split, rows in table.groupby("split", sort=False)]


def title_text(table: pd.DataFrame) -> str:
    """The only split, and how many seeds stand behind a figure: the end of its title."""
    splits = list(dict.fromkeys(table["split"])) if "split" in table.columns else []
    text = f", split by {splits[0]}" if len(splits) == 1 else ""
    seeds = table[SEED].nunique() if SEED in table.columns else 1
    return text + (f", mean of {seeds} seeds" if seeds > 1 else "")


def averaged(rows: pd.DataFrame, by: Sequence[str], names: Sequence[str]) -> pd.DataFrame:
    """A row for every value of `by`, over all seeds: means of figures, their deviation, the span of their intervals.

    Columns `<name>_sd` are standard deviations of a sample, NaN for one seed; `<name>_low` and `<name>_high`, where
    there are any, hold the intervals of all seeds. Other columns are those of the first seed.
    """
    groups = rows.groupby(list(by), sort=False)
    table = groups.first().reset_index()
    for name in names:
        table[name], table[f"{name}_sd"] = groups[name].mean().to_numpy(), groups[name].std(ddof=1).to_numpy()
        if f"{name}_low" in rows.columns:
            table[f"{name}_low"] = groups[f"{name}_low"].min().to_numpy()
            table[f"{name}_high"] = groups[f"{name}_high"].max().to_numpy()
    return table[[*(name for name in rows.columns), *(f"{name}_sd" for name in names)]]


def by_splits(table: pd.DataFrame) -> list[tuple[dict[str, str], pd.DataFrame]]:
    """The rows of each split, with the cell that names it; no such cell where there is one split alone."""
    if "split" not in table.columns or table["split"].nunique() < 2:
        return [({}, table)]
    return [({"split by": str(split)}, rows) for split, rows in table.groupby("split", sort=False)]


def seed_notes(table: pd.DataFrame) -> list[str]:
    """How many trainings stand behind a figure, where there are several."""
    if SEED not in table.columns or table[SEED].nunique() < 2:
        return []
    seeds = sorted(table[SEED].unique())
    return [
        f"Mean ± standard deviation over n = {len(seeds)} trainings of other seeds ({', '.join(map(str, seeds))}); "
        "the interval of each stands in the CSV and Parquet forms."
    ]
