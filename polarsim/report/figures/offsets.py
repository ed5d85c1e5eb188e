"""Our surface coloured by its distance from the true one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import NO_ROCK
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, LETTER_M, PLAIN, SERIES, beside, note, page
from polarsim.schemas.evaluation import OFFSETS
from polarsim.survey import SANDBOX_HALF_WIDTH

RANGES_MM = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # beyond the chosen one colours stay the same
SHOWN_SHARE = 95  # percent of the points that the chosen range holds
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
        reach = range_mm(table["offset_mm"].to_numpy(float))
        _draw_map(sheet, above, table, f"Terrain {terrain:02d}: our surface, less the true one", reach)
        _draw_spread(spread, table, max(reach, RANGES_MM[2]))


def range_mm(offsets: np.ndarray) -> float:
    """The least range of colours that shows nearly all offsets (n,)."""
    wanted = float(np.percentile(np.abs(offsets), SHOWN_SHARE))
    return next((reach for reach in RANGES_MM if reach >= wanted), RANGES_MM[-1])


def _draw_map(sheet: Any, axes: Any, table: pd.DataFrame, title: str, reach: float) -> None:
    low_first = table.sort_values("z", kind="stable")
    dots = axes.scatter(
        low_first["x"], low_first["y"], c=low_first["offset_mm"], s=14, cmap=COLOURS, vmin=-reach, vmax=reach,
        linewidths=0,
    )  # fmt: skip
    axes.set_title(title)
    axes.set(xlabel="x (Sun azimuth 0), m", ylabel="y (Sun azimuth 90), m", facecolor="#f1f3f4")
    axes.set(xlim=(-SANDBOX_HALF_WIDTH, SANDBOX_HALF_WIDTH), ylim=(-SANDBOX_HALF_WIDTH, SANDBOX_HALF_WIDTH))
    axes.set_aspect("equal")
    rocks = {str(rock): part for rock, part in table[table["rock"] != NO_ROCK].groupby("rock")}
    boxes = {rock: (p["x"].min(), p["y"].min(), p["x"].max(), p["y"].max()) for rock, p in rocks.items()}
    for rock, (x, y) in beside(boxes, LETTER_M).items():
        axes.text(x, y, rock, ha="center", va="center", color=INK, bbox=PLAIN)
    # A part of the map's axes: room for one of its own is taken from the label on the other side.
    sheet.colorbar(dots, cax=axes.inset_axes((1.03, 0.1, 0.04, 0.8)), label="offset outwards, mm", extend="both")


def _draw_spread(axes: Any, table: pd.DataFrame, reach: float) -> None:
    """Shares of the points within a distance, of ground and of rocks."""
    axes.set_title("Points within a distance")
    axes.set(xlabel="distance to the true surface, mm", ylabel="share of the points, %")
    axes.set(xlim=(0, reach), ylim=(0, 101))
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
