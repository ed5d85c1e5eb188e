"""Reliability diagram: share of correct labels over the labels' confidence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, figure_title, legend_line, note, page
from polarsim.scoring.reliability import ANY_SOURCE, COLUMNS, binned_calibration_error, brier_score

_END = 0.01  # offset of the logarithmic axis at a share of 1
TICKS = (0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1)


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
