"""Rows of a table by photo, for many photos: one sort instead of one table a photo."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
import pandas as pd


def rows_by(table: pd.DataFrame, by: Sequence[str]) -> dict[Hashable, np.ndarray]:
    """Numbers of the rows (n,) that have the same values, in their order; by value, or by tuple of several."""
    if not len(table):
        return {}
    groups = table.groupby(list(by) if len(by) > 1 else by[0], sort=True)
    number = groups.ngroup().to_numpy()
    order = np.argsort(number, kind="stable")
    starts = np.flatnonzero(np.diff(number[order], prepend=-1))
    names = table[list(by)].iloc[order[starts]].itertuples(index=False, name=None)
    parts = np.split(order, starts[1:])
    return {name if len(by) > 1 else name[0]: part for name, part in zip(names, parts, strict=True)}


def values_by(table: pd.DataFrame, by: Sequence[str], columns: Sequence[str]) -> dict[Hashable, np.ndarray]:
    """Values (n, columns) of the rows that `rows_by` puts together."""
    values = table[list(columns)].to_numpy(float)
    return {name: values[rows] for name, rows in rows_by(table, by).items()}
