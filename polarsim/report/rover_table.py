"""The rover's tables: drives together and one by one, metrics of the detector on board."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.schemas.rover import DRIVES, EVERY_DRIVE, ONBOARD

DRIVES_CAPTION = (
    "Drives, means over seeds, of each wheel and of all. Slip, sinkage and torque are means over time while the rover "
    "moves and the wheel stands on soil alone; sinkage counts from the ground before the drive."
)
EACH_CAPTION = "Every drive, wheels together."
ONBOARD_CAPTION = (
    "What the front camera is worth on board; `truth` has all labels in the place of a detector, `visible` those "
    "that stand out in the picture, the most that any detector could reach. Exposure 0: all of them together."
)


def tabulate_rover(
    *,
    drives: Path,
    each: Path,
    stem: Path,
    each_stem: Path,
    origin: Mapping[str, str],
) -> None:
    """Write the tables of all drives and of each drive, in four forms.

    Raises
    ------
    FormatError
        A table is missing or has other columns.
    """
    wide = one_by_one(read_parquet(each, EVERY_DRIVE.columns))
    how = f"{_ends(wide)} Intervals: 95 %, Student's over seeds."
    _write(stem, read_parquet(drives, DRIVES.columns), DRIVES_CAPTION, origin, how)
    _write(each_stem, wide, EACH_CAPTION, origin)


def tabulate_onboard(*, onboard: Path, stem: Path, origin: Mapping[str, str]) -> None:
    """Write what the front camera is worth on board, in four forms.

    Raises
    ------
    FormatError
        The table is missing or has other columns.
    """
    how = "Intervals: 95 %, bootstrapped over rides, a drive under a Sun each."
    # `source` is what the run's photos are, in all tables.
    seen = read_parquet(onboard, ONBOARD.columns).rename(columns={"source": "boxes"})
    _write(stem, seen, ONBOARD_CAPTION, origin, how)


def _write(stem: Path, table: pd.DataFrame, caption: str, origin: Mapping[str, str], *notes: str) -> None:
    write_table(stem, with_origin(table, origin), caption, layout=table, notes=[*notes, origin_note(origin)])


def one_by_one(each: pd.DataFrame) -> pd.DataFrame:
    """A row a drive, a column a metric with its unit."""
    named = each.assign(metric=(each["metric"] + " " + each["unit"]).str.strip())
    order = list(dict.fromkeys(named["metric"]))
    wide = named.pivot_table(index=["seed", "control", "ended"], columns="metric", values="value", dropna=False)
    return wide.reindex(columns=order).dropna(how="all").reset_index().rename_axis(columns=None)


def _ends(drives: pd.DataFrame) -> str:
    """How the drives ended, as a sentence."""
    counts = drives["ended"].value_counts().sort_index()
    return "Ended: " + ", ".join(f"{count} {name}" for name, count in counts.items()) + "."
