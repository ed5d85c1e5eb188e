"""Concatenation of the tables of all splits and training seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from polarsim.errors import DetectError
from polarsim.formats.tables import read_parquet, write_parquet


def gather_tables(
    *, parts: Mapping[str, Sequence[Path]], tables: Mapping[str, Path], splits: Sequence[str], seeds: Sequence[int]
) -> None:
    """Concatenate the parts of each table and add missing columns `split` and `seed` at the front.

    Parameters
    ----------
    parts : mapping of str to sequence of Path
        Parquet tables by name of the table, each for a split and a training seed.
    tables : mapping of str to Path
        Parquet tables to write, by the same names.
    splits, seeds : sequences of str and int
        Split and training seed of each part.

    Raises
    ------
    PolarsimError
        Invalid table, or parts with different columns.
    """
    for name, table in tables.items():
        write_parquet(table, _gathered(parts[name], splits, seeds))


def _gathered(parts: Sequence[Path], splits: Sequence[str], seeds: Sequence[int]) -> pd.DataFrame:
    tables: list[pd.DataFrame] = []
    for path, split, seed in zip(parts, splits, seeds, strict=True):
        part = read_parquet(path)
        if "split" not in part.columns:
            part.insert(0, "split", pd.Series([split] * len(part), dtype="str"))
        if "seed" not in part.columns:
            part.insert(list(part.columns).index("split") + 1, "seed", seed)
        if tables and list(part.columns) != list(tables[0].columns):
            raise DetectError(f"columns {', '.join(part.columns)}, expected those of {parts[0]}", path=path)
        tables.append(part)
    return pd.concat(tables, ignore_index=True)
