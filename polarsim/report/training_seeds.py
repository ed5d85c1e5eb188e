"""Summary of a metric over trainings with different seeds: mean and standard deviation."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from polarsim.report.layout import MISSING, interval_text

SEED = "seed"


def over_seeds(values: pd.Series, decimals: int = 3) -> str:
    """Return the value, or mean ± sample standard deviation of several values, as text; NaN is ignored."""
    finite = values.dropna()
    if not len(finite):
        return MISSING
    if len(finite) == 1:
        return f"{finite.iloc[0]:.{decimals}f}"
    return f"{finite.mean():.{decimals}f} ± {finite.std(ddof=1):.{decimals}f}"


def metric_cell(part: pd.DataFrame, name: str, decimals: int = 3) -> str:
    """Return the text of a cell: a single training with interval, or several trainings with standard deviation."""
    if len(part) == 1:
        return interval_text(part.iloc[0], name, decimals)
    return over_seeds(part[name], decimals)


def split_panels(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Return name and rows of each split, for the panels of a figure; all rows if there is no column `split`."""
    if "split" not in table.columns or not len(table):
        return [("", table.reset_index(drop=True))]
    return [(str(split), rows.reset_index(drop=True)) for split, rows in table.groupby("split", sort=False)]


def title_suffix(table: pd.DataFrame) -> str:
    """Return the end of a figure title: the split, if there is only one, and the number of seeds."""
    splits = list(dict.fromkeys(table["split"])) if "split" in table.columns else []
    text = f", split by {splits[0]}" if len(splits) == 1 else ""
    seeds = table[SEED].nunique() if SEED in table.columns else 1
    return text + (f", mean of {seeds} seeds" if seeds > 1 else "")


def seed_means(rows: pd.DataFrame, by: Sequence[str], names: Sequence[str]) -> pd.DataFrame:
    """Average metrics over seeds: a row per value of the columns `by`.

    Columns `<name>_sd` are sample standard deviations, NaN for a single seed. Columns `<name>_low` and `<name>_high`,
    if present, are the minimum and maximum over the intervals of all seeds. Other columns are copied from the first
    seed.
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
    """Return the rows of each split with a cell that names the split; without the cell if there is a single split."""
    if "split" not in table.columns or table["split"].nunique() < 2:
        return [({}, table)]
    return [({"split by": str(split)}, rows) for split, rows in table.groupby("split", sort=False)]


def seed_notes(table: pd.DataFrame) -> list[str]:
    """Return a note with the number of trainings, if there are several."""
    if SEED not in table.columns or table[SEED].nunique() < 2:
        return []
    seeds = sorted(table[SEED].unique())
    return [
        f"Mean ± standard deviation over n = {len(seeds)} trainings with seeds {', '.join(map(str, seeds))}; the CSV "
        "and Parquet files contain the interval of each training."
    ]
