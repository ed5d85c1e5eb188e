"""Figures of detectors: detection matrix, IPD with the paper's values, precision over recall, IoU differences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.report import detection_table, ipd_table, paper
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, figure_title, legend_line, note, page
from polarsim.report.ipd_table import tidy_ipd_rocks
from polarsim.report.training_seeds import SEED, seed_means, split_panels, title_suffix
from polarsim.schemas.detect import CURVES, DETECTION, IPD, IPD_ROCKS

STYLES = ("-", ":")  # line styles of the IoU thresholds, in ascending order
BINS = np.linspace(-1, 1, 41)
TITLES = {"map50": "mAP@0.5", "map50_95": "mAP@[0.5:0.95]", "iou_mean": "IOU_mean"}
_FULL_SIZE_NAMES = 12  # maximum number of pairs of domains whose names fit below the bars in full size
_SMALL_NAMES = 24  # maximum number in small size; of more pairs, those with photos are shown


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
                    grid[row, column].set_title(paper.pair_title(first, second))
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


def draw_detection(*, detection: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write three matrices of rock detection per split, means over seeds; rows are detectors, columns domains."""
    table = detection_table.tidy_detection(read_parquet(detection, DETECTION.columns), origin["source"])
    rocks = table[table["kind"] == ROCK]
    parts = split_panels(rocks)
    with page(figure, width, round(width * 0.42) * len(parts)) as sheet:
        if not len(rocks):
            note(sheet, "no labelled rocks in the test photos")
            return
        small = " (small: values of the paper)" if rocks["paper_map50"].notna().any() else ""
        figure_title(sheet, f"Rock detection by domain, source {origin['source']}{title_suffix(rocks)}{small}")
        for row, (split, part) in zip(sheet.subplots(len(parts), 3, squeeze=False), parts, strict=True):
            means = seed_means(part, ("trained", "evaluated"), list(TITLES))
            for axes, measure in zip(row, TITLES, strict=True):
                _draw_matrix(axes, means, measure)
            row[0].set_ylabel("trained on" if len(parts) == 1 else f"split by {split}, trained on")


def draw_ipd(*, ipd: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write bars of the IPD of rocks: a group per detector and pair of domains, a panel per split.

    Of many pairs, those of photos and twins are shown. Bars are means over seeds; whiskers range from the minimum to
    the maximum of the 95 % intervals of all seeds.
    """
    table = ipd_table.tidy_ipd(read_parquet(ipd, IPD.columns), origin["source"])
    rocks = table[(table["kind"] == ROCK) & table["ipd"].notna()]
    parts = split_panels(rocks)
    with page(figure, width, round(width * 0.42) * len(parts)) as sheet:
        if not len(rocks):
            note(sheet, "no rock is labelled in two domains")
            return
        title = f"IPD of rocks with 95 % intervals, source {origin['source']}{title_suffix(rocks)}"
        for axes, (split, part) in zip(sheet.subplots(len(parts), squeeze=False)[:, 0], parts, strict=True):
            axes.set_title(title if len(parts) == 1 else f"{title}, split by {split}")
            means = seed_means(part, ("trained", "first", "second"), ("ipd", "ipd_abs"))
            photos = min(set(part["first"]) | set(part["second"]), key=paper.domain_rank)
            with_photos = (means["first"] == photos) | (means["second"] == photos)
            _draw_bars(axes, means[with_photos] if len(means) > _SMALL_NAMES else means)
        sheet.legend(*sheet.axes[0].get_legend_handles_labels(), ncols=3, loc="outside upper right")


def _draw_bars(axes: Any, rocks: pd.DataFrame) -> None:
    x = np.arange(len(rocks))
    for offset, name, text, colour in (
        (-0.2, "ipd", "|mean difference|", SERIES[0]),
        (0.2, "ipd_abs", "mean |difference|", SERIES[1]),
    ):
        value = rocks[name].to_numpy(float)
        below, above = value - rocks[f"{name}_low"].to_numpy(float), rocks[f"{name}_high"].to_numpy(float) - value
        errors = np.nan_to_num(np.stack([below, above])).clip(0)
        axes.bar(x + offset, value, 0.36, yerr=errors, color=colour, label=text, ecolor=INK, capsize=4)
    published = rocks["paper_ipd"].to_numpy(float)
    if not np.isnan(published).all():
        axes.plot(x - 0.2, published, "D", color="white", markeredgecolor=INK, label="paper: |mean difference|")
    names = [
        f"{paper.domain_title(first)} -\n{paper.domain_title(second)}"
        for first, second in zip(rocks["first"], rocks["second"], strict=True)
    ]
    axes.set_xticks(x, names, fontsize="x-small" if len(rocks) > _FULL_SIZE_NAMES else "medium")
    axes.set_ylabel("difference of IoU")
    axes.set_ylim(bottom=0)
    axes.grid(visible=True, axis="y")
    _name_detectors(axes, rocks)


def _draw_matrix(axes: Any, rocks: pd.DataFrame, measure: str) -> None:
    trained, evaluated = paper.sorted_domains(set(rocks["trained"])), paper.sorted_domains(set(rocks["evaluated"]))
    values = np.full((len(trained), len(evaluated)), np.nan)
    published, spread = np.full_like(values, np.nan), np.full_like(values, np.nan)
    for row in rocks.to_dict("records"):
        cell = trained.index(row["trained"]), evaluated.index(row["evaluated"])
        values[cell], published[cell] = row[measure], row[f"paper_{measure}"]
        spread[cell] = row[f"{measure}_sd"]
    axes.imshow(values, cmap="Blues", vmin=0, vmax=1.3)  # keeps dark text legible
    axes.set_title(TITLES[measure])
    axes.set_xticks(range(len(evaluated)), [paper.domain_title(domain) for domain in evaluated])
    axes.set_yticks(range(len(trained)), [paper.domain_title(domain) for domain in trained], rotation=90, va="center")
    axes.set_xlabel("evaluated on")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    for (row_number, column), value in np.ndenumerate(values):
        text = "–" if np.isnan(value) else f"{value:.3f}"
        axes.text(column, row_number, text, ha="center", va="center", fontsize="x-large", color=INK)
        if not np.isnan(spread[row_number, column]):
            small = f"± {spread[row_number, column]:.3f}"
            axes.text(column, row_number + 0.17, small, ha="center", va="center", fontsize="small", color=INK)
        if not np.isnan(published[row_number, column]):
            small = f"paper {published[row_number, column]:.3f}"
            axes.text(column, row_number + 0.3, small, ha="center", va="center", fontsize="small", color=INK)


def _name_detectors(axes: Any, rocks: pd.DataFrame) -> None:
    """Write the detector below each group of bars and draw a line between groups."""
    for trained in dict.fromkeys(rocks["trained"]):
        members = np.flatnonzero(rocks["trained"] == trained)
        text = f"trained on {paper.domain_title(trained)}"
        axes.text(members.mean(), -0.2, text, transform=axes.get_xaxis_transform(), ha="center", va="top", color=FAINT)
        if members[-1] < len(rocks) - 1:
            axes.axvline(members[-1] + 0.5, color=FAINT, linewidth=0.8)
