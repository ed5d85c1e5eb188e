"""How often labels are right, against how sure they say they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, heading, legend_line, note, page
from polarsim.scoring.reliability import ANY_SOURCE, COLUMNS, brier_score, calibration_error

_END = 0.01  # how near to 1 the stretched axis comes to an end
TICKS = (0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1)


def draw_reliability(*, reliability: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write the reliability diagram, a panel a kind, from tables/reliability.parquet."""
    bins = read_parquet(reliability, list(COLUMNS))
    with page(figure, width, round(width * 0.7)) as sheet:
        if not len(bins):
            note(sheet, "no label was compared with a true box")
            return
        sources = sorted(set(bins["label_source"]) - {ANY_SOURCE})
        colours = dict(zip(sources, SERIES * len(sources), strict=False)) | {ANY_SOURCE: INK}
        heading(sheet, f"Confidence of labels, source {origin['source']}")
        for axes, kind in zip(sheet.subplots(1, len(BOX_CLASSES)), BOX_CLASSES, strict=True):
            _draw_kind(axes, bins[bins["kind"] == kind], colours)
            axes.set_title(kind)
        sheet.axes[0].set_ylabel("share of labels that are right")
        lines = [legend_line(color=colours[name], **_look(name)) for name in (*sources, ANY_SOURCE)]
        sheet.legend(lines, [*sources, "all sources"], loc="outside lower center", ncols=len(lines))


def stretched(share: np.ndarray) -> np.ndarray:
    """Where a share stands on an axis: most labels are sure and right, so the end towards 1 has the most room."""
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
        right = chosen["right"].to_numpy(float)
        reach = np.stack([right - chosen["right_low"], chosen["right_high"] - right]).clip(0)
        axes.errorbar(chosen["confidence"], right, yerr=reach, color=colour, **_look(name), capsize=3, elinewidth=1.2)
        texts.append(
            f"{name}: n {round(chosen['labels'].sum())}, ECE {calibration_error(chosen):.3f}, "
            f"Brier {brier_score(chosen):.3f}"
        )
    axes.set_xlabel("confidence\n" + "\n".join(texts), fontsize="small")


def _look(name: str) -> dict[str, Any]:
    """Sources are points; all together are a line through larger, open points."""
    if name == ANY_SOURCE:
        return {"marker": "o", "markersize": 10, "markerfacecolor": "none", "linewidth": 1.2}
    return {"marker": "o", "markersize": 6, "linewidth": 0, "linestyle": "none"}
