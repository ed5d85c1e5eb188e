"""How far the edges of propagated boxes lie from the true ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, SERIES, heading, legend_line, note, page
from polarsim.report.figures.reliability import draw_reliability
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.label_pairs import EDGES, TRUE_EDGES
from polarsim.scoring.labels import EXPOSURES, LIGHT, TASKS
from polarsim.scoring.metrics import TRUTH_NAMES

SIDES = ("left", "top", "right", "bottom")
REACH = 20  # pixels to both sides that the histograms show
COPIED = (EXPOSURES, LIGHT)  # left out of the printed medians where other tasks are there: mostly zeros
_SHARES = (0, 0.01, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1)  # that are written at the axis
_GOOD = 1.4826  # robust sd over median absolute deviation


def draw_label_scores(
    *,
    terrains: Sequence[int],
    pairs: Sequence[Path],
    reliability: Path,
    label_errors: Sequence[Path],
    reliability_figure: Path,
    origin: dict[str, str],
) -> None:
    """Draw the edge errors of each terrain and the reliability diagram, see `draw_label_errors`, `draw_reliability`."""
    for terrain, path, figure in zip(terrains, pairs, label_errors, strict=True):
        draw_label_errors(terrain=terrain, pairs=path, figure=figure)
    draw_reliability(reliability=reliability, figure=reliability_figure, origin=origin)


def draw_label_errors(*, terrain: int, pairs: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write histograms of edge errors, a row a kind, a column an edge, a line a task, from `label_pairs`."""
    table = read_parquet(pairs, LABEL_PAIRS.columns)
    errors = edge_errors(table)
    name = TRUTH_NAMES[table["against"].iloc[0]] if len(table) else ""
    with page(figure, width, round(width * 0.5)) as sheet:
        if not errors:
            note(sheet, f"Terrain {terrain:02d}: no box of both")
            return
        heading(sheet, f"Terrain {terrain:02d}: edges of our boxes less those of {name}")
        grid = sheet.subplots(len(BOX_CLASSES), len(SIDES), sharex=True, squeeze=False)
        for row, kind in enumerate(BOX_CLASSES):
            parts = {task: errors[kind, task] for task in TASKS if (kind, task) in errors}
            for column, edge in enumerate(SIDES):
                _draw_edge(grid[row, column], {task: values[:, column] for task, values in parts.items()})
                grid[row, column].set_title(f"{kind}, {edge}")
        for axes in grid[-1]:
            axes.set_xlabel("error, px")
        for axes in grid[:, 0]:
            axes.set_ylabel("share of boxes, root scale")
        shown = [task for task in TASKS if any(task == part for _, part in errors)]
        lines = [legend_line(color=SERIES[TASKS.index(task) % len(SERIES)], linewidth=2.5) for task in shown]
        sheet.legend(lines, shown, loc="outside lower center", ncols=len(shown))


def edge_errors(pairs: pd.DataFrame) -> dict[tuple[str, str], np.ndarray]:
    """Our edges less the true ones, (n, 4) pixels, of paired boxes by kind and task."""
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
        axes.stairs(share, bins, color=SERIES[TASKS.index(task) % len(SERIES)], linewidth=1.8)
        tallest = max(tallest, float(share.max()))
    axes.axvline(0, color=FAINT, linewidth=0.8)
    axes.set_xlim(-REACH - 0.5, REACH + 0.5)
    if not parts:
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color=FAINT)
        return
    axes.set_yscale("function", functions=(_root, np.square))  # copies pile up at 0: they are shown, and the rest too
    axes.set_ylim(0, min(1.0, 1.3 * tallest))
    axes.set_yticks([share for share in _SHARES if share <= 1.3 * tallest])
    moved = [values for task, values in parts.items() if task not in COPIED]
    everything = np.concatenate(moved or list(parts.values()))
    median = float(np.median(everything))
    spread = _GOOD * float(np.median(np.abs(everything - median)))
    text = f"n {len(everything)}\nmedian {median:+.1f}\nrobust sd {spread:.1f}"
    axes.text(0.98, 0.97, text, transform=axes.transAxes, ha="right", va="top", color=FAINT, fontsize="small")
