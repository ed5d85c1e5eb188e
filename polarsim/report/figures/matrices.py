"""Figures of detectors on domains: detection matrices and bars of IPD, with the paper's values in small print."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import detection_table, ipd_table, paper
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, figure_title, note, page
from polarsim.report.training_seeds import seed_means, split_panels, title_suffix
from polarsim.schemas.detect import DETECTION, IPD

TITLES = {"map50": "mAP@0.5", "map50_95": "mAP@[0.5:0.95]", "iou_mean": "IOU_mean"}


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

    Bars are means over seeds; whiskers range from the minimum to the maximum of the 95 % intervals of all seeds.
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
            _draw_bars(axes, seed_means(part, ("trained", "first", "second"), ("ipd", "ipd_abs")))
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
    axes.set_xticks(x, names)
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
