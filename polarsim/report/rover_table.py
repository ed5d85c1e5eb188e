"""The rover's tables: drives together and one by one, the soil's checks, what a detector sees on board."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.schemas.rover import DRIVES, EVERY_DRIVE, ONBOARD
from polarsim.schemas.soil import SOIL_CHECKS, SOIL_LIMIT, SOIL_MEASURED

DRIVES_CAPTION = (
    "Drives, means over seeds, of each wheel and of all. Slip, sinkage and torque are means over time while the rover "
    "moves and the wheel stands on soil alone; sinkage counts from the ground before the drive."
)
EACH_CAPTION = "Every drive, wheels together."
ONBOARD_CAPTION = (
    "What the front camera is worth on board; `truth` has all labels in the place of a detector, `visible` those "
    "that stand out in the picture, the most that any detector could reach. Exposure 0: all of them together."
)
SOIL_CAPTION = "Driven wheels against the limit of fine cells, small steps and stiff soil; normal of the contact."
CHECKS_CAPTION = (
    "The soil beside what others measured or published, in their units, and beside what must hold of any soil. "
    "The soils ex1-silica-5, trec-grc3 and mgru3-tilt-bed were fitted to their source, others were not."
)


def tabulate_rover(
    *,
    drives: Path,
    each: Path,
    soil: Path,
    measured: Path,
    checks: Path,
    stem: Path,
    each_stem: Path,
    soil_stem: Path,
    checks_stem: Path,
    origin: Mapping[str, str],
) -> None:
    """Write the tables of all drives, of each drive, and of the soil's checks, each in four forms.

    Raises
    ------
    FormatError
        A table is missing or has other columns.
    """
    wide = one_by_one(read_parquet(each, EVERY_DRIVE.columns))
    how = f"{_ends(wide)} Intervals: 95 %, Student's over seeds."
    _write(stem, read_parquet(drives, DRIVES.columns), DRIVES_CAPTION, origin, how)
    _write(each_stem, wide, EACH_CAPTION, origin)
    _write(soil_stem, with_errors(read_parquet(soil, SOIL_LIMIT.columns)), SOIL_CAPTION, origin)
    all_checks = with_slopes(read_parquet(checks, SOIL_CHECKS.columns), read_parquet(measured, SOIL_MEASURED.columns))
    _write(checks_stem, all_checks, CHECKS_CAPTION, origin)


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


def with_errors(soil: pd.DataFrame) -> pd.DataFrame:
    """How far wheels lie from the limit: sinkage and torque in per cent, pull in newtons (it passes through 0)."""
    table = soil.copy()
    for name in ("sinkage_mm", "torque_n_m"):
        limit = table[name.replace("_mm", "_limit_mm").replace("_n_m", "_limit_n_m")]
        table[f"{name.split('_')[0]}_error_percent"] = 100 * (table[name] / limit - 1)
    table["pull_error_n"] = table["pull_n"] - table["pull_limit_n"]
    return table


def with_slopes(checks: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """NASA's slopes in the form of the other checks, before them, and how far the model lies from each."""
    slopes = pd.DataFrame(
        {
            "source": "NASA, " + measured["rig"],
            "quantity": "slope",
            "unit": "degrees",
            "soil": measured["soil"],
            "condition": "slip",
            "at": measured["slip"],
            "expected": measured["slope_deg"],
            "model": measured["model_deg"],
        }
    )
    table = pd.concat([slopes, checks], ignore_index=True)
    return table.assign(difference=table["model"] - table["expected"]).rename(columns={"source": "by"})


def _ends(drives: pd.DataFrame) -> str:
    """How the drives ended, as a sentence."""
    counts = drives["ended"].value_counts().sort_index()
    return "Ended: " + ", ".join(f"{count} {name}" for name, count in counts.items()) + "."
