"""Several trainings that differ in their seed alone: one figure with its spread."""

from __future__ import annotations

import pandas as pd

from polarsim.tables.layout import MISSING

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


def first_split(table: pd.DataFrame) -> tuple[pd.DataFrame, str]:
    """What figures show: the rows of the first split, and words for the title; the tables have all."""
    if "split" not in table.columns or not len(table):
        return table.reset_index(drop=True), ""
    first = table["split"].iloc[0]
    return table[table["split"] == first].reset_index(drop=True), f", split by {first}"


def first_training(table: pd.DataFrame) -> tuple[pd.DataFrame, str]:
    """The same with the first seed alone."""
    rows, words = first_split(table)
    if SEED not in rows.columns or not len(rows) or (rows[SEED] == rows[SEED].iloc[0]).all():
        return rows, words
    first = rows[SEED].iloc[0]
    return rows[rows[SEED] == first].reset_index(drop=True), f"{words}, seed {first}"


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
