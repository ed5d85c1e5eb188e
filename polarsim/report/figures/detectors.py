"""Figures of a run's detectors: detection matrix, precision over recall, IPD, histogram of IoU differences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.report import paper
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, figure_title, legend_line, note, page
from polarsim.report.figures.matrices import draw_detection, draw_ipd
from polarsim.report.ipd_table import tidy_ipd_rocks
from polarsim.report.training_seeds import SEED, seed_means, split_panels, title_suffix
from polarsim.schemas.detect import CURVES, IPD_ROCKS

STYLES = ("-", ":")  # line styles of the IoU thresholds, in ascending order
BINS = np.linspace(-1, 1, 41)


def draw_detectors(
    *,
    detection: Path,
    curves: Path,
    ipd: Path,
    rocks: Path,
    detection_figure: Path,
    curves_figure: Path,
    ipd_figure: Path,
    rocks_figure: Path,
    origin: dict[str, str],
) -> None:
    """Draw the detection matrix, precision over recall, the IPD, and the histogram of IoU differences of rocks."""
    draw_detection(detection=detection, figure=detection_figure, origin=origin)
    draw_curves(curves=curves, figure=curves_figure, origin=origin)
    draw_ipd(ipd=ipd, figure=ipd_figure, origin=origin)
    draw_ipd_histogram(rocks=rocks, figure=rocks_figure, origin=origin)


def draw_curves(*, curves: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write the figure from detect/curves.parquet; bands are one standard deviation over seeds."""
    table = paper.with_display_names(read_parquet(curves, CURVES.columns), ("trained", "evaluated"), origin["source"])
    text, parts = title_suffix(table), split_panels(table)
    parts = [(split, seed_means(part, CURVES.columns[:-1], ("precision",))) for split, part in parts]
    detectors = paper.sorted_domains(set(table["trained"]))
    domains = paper.sorted_domains(set(table["evaluated"]))
    kinds = [kind for kind in BOX_CLASSES if (table["kind"] == kind).any()]
    rows = [(kind, split, part) for kind in kinds for split, part in parts]
    with page(figure, width, round(width * (0.08 + 0.3 * max(1, len(rows))))) as sheet:
        if not len(table):
            note(sheet, "no labels in the test photos")
            return
        band = "; bands: standard deviation over seeds" if "mean of" in text else ""
        figure_title(sheet, f"Precision over recall of detectors, source {origin['source']}{text}{band}")
        grid = sheet.subplots(len(rows), len(detectors), sharex=True, sharey=True, squeeze=False)
        for row, (kind, split, part) in enumerate(rows):
            for column, trained in enumerate(detectors):
                axes = grid[row, column]
                _draw_lines(axes, part[(part["kind"] == kind) & (part["trained"] == trained)], domains)
                axes.set_title(f"{kind}, trained on {paper.domain_title(trained)}")
            grid[row, 0].set_ylabel("precision" if len(parts) == 1 else f"precision, by {split}")
        for axes in grid[-1]:
            axes.set_xlabel("recall")
        lines = [legend_line(color=SERIES[n % len(SERIES)], linewidth=2.2) for n in range(len(domains))]
        names = [f"evaluated on {paper.domain_title(domain)}" for domain in domains]
        for iou, style in zip(sorted(table["iou"].unique()), STYLES, strict=False):
            lines.append(legend_line(color="black", linestyle=style, linewidth=2.2))
            names.append(f"IoU {iou:g}")
        sheet.legend(lines, names, loc="outside lower center", ncols=len(names))


def _draw_lines(axes: Any, table: pd.DataFrame, domains: list[str]) -> None:
    for iou, style in zip(sorted(table["iou"].unique()), STYLES, strict=False):
        for number, domain in enumerate(domains):
            part = table[(table["iou"] == iou) & (table["evaluated"] == domain)].sort_values("recall")
            colour, precision = SERIES[number % len(SERIES)], part["precision"]
            axes.plot(part["recall"], precision, style, color=colour, linewidth=1.8)
            if part["precision_sd"].notna().any():
                low, high = precision - part["precision_sd"], precision + part["precision_sd"]
                axes.fill_between(part["recall"], low, high, color=colour, alpha=0.15, linewidth=0)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1.02)
    axes.grid(visible=True)


def draw_ipd_histogram(*, rocks: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write the figure from detect/rocks.parquet; each rock counts once per seed with the mean IoU over photos."""
    table = tidy_ipd_rocks(read_parquet(rocks, IPD_ROCKS.columns), origin["source"])
    table = table[table["kind"] == ROCK]
    detectors = list(dict.fromkeys(table["trained"]))
    rows = [(split, part, trained) for split, part in split_panels(table) for trained in detectors]
    title = title_suffix(table).replace("mean of", "pooled over")
    pairs = sorted(
        set(zip(table["first"], table["second"], strict=True)),
        key=lambda pair: [paper.domain_rank(name) for name in pair],
    )
    with page(figure, width, round(width * (0.06 + 0.2 * max(1, len(rows))))) as sheet:
        if not len(table):
            note(sheet, "no rock is labelled in two domains")
            return
        figure_title(sheet, f"Mean IoU of each rock, first minus second domain, source {origin['source']}{title}")
        grid = sheet.subplots(len(rows), len(pairs), sharex=True, sharey=True, squeeze=False)
        for row, (split, part, trained) in enumerate(rows):
            for column, (first, second) in enumerate(pairs):
                chosen = (part["trained"] == trained) & (part["first"] == first) & (part["second"] == second)
                _draw_differences(grid[row, column], part[chosen])
                if not row:
                    grid[row, column].set_title(f"{paper.domain_title(first)} - {paper.domain_title(second)}")
            of_split = f"\nsplit by {split}" if len(rows) > len(detectors) else ""
            grid[row, 0].set_ylabel(f"number of rocks,\ntrained on {paper.domain_title(trained)}{of_split}")
        for axes in grid[-1]:
            axes.set_xlabel("difference of mean IoU")


def _draw_differences(axes: Any, table: pd.DataFrame) -> None:
    difference = table["difference"].to_numpy(float)
    axes.hist(difference.clip(-1, 1), BINS, color=SERIES[0])
    axes.axvline(0, color=FAINT, linewidth=1)
    axes.set_xlim(-1, 1)
    axes.grid(visible=True, axis="y")
    if not len(difference):
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color=FAINT)
        return
    mean = float(difference.mean())
    axes.axvline(mean, color=SERIES[1], linewidth=2)
    seeds = table[SEED].nunique() if SEED in table.columns else 1
    counts = f"{len(table.drop_duplicates(['terrain', 'rock']))} rocks" + (f", {seeds} seeds" if seeds > 1 else "")
    text = f"{counts}\nmean {mean:+.3f}\nmean |x| {np.abs(difference).mean():.3f}"
    axes.text(0.02, 0.96, text, transform=axes.transAxes, ha="left", va="top", color=INK, fontsize="small")
