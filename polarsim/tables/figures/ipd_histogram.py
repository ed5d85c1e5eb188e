"""How the performance of single rocks differs between two domains: a histogram a judge and pair."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.tables import paper
from polarsim.tables.figures.canvas import FAINT, INK, SERIES, note, page
from polarsim.tables.ipd_rocks_table import COLUMNS, tidy_ipd_rocks
from polarsim.tables.options import TablesOptions
from polarsim.tables.seeds import first_training

BINS = np.linspace(-1, 1, 41)


def draw_ipd_histogram(*, rocks: Path, figure: Path, origin: dict[str, str], options: TablesOptions) -> None:
    """Write the figure from detect/rocks.parquet: a rock of a terrain counts once, by the mean over its photos."""
    table = tidy_ipd_rocks(read_parquet(rocks, COLUMNS), origin["source"])
    table, which = first_training(table[table["kind"] == ROCK])
    judges = list(dict.fromkeys(table["trained"]))
    pairs = sorted(
        set(zip(table["first"], table["second"], strict=True)), key=lambda pair: [paper.rank(name) for name in pair]
    )
    width = options.figure_width_px
    with page(figure, width, round(width * (0.06 + 0.2 * max(1, len(judges))))) as sheet:
        if not len(table):
            note(sheet, "no rock is labelled in two domains")
            return
        sheet.suptitle(
            f"Mean IoU of each rock, first domain less second, source {origin['source']}{which}", x=0.01, ha="left"
        )
        grid = sheet.subplots(len(judges), len(pairs), sharex=True, sharey=True, squeeze=False)
        for row, trained in enumerate(judges):
            for column, (first, second) in enumerate(pairs):
                chosen = (table["trained"] == trained) & (table["first"] == first) & (table["second"] == second)
                _draw_panel(grid[row, column], table[chosen])
                if not row:
                    grid[row, column].set_title(f"{paper.title(first)} - {paper.title(second)}")
            grid[row, 0].set_ylabel(f"rocks, trained\non {paper.title(trained)}")
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
    text = f"{len(gain)} rocks\nmean {mean:+.3f}\nmean size {np.abs(gain).mean():.3f}"
    axes.text(0.02, 0.96, text, transform=axes.transAxes, ha="left", va="top", color=INK, fontsize="small")
