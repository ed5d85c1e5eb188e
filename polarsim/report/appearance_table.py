"""Table of the appearance of twins next to their photos, with 95 % intervals over views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet, typed
from polarsim.intervals import (
    RESAMPLES,
    bootstrap_draws,
    percentile_interval,
    resampled_means,
    resampled_medians,
    resampled_ratios,
)
from polarsim.report.layout import MISSING, interval_text, write_blocks, write_table
from polarsim.report.render_table import values_of_group
from polarsim.schemas.evaluation import APPEARANCE_PAIRS
from polarsim.schemas.report import APPEARANCE, APPEARANCE_DIFFERENCES
from polarsim.scoring.twin_photos import NO_TERRAIN, subject_of

GROUPS = ("all", "terrain", "position", "azimuth", "light")
METRICS = ("psnr_db", "ssim", "correlation", "stops")
GAINS = {"psnr_gain_db": "psnr_db", "ssim_gain": "ssim", "correlation_gain": "correlation"}
BETTER, REFUSED = "better", "refused"
MIN_VIEWS = 5  # of a verdict: with fewer, all views favour one of two equal twins by chance in more than 5 % of cases
_TITLES = {"all": "all photos", "azimuth": "Sun azimuth"}

NOTE = (
    "Medians over photos with 95 % intervals over views (terrain, position and camera), after the best increasing "
    "tone curve of each photo. In place: the photo took part in a fit of the twin; held out: it did not. Agreement: "
    "share of matched features at the same position (by chance). Gain: own twin minus the twin of the same view and "
    "Sun of another terrain, paired by photo. Control: verdict from {views} views on."
)
NOTE_REFUSED = (
    "Refused, because the tone curve explains the twin of another terrain as well (the interval of a gain in PSNR, "
    "SSIM or correlation includes 0 or is below): {subjects}."
)
DIFFERENCES_CAPTION = (
    "Appearance of twins, first model minus second on the same photos: means with 95 % intervals over views."
)
NOTE_ALL_BETTER = "All scores with a control are better than those of the twin of another terrain."
NOTE_UNCONTROLLED = "No verdict of the control: too few views, or no twins of another terrain with the same view."


def tabulate_appearance(*, pairs: Sequence[Path], table: Path, differences: Path, origin: Mapping[str, str]) -> None:
    """Write the table, and that of differences of models, from the pairs of all terrains; paths without suffix."""
    compared = pd.concat([read_parquet(path, APPEARANCE_PAIRS.columns) for path in pairs], ignore_index=True)
    rows = appearance_rows(compared)
    write_blocks(table, rows, format_table(rows), table_notes(rows), origin)
    rows = difference_rows(compared)
    write_table(differences, rows, DIFFERENCES_CAPTION, layout=_difference_cells(rows), origin=origin)


def appearance_rows(pairs: pd.DataFrame) -> pd.DataFrame:
    """Return `APPEARANCE`: a row per model, relation, group and value."""
    rows = []
    for group in GROUPS:
        values = pairs.assign(group=group, value=values_of_group(pairs, group))
        for names, part in values.groupby(["model", "relation", "group", "value"]):
            rows.append(dict(zip(("model", "relation", "group", "value"), names, strict=True)) | _metrics(part))
    return typed(rows, APPEARANCE)


def difference_rows(pairs: pd.DataFrame) -> pd.DataFrame:
    """Return `APPEARANCE_DIFFERENCES`: photos with twins of both models, paired by photo."""
    names = [subject_of(*row) for row in zip(pairs["model"], pairs["relation"], strict=True)]
    pairs = pairs.assign(subject=pd.Series(names, pairs.index, dtype="str"))
    rows = []
    for first, second in combinations(sorted(set(pairs["model"])), 2):
        both = pairs[pairs["model"] == first].merge(
            pairs.loc[pairs["model"] == second, ["key", "subject", *METRICS]], on="key", suffixes=("", "_second")
        )
        for group in GROUPS:
            values = both.assign(group=group, value=values_of_group(both, group))
            for (one, other, value), part in values.groupby(["subject", "subject_second", "value"]):
                row = {"first": one, "second": other, "group": group, "value": value}
                rows.append(row | _differences(part))
    return typed(rows, APPEARANCE_DIFFERENCES)


def _differences(part: pd.DataFrame) -> dict[str, Any]:
    """Return the mean differences of two models in a group of photos, and their intervals over views."""
    view, views, drawn = _views(part)
    row: dict[str, Any] = {"photos": len(part), "views": views}
    for name in METRICS:
        change = (part[name] - part[f"{name}_second"]).to_numpy(float)
        known = np.isfinite(change)
        mean = float(change[known].mean()) if known.any() else np.nan
        resampled = resampled_means(change[known], view[known], drawn)
        row |= _with_interval(name, mean, resampled, len(np.unique(view[known])))
    return row


def _views(part: pd.DataFrame) -> tuple[np.ndarray, int, np.ndarray]:
    """Return the view (n,) of each photo, the number of views, and the draws of the bootstrap."""
    view = part.groupby(["terrain", "position", "camera"]).ngroup().to_numpy()
    views = int(view.max()) + 1
    return view, views, bootstrap_draws(views, RESAMPLES, 0, "appearance", views)


def format_table(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the blocks of the Markdown and LaTeX tables by caption, one per group with several values."""
    blocks = {}
    for group in GROUPS:
        of_group = rows[rows["group"] == group]
        if group == "all" or len(set(of_group["value"])) > 1:
            title = _TITLES.get(group, group)
            blocks[f"Appearance of twins, {'' if group == 'all' else 'by '}{title}."] = _cells(of_group, group)
    return blocks if len(rows) else {"Appearance of twins: no photos for a comparison.": rows[["model"]]}


def table_notes(rows: pd.DataFrame) -> list[str]:
    """Return the notes below the table, which name every score that the control refuses."""
    if not len(rows):
        return []
    note = NOTE.format(views=MIN_VIEWS)
    refused = rows[rows["control"] == REFUSED]
    names = [
        subject_of(row["model"], row["relation"])
        + (", all photos" if row["group"] == "all" else f", {row['group']} {row['value']}")
        for row in refused.to_dict("records")
    ]
    if names:
        return [note, NOTE_REFUSED.format(subjects="; ".join(names))]
    return [note, NOTE_ALL_BETTER if (rows["control"] == BETTER).any() else NOTE_UNCONTROLLED]


def _metrics(part: pd.DataFrame) -> dict[str, Any]:
    """Return the columns of a group of photos after the names."""
    view, views, drawn = _views(part)
    row: dict[str, Any] = {"photos": len(part), "views": views, "matches": int(part["matches"].sum())}
    for name in METRICS:
        row |= _median(name, part[name].to_numpy(float), view, drawn)
    matches = part["matches"].to_numpy(float)
    agreeing = (part["agreement"] * part["matches"]).fillna(0).to_numpy(float)
    row |= _with_interval(
        "agreement", agreeing.sum() / matches.sum() if matches.any() else np.nan,
        resampled_ratios(agreeing, matches, view, drawn), views,
    )  # fmt: skip
    known = part["agreement_by_chance"].notna().to_numpy()
    weights = np.where(known, matches, 0)
    chance = (part["agreement_by_chance"].fillna(0).to_numpy(float) * weights).sum()
    row |= {"agreement_by_chance": chance / weights.sum() if weights.any() else np.nan}
    controlled = ~part["control_terrain"].isin(["", NO_TERRAIN])
    row |= {"controlled": int(controlled.sum()), "better_share": part["better_than_control"].mean()}
    for gain, name in GAINS.items():
        row |= _median(gain, (part[name] - part[f"control_{name}"]).to_numpy(float), view, drawn)
    return row | {"control": control_verdict([row[f"{gain}_low"] for gain in GAINS], views)}


def control_verdict(lows: Sequence[float], views: int) -> str:
    """Return `BETTER` or `REFUSED` from the lower bounds of the gains; empty without control or with too few views."""
    if views < MIN_VIEWS or np.isnan(lows).any():
        return ""
    return BETTER if min(lows) > 0 else REFUSED


def _median(name: str, values: np.ndarray, view: np.ndarray, drawn: np.ndarray) -> dict[str, float]:
    """Return the median of the finite values (n,) of views (n,), and the interval over the views with a value."""
    finite = np.isfinite(values)
    values, view = values[finite], view[finite]
    median = float(np.median(values)) if len(values) else np.nan
    return _with_interval(name, median, resampled_medians(values, view, drawn), len(np.unique(view)))


def _with_interval(name: str, value: float, resampled: np.ndarray, views: int) -> dict[str, float]:
    low, high = percentile_interval(resampled, views)
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def _cells(rows: pd.DataFrame, group: str) -> pd.DataFrame:
    """Return the rows with texts of the metrics and their intervals."""
    records = rows.to_dict("records")
    columns: dict[str, list[object]] = {"model": [row["model"] for row in records]}
    columns["relation"] = [row["relation"] for row in records]
    if group != "all":
        columns[_TITLES.get(group, group)] = [row["value"] for row in records]
    columns["photos"] = [row["photos"] for row in records]
    for title, name, decimals in (
        ("PSNR, dB", "psnr_db", 1), ("SSIM", "ssim", 3), ("correlation", "correlation", 3), ("stops", "stops", 2),
    ):  # fmt: skip
        columns[title] = [interval_text(row, name, decimals) for row in records]
    columns["matches"] = [row["matches"] for row in records]
    columns["agreement"] = [
        f"{interval_text(row, 'agreement', 2)} ({_text(row['agreement_by_chance'], 3)})" for row in records
    ]
    columns["PSNR gain, dB"] = [interval_text(row, "psnr_gain_db", 1) for row in records]
    columns["SSIM gain"] = [interval_text(row, "ssim_gain", 3) for row in records]
    columns["control"] = [row["control"] or MISSING for row in records]
    return pd.DataFrame(columns)


def _difference_cells(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with texts of the differences and their intervals."""
    records = rows.to_dict("records")
    return rows[["first", "second", "group", "value", "photos"]].assign(
        **{
            title: [interval_text(row, name, decimals) for row in records]
            for title, name, decimals in (
                ("PSNR, dB", "psnr_db", 2), ("SSIM", "ssim", 3), ("correlation", "correlation", 3),
                ("stops", "stops", 3),
            )
        }
    )  # fmt: skip


def _text(value: float, decimals: int) -> str:
    return MISSING if np.isnan(value) else f"{value:.{decimals}f}"
