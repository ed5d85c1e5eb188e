"""Our surface coloured by its distance from the true one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.schemas import OFFSETS
from polarsim.formats.tables import read_parquet
from polarsim.photo import NO_ROCK
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, note, page
from polarsim.survey import SANDBOX_HALF_WIDTH

RANGE_MM = 5.0  # beyond it colours stay the same
COLOURS = "RdBu_r"  # red outside the true surface, blue inside


def draw_offsets(*, terrain: int, offsets: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write seen points of our meshes from above, coloured by their distance from the true surface, and its spread.

    Parameters
    ----------
    offsets
        Table of `score_rocks`.
    """
    table = read_parquet(offsets, OFFSETS.columns)
    with page(figure, width, round(width * 0.5)) as sheet:
        if not len(table):
            note(sheet, "no surface was seen")
            return
        above, spread = sheet.subplots(1, 2, width_ratios=[1.25, 1])
        sheet.set_layout_engine("compressed")  # the map keeps its scale
        _draw_map(sheet, above, table, f"Terrain {terrain:02d}: our surface, less the true one")
        _draw_spread(spread, table)


def _draw_map(sheet: Any, axes: Any, table: pd.DataFrame, title: str) -> None:
    low_first = table.sort_values("z", kind="stable")
    dots = axes.scatter(
        low_first["x"], low_first["y"], c=low_first["offset_mm"], s=3, cmap=COLOURS, vmin=-RANGE_MM, vmax=RANGE_MM,
        linewidths=0,
    )  # fmt: skip
    axes.set_title(title)
    axes.set(xlabel="x (Sun azimuth 0), m", ylabel="y (Sun azimuth 90), m", facecolor="#f1f3f4")
    axes.set(xlim=(-SANDBOX_HALF_WIDTH, SANDBOX_HALF_WIDTH), ylim=(-SANDBOX_HALF_WIDTH, SANDBOX_HALF_WIDTH))
    axes.set_aspect("equal")
    for rock, part in table[table["rock"] != NO_ROCK].groupby("rock"):
        axes.text(part["x"].mean(), part["y"].max() + 0.02, str(rock), ha="center", va="bottom", color=INK)
    sheet.colorbar(dots, ax=axes, label="offset outwards, mm", shrink=0.8, extend="both")


def _draw_spread(axes: Any, table: pd.DataFrame) -> None:
    """Shares of the points within a distance, of ground and of rocks."""
    axes.set_title("Points within a distance")
    axes.set(xlabel="distance to the true surface, mm", ylabel="share of the points, %")
    axes.set(xlim=(0, RANGE_MM), ylim=(0, 100))
    axes.grid(visible=True)
    level = table["rock"] == NO_ROCK
    for name, mine, colour in (("rocks", ~level, SERIES[1]), ("ground", level, SERIES[0])):
        far = np.sort(table.loc[mine, "offset_mm"].abs().to_numpy(float))
        if len(far):
            median, p90 = np.percentile(far, [50, 90])
            label = f"{name}: median {median:.2f}, 90 % within {p90:.1f} mm"
            axes.plot(far, 100 * np.arange(1, len(far) + 1) / len(far), color=colour, label=label, linewidth=2)
    axes.axhline(90, color=FAINT, linewidth=0.8, linestyle=":")
    axes.legend(loc="lower right")
