"""Accuracy of labels: histograms of the edge errors of propagated boxes, and reliability of the confidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, figure_title, legend_line, note, page
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.label_pairs import EDGES, TRUE_EDGES
from polarsim.scoring.labels import EXPOSURES, LIGHT, PROPAGATION_TASKS
from polarsim.scoring.metrics import TRUTH_NAMES
from polarsim.scoring.reliability import ANY_SOURCE, COLUMNS, binned_calibration_error, brier_score

SIDES = ("left", "top", "right", "bottom")
REACH = 20  # maximum error shown in the histograms, px
COPIED = (EXPOSURES, LIGHT)  # tasks excluded from the printed medians if there are other tasks; errors are mostly 0
_TICKS = (0, 0.01, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1)  # of the axis of shares
_SD_OF_MAD = 1.4826  # standard deviation over median absolute deviation of a normal distribution
_END = 0.01  # offset of the logarithmic axis at a share of 1
TICKS = (0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1)


def draw_label_scores(
    *,
    terrains: Sequence[int],
    pairs: Sequence[Path],
    reliability: Path,
    label_errors: Sequence[Path],
    reliability_figure: Path,
    origin: dict[str, str],
) -> None:
    """Draw the edge errors of each terrain and the reliability diagram."""
    for terrain, path, figure in zip(terrains, pairs, label_errors, strict=True):
        draw_label_errors(terrain=terrain, pairs=path, figure=figure)
    draw_reliability(reliability=reliability, figure=reliability_figure, origin=origin)


def draw_label_errors(*, terrain: int, pairs: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write histograms of edge errors from `label_pairs`: a row per kind, a column per edge, a line per task."""
    table = read_parquet(pairs, LABEL_PAIRS.columns)
    errors = edge_errors(table)
    name = TRUTH_NAMES[table["against"].iloc[0]] if len(table) else ""
    with page(figure, width, round(width * 0.5)) as sheet:
        if not errors:
            note(sheet, f"Terrain {terrain:02d}: no label was matched with a true box")
            return
        figure_title(sheet, f"Terrain {terrain:02d}: edges of propagated boxes minus edges of {name}")
        grid = sheet.subplots(len(BOX_CLASSES), len(SIDES), sharex=True, squeeze=False)
        for row, kind in enumerate(BOX_CLASSES):
            parts = {task: errors[kind, task] for task in PROPAGATION_TASKS if (kind, task) in errors}
            for column, edge in enumerate(SIDES):
                _draw_edge(grid[row, column], {task: values[:, column] for task, values in parts.items()})
                grid[row, column].set_title(f"{kind}, {edge}")
        for axes in grid[-1]:
            axes.set_xlabel("error, px")
        for axes in grid[:, 0]:
            axes.set_ylabel("share of boxes (root scale)")
        shown = [task for task in PROPAGATION_TASKS if any(task == part for _, part in errors)]
        lines = [
            legend_line(color=SERIES[PROPAGATION_TASKS.index(task) % len(SERIES)], linewidth=2.5) for task in shown
        ]
        sheet.legend(lines, shown, loc="outside lower center", ncols=len(shown))


def edge_errors(pairs: pd.DataFrame) -> dict[tuple[str, str], np.ndarray]:
    """Return the edge errors of matched boxes, (n, 4) pixels, by kind and task."""
    return {
        (str(kind), str(task)): part[list(EDGES)].to_numpy(float) - part[list(TRUE_EDGES)].to_numpy(float)
        for (kind, task), part in pairs[pairs["hit"]].groupby(["kind", "task"], sort=False)
    }


def _root(share: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(share, 0))


def _draw_edge(axes: Any, parts: Mapping[str, np.ndarray]) -> None:
    bins = np.arange(-REACH - 0.5, REACH + 1)
    tallest = 0.0
    for task, values in parts.items():
        share = np.histogram(values.clip(-REACH, REACH), bins)[0] / len(values)
        axes.stairs(share, bins, color=SERIES[PROPAGATION_TASKS.index(task) % len(SERIES)], linewidth=1.8)
        tallest = max(tallest, float(share.max()))
    axes.axvline(0, color=FAINT, linewidth=0.8)
    axes.set_xlim(-REACH - 0.5, REACH + 0.5)
    if not parts:
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color=FAINT)
        return
    axes.set_yscale(
        "function", functions=(_root, np.square)
    )  # shows small shares next to the peak at 0 of copied boxes
    axes.set_ylim(0, min(1.0, 1.3 * tallest))
    axes.set_yticks([share for share in _TICKS if share <= 1.3 * tallest])
    not_copied = [values for task, values in parts.items() if task not in COPIED]
    errors = np.concatenate(not_copied or list(parts.values()))
    median = float(np.median(errors))
    spread = _SD_OF_MAD * float(np.median(np.abs(errors - median)))
    text = f"n {len(errors)}\nmedian {median:+.1f}\nrobust sd {spread:.1f}"
    axes.text(0.98, 0.97, text, transform=axes.transAxes, ha="right", va="top", color=FAINT, fontsize="small")


def draw_reliability(*, reliability: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write the reliability diagram from tables/reliability.parquet, a panel per kind."""
    bins = read_parquet(reliability, list(COLUMNS))
    with page(figure, width, round(width * 0.7)) as sheet:
        if not len(bins):
            note(sheet, "no label was compared with a true box")
            return
        sources = sorted(set(bins["label_source"]) - {ANY_SOURCE})
        colours = dict(zip(sources, SERIES * len(sources), strict=False)) | {ANY_SOURCE: INK}
        figure_title(sheet, f"Reliability of the labels' confidence with 95 % intervals, source {origin['source']}")
        for axes, kind in zip(sheet.subplots(1, len(BOX_CLASSES)), BOX_CLASSES, strict=True):
            _draw_kind(axes, bins[bins["kind"] == kind], colours)
            axes.set_title(kind)
        sheet.axes[0].set_ylabel("share of correct labels")
        lines = [legend_line(color=colours[name], **_style(name)) for name in (*sources, ANY_SOURCE)]
        sheet.legend(lines, [*sources, "all sources"], loc="outside lower center", ncols=len(lines))


def stretched(share: np.ndarray) -> np.ndarray:
    """Return the axis coordinate of a share: logarithmic towards 1, where most labels are."""
    return -np.log10(np.maximum(1 + _END - share, 1e-6))


def _unstretched(value: np.ndarray) -> np.ndarray:
    return 1 + _END - 10.0**-value


def _draw_kind(axes: Any, bins: pd.DataFrame, colours: dict[str, str]) -> None:
    axes.plot([0, 1], [0, 1], color=FAINT, linewidth=0.8, linestyle="--")
    for axis, scale, limit in (
        (axes.xaxis, axes.set_xscale, axes.set_xlim),
        (axes.yaxis, axes.set_yscale, axes.set_ylim),
    ):
        scale("function", functions=(stretched, _unstretched))
        limit(0, 1.002)
        axis.set_ticks(TICKS)
    axes.set_box_aspect(1)
    axes.grid(visible=True)
    texts = []
    for name, colour in colours.items():
        chosen = bins[bins["label_source"] == name].sort_values("confidence")
        if not len(chosen):
            continue
        correct = chosen["right"].to_numpy(float)
        errors = np.stack([correct - chosen["right_low"], chosen["right_high"] - correct]).clip(0)
        style = {**_style(name), "capsize": 3, "elinewidth": 1.2}
        axes.errorbar(chosen["confidence"], correct, yerr=errors, color=colour, **style)
        texts.append(
            f"{name}: n {round(chosen['labels'].sum())}, ECE {binned_calibration_error(chosen):.3f}, "
            f"Brier {brier_score(chosen):.3f}"
        )
    axes.set_xlabel("confidence\n" + "\n".join(texts), fontsize="small")


def _style(name: str) -> dict[str, Any]:
    """Return the style of a source: points; all sources together have a line and larger, open points."""
    if name == ANY_SOURCE:
        return {"marker": "o", "markersize": 10, "markerfacecolor": "none", "linewidth": 1.2}
    return {"marker": "o", "markersize": 6, "linewidth": 0, "linestyle": "none"}
