"""Figure of size-frequency distributions of rocks, with the law of Golombek and Rapp and errors of the axes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.geometry.planes import PlanAxis
from polarsim.geometry.size_frequency import (
    Abundance,
    covered_share,
    fit_abundance,
    number_density,
    poisson_interval,
)
from polarsim.photo import Terrain, terrain_text
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, LINE, PLAIN, SERIES, note, page
from polarsim.wording import counted

MAP_PX = 900  # maximum number of drawn cells along a side of a map
ERROR_LIMIT = 40  # percent, limit of the panel of errors
STEPS = (1, 2, 5)  # ticks of axes of lengths, times powers of ten


def draw_rock_sizes(
    path: Path,
    rocks: pd.DataFrame,
    diameters: Mapping[Terrain, np.ndarray],
    areas: Mapping[Terrain, float],
    smallest: float,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write cumulative numbers and covered shares of all terrains, and errors of axes or, without truth, their ratios.

    `rocks`: rows of `tables/rock_sizes`. `smallest`: minimum diameter of the fit of the law, metres.
    """
    every = np.concatenate([np.zeros(0), *diameters.values()])
    with page(path, width, round(width * 0.4)) as sheet:
        if not len(every):
            note(sheet, "no rock with a mesh")
            return
        number, share, axes = sheet.subplots(1, 3)
        area = sum(areas.values())
        fit = fit_abundance(every, area, smallest)
        if len(areas) > 1:
            draw_terrains(number, diameters, areas)
        draw_numbers(number, every, area, fit, smallest)
        draw_shares(share, every, area, fit, smallest)
        if rocks["true_a_m"].notna().any():
            _draw_errors(axes, rocks)
        else:
            draw_forms(axes, rocks)


def draw_cloud_rocks(
    path: Path,
    rocks: pd.DataFrame,
    heights: np.ndarray,
    rock_of_cell: np.ndarray,
    grid: tuple[PlanAxis, PlanAxis],
    unit: str,
    area: float,
    smallest: float,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write a map of a cloud with its rocks, their cumulative number and covered share, and their form.

    `heights`, `rock_of_cell` (rows, columns): height of the surface above a level plane, metres, and number of the
    rock, 0 for ground. `grid`: axes of columns and rows in the `unit` of the file. `smallest`: minimum diameter of the
    fit, metres.
    """
    with page(path, width, round(width * 0.6)) as sheet:
        places = sheet.subplot_mosaic([["map", "map", "numbers"], ["map", "map", "shares"]])
        _draw_map(places["map"], rocks, heights, rock_of_cell, grid, unit)
        diameters = rocks["diameter_m"].to_numpy(float)
        if not len(diameters):
            for name in ("numbers", "shares"):
                places[name].set_axis_off()
            return
        fit = fit_abundance(diameters, area, smallest)
        draw_numbers(places["numbers"], diameters, area, fit, smallest)
        draw_shares(places["shares"], diameters, area, fit, smallest)


def _draw_map(
    axes: Any,
    rocks: pd.DataFrame,
    heights: np.ndarray,
    rock_of_cell: np.ndarray,
    grid: tuple[PlanAxis, PlanAxis],
    unit: str,
) -> None:
    """Draw the heights of the surface as colours with the outlines and numbers of rocks."""
    step = max(1, -(-max(heights.shape) // MAP_PX))
    shown, owner = heights[::step, ::step], rock_of_cell[::step, ::step]
    sides = [
        axis.start + end * axis.step for axis, size in zip(grid, heights.shape[::-1], strict=True) for end in (0, size)
    ]
    low, high = np.nanpercentile(shown, [1, 99.5])  # walls and holes have arrows at the ends of the colour bar
    high = max(high, np.nanmax(shown[owner > 0], initial=high))
    drawn = axes.imshow(shown, origin="lower", extent=sides, cmap="cividis", vmin=low, vmax=high)
    extend = ("neither", "min", "max", "both")[int(np.nanmin(shown) < low) + 2 * int(np.nanmax(shown) > high)]
    axes.figure.colorbar(drawn, ax=axes, label="height, m", shrink=0.6, extend=extend)
    x, y = (
        axis.start + (np.arange(size) + 0.5) * axis.step * step
        for axis, size in zip(grid, owner.shape[::-1], strict=True)
    )
    if (owner > 0).any():
        axes.contour(x, y, (owner > 0).astype(float), levels=[0.5], colors=[SERIES[1]], linewidths=1)
    for rock in rocks["rock"]:
        rows, columns = np.nonzero(owner == rock)
        if len(rows):
            axes.text(x[columns.max()], y[rows.max()], str(rock), color=INK, bbox=PLAIN, fontsize="small")
    axes.set(xlabel=f"{grid[0].name}, {unit}", ylabel=f"{grid[1].name}, {unit}")
    axes.set_title(counted(len(rocks), "rock"))


def draw_numbers(axes: Any, diameters: np.ndarray, area: float, fit: Abundance, smallest: float) -> None:
    """Draw the cumulative number of rocks per m^2 over the diameter, with Poisson intervals and the law."""
    ordered = np.sort(diameters)[::-1]
    count = np.arange(1, len(ordered) + 1)
    low, high = poisson_interval(count)
    axes.fill_between(ordered, low / area, high / area, step="pre", color=SERIES[0], alpha=0.2, linewidth=0)
    _steps(axes, diameters, np.full(len(diameters), 1 / area), SERIES[0], 2)
    _draw_law(axes, number_density, fit, smallest, ordered[0])
    axes.set(yscale="log", ylabel="rocks of at least D per m$^2$", ylim=(0.3 / area, None))
    _scale_lengths(axes, "diameter D, m", diameters)
    axes.set_title("Cumulative number")
    axes.grid(visible=True)


def draw_terrains(axes: Any, diameters: Mapping[Terrain, np.ndarray], areas: Mapping[Terrain, float]) -> None:
    """Draw the cumulative number of rocks per m^2 of each terrain, with its name above the smallest rock."""
    every = np.concatenate(list(diameters.values()))
    middle = np.sqrt(every.min() * every.max())  # of the logarithmic axis
    for terrain, values in diameters.items():
        if len(values):
            _steps(axes, values, np.full(len(values), 1 / areas[terrain]), FAINT, 0.8)
            smallest = values.min()
            side = "left" if smallest < middle else "right"
            place = smallest, len(values) / areas[terrain]
            axes.annotate(terrain_text(terrain), place, color=FAINT, fontsize="small", ha=side, va="bottom")


def draw_shares(axes: Any, diameters: np.ndarray, area: float, fit: Abundance, smallest: float) -> None:
    """Draw the cumulative share of the ground that rocks cover, with the law."""
    _steps(axes, diameters, np.pi / 4 * diameters**2 / area, SERIES[0], 2)
    _draw_law(axes, covered_share, fit, smallest, diameters.max())
    axes.set(yscale="log", ylabel="share covered by rocks of at least D")
    _scale_lengths(axes, "diameter D, m", diameters)
    axes.set_title("Covered share")
    text = f"k = {fit.k:.3f} [{fit.low:.3f}, {fit.high:.3f}]"
    axes.text(0.98, 0.97, text, transform=axes.transAxes, ha="right", va="top", color=SERIES[1], bbox=PLAIN)
    axes.grid(visible=True)


def draw_forms(axes: Any, rocks: pd.DataFrame) -> None:
    """Draw ratios of axes in the diagram of Zingg (1935), with its four classes of form."""
    axes.scatter(rocks["c_m"] / rocks["b_m"], rocks["b_m"] / rocks["a_m"], s=24, color=SERIES[0], linewidths=0)
    axes.axhline(2 / 3, color=FAINT, linewidth=0.8)
    axes.axvline(2 / 3, color=FAINT, linewidth=0.8)
    for x, y, name in ((0.03, 0.97, "disc"), (0.97, 0.97, "sphere"), (0.03, 0.03, "blade"), (0.97, 0.03, "rod")):
        sides = {"ha": "left" if x < 0.5 else "right", "va": "bottom" if y < 0.5 else "top"}
        axes.text(x, y, name, transform=axes.transAxes, color=FAINT, **sides)
    axes.set(xlim=(0, 1), ylim=(0, 1), xlabel="c / b", ylabel="b / a")
    axes.set_title("Form (Zingg)")


def _steps(axes: Any, diameters: np.ndarray, weights: np.ndarray, colour: str, width: float) -> None:
    """Draw the sum of weights (n,) of rocks of at least each diameter (n,) as a step function."""
    order = np.argsort(-diameters)
    axes.step(diameters[order], weights[order].cumsum(), where="pre", color=colour, linewidth=width)


def _scale_lengths(axes: Any, label: str, lengths: np.ndarray) -> None:
    """Make the x axis logarithmic, with few ticks around the given lengths (n,), metres."""
    low, high = lengths.min() / 1.3, lengths.max() * 1.3
    powers = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)))
    ticks = [step * 10.0**power for power in powers for step in STEPS if low <= step * 10.0**power <= high]
    axes.set(xscale="log", xlim=(low, high), xlabel=label)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)


def _draw_law(axes: Any, law: Any, fit: Abundance, smallest: float, largest: float) -> None:
    """Draw a function of diameter and k for the fit and its interval, from the minimum diameter of the fit."""
    if fit.k == 0:
        return
    d = np.geomspace(smallest, max(1.2 * largest, 1.2 * smallest), 100)
    axes.plot(d, law(d, fit.k), color=SERIES[1], linewidth=2, label="law of Golombek and Rapp")
    for k in (fit.low, fit.high):
        axes.plot(d, law(d, k), color=SERIES[1], linewidth=1, linestyle=":")
    axes.axvline(smallest, color=LINE, linewidth=1)
    axes.legend(loc="lower left")


def _draw_errors(axes: Any, rocks: pd.DataFrame) -> None:
    """Draw the relative errors of the axes over the true a axis."""
    for axis, colour in zip("abc", SERIES, strict=False):
        error = 100 * (rocks[f"{axis}_m"] / rocks[f"true_{axis}_m"] - 1)
        label = f"{axis}: median {error.abs().median():.1f} %"
        shown = error.clip(-ERROR_LIMIT, ERROR_LIMIT)
        axes.scatter(rocks["true_a_m"], shown, s=24, color=colour, linewidths=0, label=label)
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.set(ylim=(-ERROR_LIMIT - 2, ERROR_LIMIT + 2), ylabel="error, %")
    _scale_lengths(axes, "true a axis, m", rocks["true_a_m"].dropna().to_numpy(float))
    axes.set_title("Errors of the axes")
    axes.grid(visible=True)
    axes.legend(loc="best", frameon=True, framealpha=0.9, edgecolor="none")
