"""Accuracy of labels: edge errors of propagated boxes, and reliability of the confidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES, Terrain, terrain_text
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, LINE, SERIES, figure_title, legend_line, note, page
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.label_pairs import EDGES, TRUE_EDGES
from polarsim.scoring.labels import PROPAGATION_TASKS
from polarsim.scoring.metrics import TRUTH_NAMES
from polarsim.scoring.reliability import ANY_SOURCE, COLUMNS, binned_calibration_error, brier_score

SIDES = ("left", "top", "right", "bottom")
REACH = 20  # maximum error shown, px
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_COLUMNS = {"median": 5, "boxes": 5}  # width of the columns of numbers on the axis, px of error
_EMPTY_PX = 300  # height of a figure without data
_GROUP_GAP = 0.8  # space between groups of rows, rows
_ROW_PX = 22  # height of a row of the reliability figure


def draw_label_scores(
    *,
    terrains: Sequence[Terrain],
    pairs: Sequence[Path],
    reliability: Path,
    label_errors: Sequence[Path],
    reliability_figure: Path,
    origin: dict[str, str],
) -> None:
    """Draw the edge errors of each terrain and the reliability of the confidence."""
    for terrain, path, figure in zip(terrains, pairs, label_errors, strict=True):
        draw_label_errors(terrain=terrain, pairs=path, figure=figure)
    draw_reliability(reliability=reliability, figure=reliability_figure, origin=origin)


def draw_label_errors(*, terrain: Terrain, pairs: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write quantiles of the edge errors from `label_pairs`: a panel per kind, a group per edge, a row per task."""
    table = read_parquet(pairs, LABEL_PAIRS.columns)
    errors = edge_errors(table)
    with page(figure, width, round(width * 0.5) if errors else _EMPTY_PX) as sheet:
        if not errors:
            note(sheet, f"Terrain {terrain_text(terrain)}: no label was matched with a true box")
            return
        name = TRUTH_NAMES[table["against"].iloc[0]]
        figure_title(sheet, f"Terrain {terrain_text(terrain)}: edges of propagated boxes minus edges of {name}")
        panels = sheet.subplots(1, len(BOX_CLASSES), sharey=True, squeeze=False)[0]
        shown = [task for task in PROPAGATION_TASKS if any(task == part for _, part in errors)]
        for axes, kind in zip(panels, BOX_CLASSES, strict=True):
            _draw_kind_errors(axes, {task: errors[kind, task] for task in shown if (kind, task) in errors}, shown)
            axes.set_title(kind)
        lines = [legend_line(color=_colour(task), linewidth=6) for task in shown]
        lines += [legend_line(color=FAINT, linewidth=width) for width in (6, 1.5)]
        names = [*shown, "25 % to 75 %", "5 % to 95 %"]
        sheet.legend(lines, names, loc="outside lower center", ncols=len(names), fontsize="small")


def edge_errors(pairs: pd.DataFrame) -> dict[tuple[str, str], np.ndarray]:
    """Return the edge errors of matched boxes, (n, 4) pixels, by kind and task."""
    return {
        (str(kind), str(task)): part[list(EDGES)].to_numpy(float) - part[list(TRUE_EDGES)].to_numpy(float)
        for (kind, task), part in pairs[pairs["hit"]].groupby(["kind", "task"], sort=False)
    }


def _colour(task: str) -> str:
    return SERIES[PROPAGATION_TASKS.index(task) % len(SERIES)]


def _draw_kind_errors(axes: Any, parts: Mapping[str, np.ndarray], tasks: Sequence[str]) -> None:
    """Draw the quantiles of the errors (n, 4) of each task: a group of rows per edge."""
    step = len(tasks) + _GROUP_GAP
    for edge in range(len(SIDES)):
        for number, task in enumerate(tasks):
            if task in parts:
                _draw_quantiles(axes, edge * step + number, parts[task][:, edge], _colour(task))
    axes.axvline(0, color=INK, linewidth=0.8, zorder=1)
    axes.set(xlabel=f"error, px (larger ones at ±{REACH})", xlim=(-REACH, REACH + sum(_COLUMNS.values())))
    axes.set_xticks(range(-REACH, REACH + 1, 5))
    _write_columns(axes, -1, list(_COLUMNS))
    axes.set_yticks([edge * step + (len(tasks) - 1) / 2 for edge in range(len(SIDES))], SIDES)
    axes.set_ylim(len(SIDES) * step - _GROUP_GAP, -1.6)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=True, axis="x")


def _draw_quantiles(axes: Any, row: float, values: np.ndarray, colour: str) -> None:
    low, lower, median, upper, high = np.quantile(values, QUANTILES).clip(-REACH, REACH)
    axes.plot([low, high], [row, row], color=colour, linewidth=1.5, solid_capstyle="butt")
    axes.barh(row, upper - lower, 0.6, lower, color=colour)
    axes.plot(median, row, marker="|", markersize=13, markeredgewidth=2.5, color=INK)
    _write_columns(axes, row, [f"{round(float(np.median(values)), 1) + 0.0:+.1f}", f"{len(values):,}"])


def _write_columns(axes: Any, row: float, texts: Sequence[str]) -> None:
    """Write right-aligned texts in the columns to the right of the errors."""
    for x, text in zip(REACH + np.cumsum(list(_COLUMNS.values())), texts, strict=True):
        axes.text(x, row, text, ha="right", va="center", color=FAINT, fontsize="small")


def draw_reliability(*, reliability: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write the reliability from tables/reliability.parquet, a panel per kind.

    A row is a bin of labels of similar confidence. It shows the mean confidence and the share of correct labels; both
    are equal for a calibrated confidence.
    """
    bins = read_parquet(reliability, list(COLUMNS))
    rows = max((len(part) for _, part in bins.groupby("kind")), default=0)
    sources = [*sorted(set(bins["label_source"]) - {ANY_SOURCE}), ANY_SOURCE]
    height = round(_ROW_PX * (rows + 2 * len(sources))) + 160
    with page(figure, width, height if len(bins) else _EMPTY_PX) as sheet:
        if not len(bins):
            note(sheet, "no label was compared with a true box")
            return
        figure_title(sheet, f"Reliability: confidence of labels and share of correct labels, source {origin['source']}")
        for axes, kind in zip(sheet.subplots(1, len(BOX_CLASSES)), BOX_CLASSES, strict=True):
            _draw_kind(axes, bins[bins["kind"] == kind], sources)
            axes.set_title(kind)
        lines = [legend_line(**style) for style in (_CLAIM, {**_SHARE, "color": INK, "linewidth": 1.2})]
        names = ["mean confidence of the labels in a bin", "share of correct labels with 95 % interval"]
        sheet.legend(lines, names, loc="outside lower center", ncols=2)


_CLAIM = {
    "marker": "D", "markersize": 8, "markerfacecolor": "white", "markeredgewidth": 1.8, "color": INK,
    "linestyle": "none",
}  # fmt: skip
_SHARE = {"marker": "o", "markersize": 7}


def _draw_kind(axes: Any, bins: pd.DataFrame, sources: Sequence[str]) -> None:
    row, titles = 0.0, {}
    for number, source in enumerate(sources):
        chosen = bins[bins["label_source"] == source].sort_values("confidence")
        if not len(chosen):
            continue
        at = row + np.arange(len(chosen))
        correct = chosen["right"].to_numpy(float)
        errors = np.stack([correct - chosen["right_low"], chosen["right_high"] - correct]).clip(0)
        colour = INK if source == ANY_SOURCE else SERIES[number % len(SERIES)]
        axes.hlines(at, chosen["confidence"], correct, color=LINE, linewidth=5)
        axes.errorbar(correct, at, xerr=errors, color=colour, linestyle="none", capsize=3, elinewidth=1.2, **_SHARE)
        axes.plot(chosen["confidence"], at, **{**_CLAIM, "color": colour})
        text = f"ECE {binned_calibration_error(chosen):.3f}, Brier {brier_score(chosen):.3f}"
        name = "all sources" if source == ANY_SOURCE else source
        titles[row - 1] = f" {name}: {round(chosen['labels'].sum()):,} labels, {text}", colour
        row += len(chosen) + 1.6
    lowest = float(bins[["confidence", "right_low"]].to_numpy(float).min()) if len(bins) else 0.0
    left = np.floor(10 * max(0.0, lowest - 0.02)) / 10
    for height, (text, colour) in titles.items():
        axes.text(left, height, text, va="center", color=colour)
    axes.set(xlabel="confidence, share of correct labels", xlim=(left, 1.01), ylim=(row - 0.8, -1.8), yticks=[])
    axes.grid(visible=True, axis="x")
