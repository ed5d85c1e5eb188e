"""Tables of drives in which the rover decides: kinds of drive, what each axis changes, detectors by gap and drive."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import MISSING, origin_note, with_origin, write_blocks, write_table
from polarsim.schemas.rover import AUTONOMY, AUTONOMY_DETECTORS, AUTONOMY_EFFECTS, AUTONOMY_RANK

CAPTION = (
    "Drives in which the rover finds its own way, means over seeds: by labels (truth), a detector, stereo depth, both, "
    "or blind along the straight line. `any`: drives do not depend on it; `all`: over all of them."
)
EFFECTS_CAPTION = (
    "What drives are like under each Sun, with each exposure, with lights off and on, in each model, by each detector, "
    "over all else that was driven at every level; in brackets: against the mean of the others, by the same seeds."
)
RANK_CAPTION = "Does a detector with a smaller gap drive better? Rank correlations over detectors."
DETECTORS_CAPTION = "Detectors that drove, means over their drives."
INTERVALS = "Intervals: 95 %, bootstrapped over seeds."
RANK_NOTES = (
    "Coefficients above 0: the detector with the smaller IPD, the larger mAP@0.5 of rocks or the larger F1 of rock "
    "cells of its own maps has fewer collisions, more successes or more points of the rock map.",
    "Intervals: 95 %, bootstrapped over `units`: seeds, or Suns with exposures and lights where one seed drove, the "
    "same for all detectors. Only drives in light and with seeds that all detectors of a mode drove count. p of "
    "Kendall's coefficient is of chance orders of the detectors.",
    "Fewer than 5 detectors: nothing is claimed. Else `better` or `worse` where the interval of Kendall's coefficient "
    "leaves out 0 and p is below 0.05, not corrected for the number of rows.",
)
SHOWN = {
    "collisions": "collisions",
    "success": "success",
    "closest pass of a rock above 10 cm": "closest pass, m",
    "stops": "stops",
    "geometric map": "geometric map, of 300",
    "rock map": "rock map, of 300",
    "energy over the blind one's": "energy over blind",
}
_KEYS = ["mode", "sun", "exposure", "lights", "model", "detector"]
_GAPS = {"ipd": "IPD", "map50": "mAP@0.5", "rock_f1": "F1 of rock cells"}
_DRIVES = {"collisions": "collisions", "success": "success", "rock_points": "rock map"}


def tabulate_autonomy(
    *, together: Path, effects: Path, stem: Path, effects_stem: Path, origin: Mapping[str, str]
) -> None:
    """Write what drives were like in which the rover found its own way, and what each axis changes, in four forms.

    Raises
    ------
    FormatError
        A table is missing or has other columns.
    """
    notes = [INTERVALS, origin_note(origin)]
    table = read_parquet(together, AUTONOMY.columns)
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_autonomy(table), notes=notes)
    changed = read_parquet(effects, AUTONOMY_EFFECTS.columns)
    layout = format_effects(changed)
    write_table(effects_stem, with_origin(changed, origin), EFFECTS_CAPTION, layout=layout, notes=notes)


def tabulate_rank(*, by_detector: Path, ranks: Path, stem: Path, origin: Mapping[str, str]) -> None:
    """Write how detectors' order by their gap agrees with their order by driving, in four forms.

    Raises
    ------
    FormatError
        A table is missing or has other columns.
    """
    table = read_parquet(ranks, AUTONOMY_RANK.columns)
    own = read_parquet(by_detector, AUTONOMY_DETECTORS.columns)
    blocks = {DETECTORS_CAPTION: own, RANK_CAPTION: format_rank(table)}
    write_blocks(stem, with_origin(table, origin), blocks, [*RANK_NOTES, origin_note(origin)])


def format_autonomy(table: pd.DataFrame) -> pd.DataFrame:
    """A row a kind of drive, a column a figure with its interval; CSV and Parquet have all figures."""
    rows = []
    for key, part in table.groupby(_KEYS, sort=False):
        own = part.set_index("metric")
        row: dict[str, object] = {**dict(zip(_KEYS, key, strict=True)), "drives": int(part["drives"].max())}
        rows.append(row | {text: _with_interval(own, metric) for metric, text in SHOWN.items()})
    return pd.DataFrame(rows)


def format_effects(effects: pd.DataFrame) -> pd.DataFrame:
    """A row a level of an axis, a column a figure with its change."""
    rows = []
    for key, part in effects.groupby(["mode", "axis", "level"], sort=False):
        own = part.set_index("metric")
        row: dict[str, object] = {
            **dict(zip(["mode", "axis", "level"], key, strict=True)),
            "seeds": part["seeds"].max(),
        }
        for metric in dict.fromkeys(effects["metric"]):
            value, change = _with_interval(own, metric), _with_interval(own, metric, "change", "change_", "+")
            row[metric] = MISSING if value == MISSING else f"{value} ({change})"
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["mode", "axis", "level", "seeds"])


def format_rank(table: pd.DataFrame) -> pd.DataFrame:
    """A row a mode, gap and figure of drives, coefficients with their intervals."""
    rows = []
    for row in table.to_dict("records"):
        ends = {
            name: _interval_text(row[name], row[f"{name}_low"], row[f"{name}_high"], "+")
            for name in ("spearman", "kendall")
        }
        rows.append(
            {
                "mode": row["mode"],
                "gap": _GAPS[row["gap"]],
                "drives' figure": _DRIVES[row["drive"]],
                "detectors": row["detectors"],
                "drives": row["drives"],
                "units": f"{row['units']} {row['unit']}s",
                "Spearman": ends["spearman"],
                "Kendall": ends["kendall"],
                "p": row["kendall_p"],
                "smaller gap drives": row["says"],
            }
        )
    return pd.DataFrame(rows)


def _with_interval(own: pd.DataFrame, metric: str, name: str = "value", ends: str = "", sign: str = "") -> str:
    if metric not in own.index:
        return MISSING
    row = own.loc[metric].to_dict()
    return _interval_text(row[name], row[f"{ends}low"], row[f"{ends}high"], sign)


def _interval_text(value: float, low: float, high: float, sign: str = "") -> str:
    if value != value:
        return MISSING
    digits = 0 if max(abs(value), abs(high) if high == high else 0) >= 100 else 2
    text = f"{value:{sign}z.{digits}f}"  # z: no minus before a 0
    return f"{text} [{low:{sign}z.{digits}f}, {high:{sign}z.{digits}f}]" if low == low else text
