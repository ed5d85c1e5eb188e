"""How the performance of single rocks differs between two domains: a histogram a detector and pair."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, note, page
from polarsim.report.ipd_rocks_table import COLUMNS, tidy_ipd_rocks
from polarsim.report.seeds import SEED, panels, title_text

BINS = np.linspace(-1, 1, 41)


def draw_ipd_histogram(*, rocks: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write the figure from detect/rocks.parquet: a rock counts once a seed, by the mean over its photos."""
    table = tidy_ipd_rocks(read_parquet(rocks, COLUMNS), origin["source"])
    table = table[table["kind"] == ROCK]
    detectors = list(dict.fromkeys(table["trained"]))
    rows = [(split, part, trained) for split, part in panels(table) for trained in detectors]
    title = title_text(table).replace("mean of", "pooled over")
    pairs = sorted(
        set(zip(table["first"], table["second"], strict=True)), key=lambda pair: [paper.rank(name) for name in pair]
    )
    with page(figure, width, round(width * (0.06 + 0.2 * max(1, len(rows))))) as sheet:
        if not len(table):
            note(sheet, "no rock is labelled in two domains")
            return
        sheet.suptitle(
            f"Mean IoU of each rock, first domain less second, source {origin['source']}{title}", x=0.01, ha="left"
        )
        grid = sheet.subplots(len(rows), len(pairs), sharex=True, sharey=True, squeeze=False)
        for row, (split, part, trained) in enumerate(rows):
            for column, (first, second) in enumerate(pairs):
                chosen = (part["trained"] == trained) & (part["first"] == first) & (part["second"] == second)
                _draw_panel(grid[row, column], part[chosen])
                if not row:
                    grid[row, column].set_title(f"{paper.title(first)} - {paper.title(second)}")
            which = f"\nsplit by {split}" if len(rows) > len(detectors) else ""
            grid[row, 0].set_ylabel(f"rocks, trained\non {paper.title(trained)}{which}")
        for axes in grid[-1]:
            axes.set_xlabel("difference of mean IoU")


def _draw_panel(axes: Any, table: pd.DataFrame) -> None:
    gain = table["difference"].to_numpy(float)
    axes.hist(gain.clip(-1, 1), BINS, color=SERIES[0])
    axes.axvline(0, color=FAINT, linewidth=1)
    axes.set_xlim(-1, 1)
    axes.grid(visible=True, axis="y")
    if not len(gain):
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color=FAINT)
        return
    mean = float(gain.mean())
    axes.axvline(mean, color=SERIES[1], linewidth=2)
    seeds = table[SEED].nunique() if SEED in table.columns else 1
    counted = f"{len(table.drop_duplicates(['terrain', 'rock']))} rocks" + (f", {seeds} seeds" if seeds > 1 else "")
    text = f"{counted}\nmean {mean:+.3f}\nmean size {np.abs(gain).mean():.3f}"
    axes.text(0.02, 0.96, text, transform=axes.transAxes, ha="left", va="top", color=INK, fontsize="small")
