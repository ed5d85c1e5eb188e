"""Precision over recall of every judge, a panel a class and judge, a line a domain."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.tables import paper
from polarsim.tables.figures.canvas import SERIES, note, page
from polarsim.tables.options import TablesOptions
from polarsim.tables.seeds import SEED, first_split

COLUMNS = ("trained", "evaluated", "kind", "iou", "recall", "precision")
STYLES = ("-", ":")  # of the IoU thresholds, the smaller one first


def draw_curves(*, curves: Path, figure: Path, origin: dict[str, str], options: TablesOptions) -> None:
    """Write the figure from detect/curves.parquet; of several seeds the mean."""
    table = paper.with_own_names(read_parquet(curves, COLUMNS), ("trained", "evaluated"), origin["source"])
    table, split = first_split(table)
    if SEED in table.columns:
        table = table.groupby(list(COLUMNS[:-1]))["precision"].mean().reset_index()
    judges = paper.in_order(set(table["trained"]))
    domains = paper.in_order(set(table["evaluated"]))
    kinds = [kind for kind in BOX_CLASSES if (table["kind"] == kind).any()]
    width = options.figure_width_px
    with page(figure, width, round(width * (0.08 + 0.3 * max(1, len(kinds))))) as sheet:
        if not len(table):
            note(sheet, "no labels to be found")
            return
        sheet.suptitle(f"Precision over recall, source {origin['source']}{split}", x=0.01, ha="left")
        grid = sheet.subplots(len(kinds), len(judges), sharex=True, sharey=True, squeeze=False)
        for row, kind in enumerate(kinds):
            for column, trained in enumerate(judges):
                axes = grid[row, column]
                _draw_panel(axes, table[(table["kind"] == kind) & (table["trained"] == trained)], domains)
                axes.set_title(f"{kind}, trained on {paper.title(trained)}")
        for axes in grid[-1]:
            axes.set_xlabel("recall")
        for axes in grid[:, 0]:
            axes.set_ylabel("precision")
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
            axes.plot(part["recall"], part["precision"], style, color=SERIES[number % len(SERIES)], linewidth=1.8)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1.02)
    axes.grid(visible=True)


def _line(colour: str, style: Any) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, linestyle=style, linewidth=2.2)
