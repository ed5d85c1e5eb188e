"""Tables of autonomous drives: drives by mode, effect of each variable, rank correlation of gap and driving."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import MISSING, value_and_interval, write_blocks, write_table
from polarsim.schemas.rover import (
    ALL,
    AUTONOMY,
    AUTONOMY_DETECTORS,
    AUTONOMY_EFFECTS,
    AUTONOMY_RANK,
    END_ERROR,
    KNOWN,
    LOST_MOTIONS,
    REJECTED_MOTIONS,
)
from polarsim.wording import counted

CAPTION = (
    "Autonomous drives, means over seeds. Mode: hazards from labels (truth), a detector, stereo depth, both, or none "
    "(blind: straight line). `any`: the drives do not depend on this variable; `all`: mean over all of its values."
)
EFFECTS_CAPTION = (
    "Effect of Sun, exposure, lights, reflectance model, detector and source of the pose on autonomous drives: mean of "
    "each level over the drives available for all levels; in brackets: difference to the mean of the other levels, "
    "paired by seed."
)
SUNS_CAPTION = (
    "Suns from best to worst by metric, with the rank of the mean and its interval; equal means share a rank."
)
RANK_CAPTION = "Rank correlation over detectors between their gap and their driving."
DETECTORS_CAPTION = "Detectors used in drives, means over the drives."
INTERVALS = "Intervals: 95 %, bootstrapped over seeds."
RANK_NOTES = (
    "A positive coefficient means: the detector with the smaller IPD, the larger mAP@0.5 of rocks or the larger F1 of "
    "rock cells in the maps has fewer collisions, more successes or more points of the rock map.",
    "Intervals: 95 %, bootstrap over `units`: seeds, or combinations of Sun, exposure and lights if there is only "
    "1 seed; the same replicates for all detectors. Only drives with light and with seeds common to all detectors of "
    "a mode are used. p: permutation test of Kendall's coefficient over orders of the detectors.",
    "Verdict: `better` or `worse` if there are at least 5 detectors, the interval of Kendall's coefficient excludes 0 "
    "and p is below 0.05 (not corrected for the number of rows).",
)
BY_PART, FAULTS = "by wheels, legs, body", "stereo motions lost, rejected"
SHOWN = {
    "collisions": "collisions",
    BY_PART: BY_PART,
    "success": "success",
    "closest pass of a rock above 10 cm": "closest pass, m",
    "stops": "stops",
    "points": "points, of 1000",
    "rock map": "rock map, of 300",
    END_ERROR: "position error, % of path",
    FAULTS: FAULTS,
    "energy over the blind one's": "energy over blind",
}
LISTED = {  # columns that list several metrics
    BY_PART: [f"collisions of {part}" for part in ("wheels", "legs", "the body")],
    FAULTS: [LOST_MOTIONS, REJECTED_MOTIONS],
}
OF_POSE = {END_ERROR: SHOWN[END_ERROR], LOST_MOTIONS: FAULTS}  # columns that need metrics of an estimated pose
_KEYS = ["mode", "sun", "exposure", "lights", "model", "detector"]
_GAPS = {"ipd": "IPD", "map50": "mAP@0.5", "rock_f1": "F1 of rock cells"}
_DRIVES = {"collisions": "collisions", "success": "success", "rock_points": "rock map"}


def tabulate_autonomy(
    *, together: Path, effects: Path, stem: Path, effects_stem: Path, origin: Mapping[str, str]
) -> None:
    """Write the table of autonomous drives and the table of effects as CSV, Parquet, Markdown and LaTeX."""
    table = read_parquet(together, AUTONOMY.columns)
    write_table(stem, table, CAPTION, layout=format_autonomy(table), notes=[INTERVALS], origin=origin)
    changed = read_parquet(effects, AUTONOMY_EFFECTS.columns)
    blocks = {EFFECTS_CAPTION: format_effects(changed), SUNS_CAPTION: format_suns(changed)}
    blocks = {caption: block for caption, block in blocks.items() if len(block) or caption == EFFECTS_CAPTION}
    write_blocks(effects_stem, changed, blocks, [INTERVALS], origin)


def tabulate_rank(*, by_detector: Path, ranks: Path, stem: Path, origin: Mapping[str, str]) -> None:
    """Write the rank correlations between gap and driving as CSV, Parquet, Markdown and LaTeX."""
    table = read_parquet(ranks, AUTONOMY_RANK.columns)
    detectors = read_parquet(by_detector, AUTONOMY_DETECTORS.columns)
    blocks = {DETECTORS_CAPTION: detectors, RANK_CAPTION: format_rank(table)}
    write_blocks(stem, table, blocks, RANK_NOTES, origin)


def format_autonomy(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per kind of drive and a column per metric in `SHOWN`, with intervals."""
    rows, metrics_there = [], set(table["metric"])
    for (*key, pose), part in table.groupby([*_KEYS, "pose"], sort=False):
        metrics = part.set_index("metric")
        row: dict[str, object] = {**dict(zip(_KEYS, key, strict=True)), "drives": int(part["drives"].max())}
        row["mode"] = with_pose(str(row["mode"]), str(pose))
        row |= {text: _with_interval(metrics, metric) for metric, text in SHOWN.items()}
        rows.append(row | {text: _list_of(metrics, names) for text, names in LISTED.items()})
    return pd.DataFrame(rows).drop(columns=[text for name, text in OF_POSE.items() if name not in metrics_there])


def _list_of(metrics: pd.DataFrame, names: list[str]) -> str:
    """Return the means of several metrics, without intervals."""
    if not set(names) <= set(metrics.index):
        return MISSING
    return ", ".join(f"{metrics['value'][name]:.2f}" for name in names)


def with_pose(mode: str, pose: str) -> str:
    """Return the name of a mode with its source of poses, if the pose is not known."""
    return mode if pose == KNOWN else f"{mode}, {pose} pose{'s' if pose == ALL else ''}"


def format_effects(effects: pd.DataFrame) -> pd.DataFrame:
    """Return a row per level of a variable and a column per metric, with the change."""
    rows = []
    for (mode, pose, axis, level), part in effects.groupby(["mode", "pose", "axis", "level"], sort=False):
        metrics = part.set_index("metric")
        row: dict[str, object] = {"mode": with_pose(str(mode), str(pose)), "axis": axis, "level": level}
        row["seeds"] = part["seeds"].max()
        for metric in dict.fromkeys(effects["metric"]):
            value, change = _with_interval(metrics, metric), _with_interval(metrics, metric, "change", "change_", "+")
            row[metric] = MISSING if value == MISSING else f"{value} ({change})"
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["mode", "axis", "level", "seeds"])


def format_suns(effects: pd.DataFrame) -> pd.DataFrame:
    """Return a row per mode and a column per metric: the Suns from best to worst, with ranks."""
    rows = []
    suns = effects[(effects["axis"] == "sun") & effects["rank"].notna()]
    for (mode, pose), part in suns.groupby(["mode", "pose"], sort=False):
        row: dict[str, object] = {"mode": with_pose(str(mode), str(pose)), "seeds": part["seeds"].max()}
        for metric, of_metric in part.groupby("metric", sort=False):
            ordered = of_metric.sort_values(["rank", "level"]).to_dict("records")
            row[str(metric)] = ", ".join(f"{level['level']} ({_rank_text(level)})" for level in ordered)
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["mode", "seeds"])


def _rank_text(row: Mapping[Any, Any]) -> str:
    bounds = "" if math.isnan(row["rank_low"]) else f" [{row['rank_low']:g}, {row['rank_high']:g}]"
    return f"{row['rank']:g}{bounds}"


def format_rank(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per mode, gap and driving metric: coefficients with intervals."""
    records = table.to_dict("records")
    coefficients = {
        name.capitalize(): [_interval_text(row[name], row[f"{name}_low"], row[f"{name}_high"], "+") for row in records]
        for name in ("spearman", "kendall")
    }
    return pd.DataFrame(
        {
            "mode": table["mode"],
            "gap": table["gap"].map(_GAPS),
            "metric of drives": table["drive"].map(_DRIVES),
            "detectors": table["detectors"],
            "drives": table["drives"],
            "units": [counted(row["units"], row["unit"]) for row in records],
            **coefficients,
            "p": table["kendall_p"],
            "smaller gap drives": table["says"],
        }
    )


def _with_interval(metrics: pd.DataFrame, metric: str, name: str = "value", prefix: str = "", sign: str = "") -> str:
    if metric not in metrics.index:
        return MISSING
    row = metrics.loc[metric].to_dict()
    return _interval_text(row[name], row[f"{prefix}low"], row[f"{prefix}high"], sign)


def _interval_text(value: float, low: float, high: float, sign: str = "") -> str:
    digits = 0 if max(abs(value), abs(high) if high == high else 0) >= 100 else 2
    return value_and_interval(value, low, high, f"{sign}z.{digits}f")  # z: no negative zero
