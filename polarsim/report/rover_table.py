"""Tables of the rover: mean over drives, single drives, metrics of the onboard detector."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import write_table
from polarsim.schemas.rover import DRIVE_METRICS, DRIVES, ONBOARD

DRIVES_CAPTION = (
    "Drives, means over seeds, for each wheel and all wheels. Slip, sinkage and torque are means over the time while "
    "the rover moves and the wheel touches soil only; sinkage is relative to the ground before the drive."
)
EACH_CAPTION = "Single drives, means over all wheels."
ONBOARD_CAPTION = (
    "Obstacle detection with the front camera. `truth`: all labels instead of a detector; `visible`: labels with "
    "sufficient contrast in the image (upper bound for a detector). Exposure 0: all exposures combined."
)


def tabulate_rover(*, drives: Path, each: Path, stem: Path, each_stem: Path, origin: Mapping[str, str]) -> None:
    """Write the table of means over drives and the table of single drives as CSV, Parquet, Markdown and LaTeX."""
    wide = drive_rows(read_parquet(each, DRIVE_METRICS.columns))
    note = f"{_ends(wide)} Intervals: 95 %, Student's t over seeds."
    write_table(stem, read_parquet(drives, DRIVES.columns), DRIVES_CAPTION, notes=[note], origin=origin)
    write_table(each_stem, wide, EACH_CAPTION, origin=origin)


def tabulate_onboard(*, onboard: Path, stem: Path, origin: Mapping[str, str]) -> None:
    """Write the metrics of obstacle detection with the front camera as CSV, Parquet, Markdown and LaTeX."""
    note = "Intervals: 95 %, bootstrap over rides (one drive under one Sun)."
    # In report tables, `source` is the source of the run's photos.
    table = read_parquet(onboard, ONBOARD.columns).rename(columns={"source": "boxes"})
    write_table(stem, table, ONBOARD_CAPTION, notes=[note], origin=origin)


def drive_rows(each: pd.DataFrame) -> pd.DataFrame:
    """Return a row per drive and a column per metric with unit."""
    named = each.assign(metric=(each["metric"] + " " + each["unit"]).str.strip())
    order = list(dict.fromkeys(named["metric"]))
    wide = named.pivot_table(index=["seed", "control", "ended"], columns="metric", values="value", dropna=False)
    return wide.reindex(columns=order).dropna(how="all").reset_index().rename_axis(columns=None)


def _ends(drives: pd.DataFrame) -> str:
    """Return a sentence with the number of drives per reason of the end."""
    counts = drives["ended"].value_counts().sort_index()
    return "Ended: " + ", ".join(f"{count} {name}" for name, count in counts.items()) + "."
