"""Precision over recall of every detector, a panel a class, split and detector, a line a domain, a band its seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.formats.schemas import CURVES
from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report import paper
from polarsim.report.figures.canvas import FIGURE_WIDTH, SERIES, note, page
from polarsim.report.seeds import averaged, panels, title_text

STYLES = ("-", ":")  # of the IoU thresholds, the smaller one first


def draw_curves(*, curves: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write the figure from detect/curves.parquet; of several seeds the mean and a band of one standard deviation."""
    table = paper.with_own_names(read_parquet(curves, CURVES.columns), ("trained", "evaluated"), origin["source"])
    text, parts = title_text(table), panels(table)
    parts = [(split, averaged(part, CURVES.columns[:-1], ("precision",))) for split, part in parts]
    detectors = paper.in_order(set(table["trained"]))
    domains = paper.in_order(set(table["evaluated"]))
    kinds = [kind for kind in BOX_CLASSES if (table["kind"] == kind).any()]
    rows = [(kind, split, part) for kind in kinds for split, part in parts]
    with page(figure, width, round(width * (0.08 + 0.3 * max(1, len(rows))))) as sheet:
        if not len(table):
            note(sheet, "no labels to be found")
            return
        sheet.suptitle(f"Precision over recall, source {origin['source']}{text}", x=0.01, ha="left")
        grid = sheet.subplots(len(rows), len(detectors), sharex=True, sharey=True, squeeze=False)
        for row, (kind, split, part) in enumerate(rows):
            for column, trained in enumerate(detectors):
                axes = grid[row, column]
                _draw_panel(axes, part[(part["kind"] == kind) & (part["trained"] == trained)], domains)
                axes.set_title(f"{kind}, trained on {paper.title(trained)}")
            grid[row, 0].set_ylabel("precision" if len(parts) == 1 else f"precision, by {split}")
        for axes in grid[-1]:
            axes.set_xlabel("recall")
        lines = [_line(SERIES[n % len(SERIES)], "-") for n in range(len(domains))]
        names = [f"on {paper.title(domain)}" for domain in domains]
        for iou, style in zip(sorted(table["iou"].unique()), STYLES, strict=False):
            lines.append(_line("black", style))
            names.append(f"IoU {iou:g}")
        sheet.legend(lines, names, loc="outside lower center", ncols=len(names))


def _draw_panel(axes: Any, table: pd.DataFrame, domains: list[str]) -> None:
    for iou, style in zip(sorted(table["iou"].unique()), STYLES, strict=False):
        for number, domain in enumerate(domains):
            part = table[(table["iou"] == iou) & (table["evaluated"] == domain)].sort_values("recall")
            colour, middle = SERIES[number % len(SERIES)], part["precision"]
            axes.plot(part["recall"], middle, style, color=colour, linewidth=1.8)
            if part["precision_sd"].notna().any():
                low, high = middle - part["precision_sd"], middle + part["precision_sd"]
                axes.fill_between(part["recall"], low, high, color=colour, alpha=0.15, linewidth=0)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1.02)
    axes.grid(visible=True)


def _line(colour: str, style: Any) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, linestyle=style, linewidth=2.2)
