"""The tables of all splits and training seeds, put together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from polarsim.errors import DetectError
from polarsim.formats import tables


def gather_tables(*, parts: Sequence[Path], splits: Sequence[str], seeds: Sequence[int], table: Path) -> None:
    """Put tables of the same columns together, with columns split and seed in front unless they are there.

    Parameters
    ----------
    parts : sequence of Path
        Parquet tables, each of one split and one training seed.
    splits, seeds : sequences of str and int
        Those of each part.

    Raises
    ------
    PolarsimError
        A broken table, or one with other columns than the first.
    """
    found: list[pd.DataFrame] = []
    for path, split, seed in zip(parts, splits, seeds, strict=True):
        part = tables.read_parquet(path)
        if "split" not in part.columns:
            part.insert(0, "split", pd.Series([split] * len(part), dtype="str"))
        if "seed" not in part.columns:
            part.insert(list(part.columns).index("split") + 1, "seed", seed)
        if found and list(part.columns) != list(found[0].columns):
            raise DetectError(f"columns {', '.join(part.columns)}, expected those of {parts[0]}", path=path)
        found.append(part)
    tables.write_parquet(table, pd.concat(found, ignore_index=True))
