"""Concatenation of the tables of all splits and training seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet, write_parquet


def gather_tables(
    *, parts: Mapping[str, Sequence[Path]], tables: Mapping[str, Path], splits: Sequence[str], seeds: Sequence[int]
) -> None:
    """Concatenate the parts of each table, one for each split and training seed, and add columns `split` and `seed`."""
    for name, table in tables.items():
        gathered = []
        for path, split, seed in zip(parts[name], splits, seeds, strict=True):
            part = read_parquet(path)
            if "split" not in part.columns:
                part.insert(0, "split", pd.Series([split] * len(part), dtype="str"))
            part.insert(list(part.columns).index("split") + 1, "seed", seed)
            gathered.append(part)
        write_parquet(table, pd.concat(gathered, ignore_index=True))
