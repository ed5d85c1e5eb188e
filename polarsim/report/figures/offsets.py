"""Figure of the signed distance between reconstructed and true surface."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, LETTER_M, PLAIN, SERIES, name_positions, note, page
from polarsim.report.figures.terrain import map_half_m
from polarsim.schemas.evaluation import OFFSETS
from polarsim.site import Site
from polarsim.site_parts import Sandbox

RANGES_MM = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # possible limits of the colour scale
SHOWN_SHARE = 95  # minimum percentage of the points within the limit
COLOURS = "RdBu_r"  # red outside the true surface, blue inside


def draw_offsets(
    *, site: Site, terrain: Terrain, offsets: Path | None, figure: Path | None, width: int = FIGURE_WIDTH
) -> None:
    """Write a map of the visible mesh points, coloured by the distance from the true surface, and its distribution.

    Without ground truth there are no `offsets` and there is no figure.
    """
    if offsets is None or figure is None:
        return
    table = read_parquet(offsets, OFFSETS.columns)
    with page(figure, width, round(width * 0.5)) as sheet:
        if not len(table):
            note(sheet, "no visible surface")
            return
        above, distribution = sheet.subplots(1, 2, width_ratios=[1.25, 1])
        reach = range_mm(table["offset_mm"].to_numpy(float))
        title = f"Terrain {terrain_text(terrain)}: reconstructed minus true surface"
        _draw_map(sheet, above, table, title, reach, site.sandbox_of(terrain))
        _draw_distribution(distribution, table, max(reach, RANGES_MM[2]))


def range_mm(offsets: np.ndarray) -> float:
    """Return the smallest colour limit in `RANGES_MM` for `SHOWN_SHARE` percent of the offsets (n,), mm."""
    wanted = float(np.percentile(np.abs(offsets), SHOWN_SHARE))
    return next((reach for reach in RANGES_MM if reach >= wanted), RANGES_MM[-1])


def _draw_map(sheet: Any, axes: Any, table: pd.DataFrame, title: str, reach: float, sandbox: Sandbox) -> None:
    low_first = table.sort_values("z", kind="stable")
    dots = axes.scatter(
        low_first["x"], low_first["y"], c=low_first["offset_mm"], s=14, cmap=COLOURS, vmin=-reach, vmax=reach,
        linewidths=0,
    )  # fmt: skip
    axes.set_title(title)
    axes.set(xlabel="x (Sun azimuth 0), m", ylabel="y (Sun azimuth 90), m", facecolor="#f1f3f4")
    along_x, along_y = map_half_m(sandbox)
    axes.set(xlim=(-along_x, along_x), ylim=(-along_y, along_y))
    axes.set_aspect("equal")
    rocks = {str(rock): part for rock, part in table[table["rock"] != NO_ROCK].groupby("rock")}
    boxes = {rock: (p["x"].min(), p["y"].min(), p["x"].max(), p["y"].max()) for rock, p in rocks.items()}
    for rock, (x, y) in name_positions(boxes, LETTER_M).items():
        axes.text(x, y, rock, ha="center", va="center", color=INK, bbox=PLAIN)
    # Inset axes: separate axes for the colour bar would overlap the label of the map's y axis.
    label = "signed distance, mm (positive: outside)"
    sheet.colorbar(dots, cax=axes.inset_axes((1.03, 0.1, 0.04, 0.8)), label=label, extend="both")


def _draw_distribution(axes: Any, table: pd.DataFrame, reach: float) -> None:
    """Draw the cumulative distribution of the distances of ground and rocks."""
    axes.set_title("Cumulative distribution of the distance")
    axes.set(xlabel="distance to the true surface, mm", ylabel="share of the points, %")
    axes.set(xlim=(0, reach), ylim=(0, 101))
    axes.grid(visible=True)
    ground = table["rock"] == NO_ROCK
    for name, rows, colour in (("rocks", ~ground, SERIES[1]), ("ground", ground, SERIES[0])):
        distance = np.sort(table.loc[rows, "offset_mm"].abs().to_numpy(float))
        if len(distance):
            median, p90 = np.percentile(distance, [50, 90])
            label = f"{name}: median {median:.2f}, 90 % within {p90:.1f} mm"
            percent = 100 * np.arange(1, len(distance) + 1) / len(distance)
            axes.plot(distance, percent, color=colour, label=label, linewidth=2)
    axes.axhline(90, color=FAINT, linewidth=0.8, linestyle=":")
    axes.legend(loc="lower right")
