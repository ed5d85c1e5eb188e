"""A run's drives as tables: every drive's figures, and all drives together with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from polarsim.formats import tables
from polarsim.rover.drive_table import WHOLE, drive_figures, drive_table
from polarsim.rover.trace import Trace, read_trace

EACH_COLUMNS = ("seed", "control", "ended", "figure", "unit", "value")


def summarise_drives(folders: Sequence[Path], each: Path, together: Path) -> None:
    """Write a row a drive and figure, `EACH_COLUMNS`, and what `drive_table` makes of all of them.

    Raises
    ------
    FormatError
        A drive's files are missing or broken.
    """
    traces = [read_trace(folder) for folder in folders]
    parts = [figures_of(trace) for trace in traces]
    tables.write_parquet(each, pd.concat(parts, ignore_index=True))
    tables.write_parquet(together, drive_table(traces))


def figures_of(trace: Trace) -> pd.DataFrame:
    """The figures of one drive's rover, wheels together, `EACH_COLUMNS`."""
    figures = drive_figures(trace)
    told = trace.drive
    own = {"seed": int(told["seed"]), "control": told["options"]["drive"]["control"], "ended": told["ended"]}
    return figures[figures["wheel"] == WHOLE].assign(**own)[list(EACH_COLUMNS)].reset_index(drop=True)
