"""Figure of the paths of autonomous drives over the terrain, true and estimated, and of the error along them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.npz import read_arrays
from polarsim.formats.tables import read_parquet
from polarsim.report.figures.autonomy import SUN_MARKERS
from polarsim.report.figures.autonomy_maps import estimated_path, light_of, mode_and_pose
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, LINE, SERIES, figure_title, legend_line, page
from polarsim.run_files.picture_sets import sun_title
from polarsim.schemas.rover import ANY, HIGH_M, MODES, ODOMETRY

_MAP_SHARE, _ERRORS_SHARE = 0.45, 0.25  # heights of the panels over the width of the figure
_TRUE = {"linewidth": 4.0, "alpha": 0.4, "solid_capstyle": "butt"}
_ESTIMATED = {"linewidth": 1.4, "linestyle": "--"}
_LIT = {"marker": "o", "markerfacecolor": "white"}
_MIN_ERROR_MM = 1.0  # of the logarithmic axis
_MARKS = 0.12  # distance of the marks of a path, share of the diagonal of the map


def draw_paths(*, folders: Sequence[Path], figure: Path, origin: dict[str, str]) -> None:
    """Draw the paths of the first seed's drives over the terrain, and errors of estimated positions along them."""
    seed = folders[0].name.rpartition("_")[2]
    drives = [folder for folder in folders if folder.name.endswith(f"_{seed}")]
    modes = [mode for mode in MODES if any(mode_and_pose(folder)[0] == mode for folder in drives)]
    colours = dict(zip(modes, SERIES, strict=False))
    paths = {folder: read_paths(folder) for folder in drives}
    estimated = {folder: path for folder, path in paths.items() if "error_mm" in path}
    shares = [_MAP_SHARE, _ERRORS_SHARE] if estimated else [_MAP_SHARE]
    with page(figure, FIGURE_WIDTH, round(FIGURE_WIDTH * sum(shares))) as sheet:
        title = (
            f"Paths of autonomous drives by mode, {seed.replace('seed', 'seed ')}; circles: rocks, filled above 10 cm"
        )
        figure_title(sheet, f"{title}; source {origin['source']}")
        axis, *others = sheet.subplots(len(shares), height_ratios=shares, squeeze=False)[:, 0]
        _draw_rocks(axis, drives[0] / "world")
        for folder, path in paths.items():
            colour = colours[mode_and_pose(folder)[0]]
            axis.plot(path["x_m"], path["y_m"], color=colour, markevery=_MARKS, **_mark_of(folder), **_TRUE)
            if folder in estimated:
                axis.plot(path["estimated_x_m"], path["estimated_y_m"], color=colour, **_ESTIMATED)
        keys = [legend_line(color=colours[mode], linewidth=3, label=mode) for mode in modes]
        if estimated:
            keys += [
                legend_line(color=INK, **_TRUE, label="true path"),
                legend_line(color=INK, **_ESTIMATED, label="path as estimated by the rover"),
            ]
            keys += _draw_errors(others[0], estimated, colours)
        if any(map(_is_lit, drives)):
            keys.append(legend_line(color=FAINT, linestyle="", **_LIT, label="lights on"))
        sheet.legend(handles=keys, loc="outside lower center", ncols=min(len(keys), 7), columnspacing=1.4)
        axis.set_aspect("equal")
        axis.set_xlabel("east, m")
        axis.set_ylabel("north, m")


def read_paths(folder: Path) -> pd.DataFrame:
    """Return the true path x_m, y_m of a drive and the distance along it, along_m.

    If the pose is estimated also `estimated_x_m`, `estimated_y_m` and `error_mm`, the distance of the positions.
    """
    names = ["x_m", "y_m", "z_m"]
    true = read_parquet(folder / "trace.parquet", names)
    steps = np.linalg.norm(np.diff(true[names].to_numpy(), axis=0), axis=1)
    path = true[["x_m", "y_m"]].assign(along_m=np.concatenate([[0.0], steps.cumsum()]))
    if (estimate := estimated_path(folder)) is None:
        return path
    error = 1e3 * np.linalg.norm(estimate[names].to_numpy() - true[names].to_numpy(), axis=1)
    return path.assign(estimated_x_m=estimate["x_m"], estimated_y_m=estimate["y_m"], error_mm=error)


def _draw_errors(axis: Any, paths: Mapping[Path, pd.DataFrame], colours: Mapping[str, str]) -> list[Any]:
    """Draw the largest error of the position in each metre of a drive; return legend entries of Suns and of odometry.

    Between two pictures, wheels and IMU alone change the estimate: single errors are a dense zigzag.
    """
    suns, with_odometry = set(), False
    for folder, path in paths.items():
        (mode, pose), sun = mode_and_pose(folder), _sun_of(folder)
        suns.add(sun)
        with_odometry |= pose == ODOMETRY
        largest = path.groupby(np.floor(path["along_m"]))["error_mm"].max().clip(lower=_MIN_ERROR_MM)
        axis.plot(
            largest.index + 0.5, largest, color=colours[mode], linewidth=1.4,
            linestyle=":" if pose == ODOMETRY else "-", markersize=6, **_mark_of(folder),
        )  # fmt: skip
    axis.set_yscale("log")
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=_MIN_ERROR_MM)
    axis.yaxis.set_major_formatter("{x:g}")
    axis.grid(axis="y", color=LINE)
    axis.set_xlabel("distance driven, m")
    axis.set_ylabel("largest position error\nin each metre, mm")
    marks = {"color": FAINT, "linestyle": ""}
    keys = [legend_line(marker=SUN_MARKERS[sun], label=sun_title(sun), **marks) for sun in sorted(suns - {ANY})]
    return keys + ([legend_line(color=FAINT, linestyle=":", label="odometry")] if with_odometry else [])


def _sun_of(folder: Path) -> str:
    """Return the Sun of a drive, or `any` if the drive does not depend on it."""
    return [*light_of(folder), ANY][0]


def _mark_of(folder: Path) -> dict[str, str]:
    """Return the mark of a drive's Sun, with a white centre if the lights are on."""
    return (_LIT if _is_lit(folder) else {}) | {"marker": SUN_MARKERS[_sun_of(folder)]}


def _is_lit(folder: Path) -> bool:
    return light_of(folder)[2:3] == ["on"]


def _draw_rocks(axis: Any, world: Path) -> None:
    from matplotlib.patches import Circle

    ground = read_arrays(world / "ground.npz", ("x0_m", "y0_m", "cell_m", "level_m"))
    rows, columns = ground["level_m"].shape
    x0, y0, cell = (float(ground[name]) for name in ("x0_m", "y0_m", "cell_m"))
    east, north = x0 + cell * (columns - 1), y0 + cell * (rows - 1)
    half = cell / 2  # grid nodes are at pixel centres
    extent = (x0 - half, east + half, y0 - half, north + half)
    axis.imshow(ground["level_m"], extent=extent, origin="lower", cmap="gray", alpha=0.4)
    axis.set_xlim(x0, east)
    axis.set_ylim(y0, north)  # crop rocks outside the ground
    for rock in read_parquet(world / "rocks.parquet", ("x_m", "y_m", "width_m", "height_m")).to_dict("records"):
        high = rock["height_m"] > HIGH_M
        axis.add_patch(Circle((rock["x_m"], rock["y_m"]), rock["width_m"] / 2, fill=high, color=INK if high else FAINT))
