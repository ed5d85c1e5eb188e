"""Figure of one autonomous drive per mode: hazard map, path, collisions and stops, and front camera images."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.files import read_json
from polarsim.formats.npz import read_arrays
from polarsim.formats.tables import read_parquet
from polarsim.report.autonomy_table import with_pose
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, figure_title, legend_line, page, show_image
from polarsim.run_files.localisation import ESTIMATE, LOCALISATION
from polarsim.run_files.picture_sets import exposure_title, sun_title
from polarsim.schemas.rover import AUTONOMY_EVENTS, COLLISION, HIGH_M, KNOWN, MODES, POSES, STOP, TOUCH

PICTURES = 2  # per drive
_ROW_PX = 375
_BEFORE_S = 4.0  # time between an image and the event; the rock of a collision is visible then
_UNSEEN, _FREE, _LOW, _HIGH = "#c9ccd1", "#ffffff", "#f6c48a", "#d55e00"
_PATH = {"color": INK, "linewidth": 3.2}
_ESTIMATED = {"color": "#56b4e9", "linewidth": 1.4, "linestyle": (0, (4, 2))}  # within the path where both agree
_MARKS = {
    COLLISION: {"marker": "X", "color": "#b00020", "markersize": 11, "label": "rock above 10 cm hit"},
    TOUCH: {"marker": "x", "color": "#b00020", "markersize": 7, "label": "lower rock touched"},
    STOP: {"marker": "s", "color": "#0072b2", "markersize": 7, "label": "stop: no path"},
}


def draw_autonomy_maps(*, folders: Sequence[Path], figure: Path, origin: dict[str, str]) -> None:
    """Draw a row per mode and source of the pose: map at the end of the first drive, and images of the front camera."""
    first = {mode_and_pose(folder): folder for folder in reversed(folders)}
    chosen = [first[kind] for kind in product(MODES, POSES) if kind in first]
    with page(figure, FIGURE_WIDTH, _ROW_PX * len(chosen) + 110) as sheet:
        figure_title(
            sheet, f"Hazard maps, paths and front camera images of autonomous drives; source {origin['source']}"
        )
        grid = sheet.add_gridspec(len(chosen), 1 + PICTURES, width_ratios=[1.35] + [1.0] * PICTURES)
        for row, folder in enumerate(chosen):
            path = read_parquet(folder / "trace.parquet", ("time_s", "x_m", "y_m"))
            events = read_parquet(folder / "events.parquet", AUTONOMY_EVENTS.columns)
            shown = shown_pictures(picture_times(folder / "pictures"), events)
            axis = sheet.add_subplot(grid[row, 0])
            _draw_map(axis, folder)
            _draw_path(axis, path, events, list(shown))
            if (estimate := estimated_path(folder)) is not None:
                axis.plot(estimate["x_m"], estimate["y_m"], **_ESTIMATED)
            axis.set_title(_title(folder))
            if folder == chosen[-1]:
                axis.set_xlabel("east, m")
            if not shown:
                _write_text(sheet.add_subplot(grid[row, 1]), "no camera in this mode")
            for number, (time_s, image) in enumerate(shown.items()):
                show_image(
                    sheet.add_subplot(grid[row, 1 + number]), _pixels(image), f"{number + 1}: after {time_s:.0f} s"
                )
        keys = [legend_line(linestyle="", **style) for style in _MARKS.values()]
        keys += [
            legend_line(linestyle="", marker="s", markersize=10, markeredgecolor=FAINT, color=colour, label=label)
            for colour, label in ((_HIGH, "mapped as hazard"), (_LOW, "mapped as low rock"), (_UNSEEN, "not observed"))
        ]
        keys += [legend_line(**_PATH, label="path; circles: true rocks")]
        if any(pose != KNOWN for _, pose in map(mode_and_pose, chosen)):
            keys += [legend_line(**_ESTIMATED, label="path as estimated by the rover")]
        sheet.legend(handles=keys, loc="outside lower center", ncols=4)


def mode_and_pose(folder: Path) -> tuple[str, str]:
    """Return mode and source of the pose of a drive."""
    mode, pose = [*folder.name.split("_"), ""][:2]
    return mode, pose if pose in POSES else KNOWN


def light_of(folder: Path) -> list[str]:
    """Return Sun, exposure and the other conditions of a drive's images; empty without images."""
    return folder.name.rpartition("_seed")[0].split("_")[1 if mode_and_pose(folder)[1] == KNOWN else 2 :]


def estimated_path(folder: Path) -> pd.DataFrame | None:
    """Return the estimated path at the times of the trace, x_m, y_m, z_m; None if the pose was known."""
    path = folder / LOCALISATION / ESTIMATE
    return read_parquet(path, ("x_m", "y_m", "z_m")) if path.is_file() else None


def picture_times(folder: Path) -> dict[float, Path]:
    """Return the images `<milliseconds>.jpg` of a folder by time in seconds."""
    return {int(path.stem) / 1000: path for path in sorted(folder.glob("*.jpg"))}


def shown_pictures(pictures: dict[float, Path], events: pd.DataFrame) -> dict[float, Path]:
    """Select `PICTURES` images by time: before collisions, then before stops and touches, then evenly spaced."""
    times = np.array(sorted(pictures))
    if not len(times):
        return {}
    order = events["what"].map({COLLISION: 0, TOUCH: 2, STOP: 1})
    wanted = (events.loc[order.sort_values(kind="stable").index, "time_s"] - _BEFORE_S).tolist()
    wanted += np.linspace(times[0], times[-1], PICTURES + 2)[1:-1].tolist()
    chosen: list[float] = []
    for time_s in wanted:
        before = times[times <= max(time_s, times[0])]
        if before[-1] not in chosen and len(chosen) < PICTURES:
            chosen.append(before[-1])
    return {time_s: pictures[time_s] for time_s in sorted(chosen)}


def _title(folder: Path) -> str:
    mode, pose = mode_and_pose(folder)
    light, mode = light_of(folder), with_pose(mode, pose)
    drive = read_json(folder / "drive.json")
    conditions = [sun_title(light[0]), exposure_title(light[1])] if light else []
    return (
        f"{', '.join([mode, *conditions])}:\n{drive['ended']} after {drive['seconds']:.0f} s"  # a line overlaps images
    )


def _draw_map(axis: Any, folder: Path) -> None:
    """Draw the rover's hazard map at the end of the drive and the outlines of the true rocks."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Circle

    cells = read_arrays(folder / "map.npz", ("x_m", "y_m", "log_odds", "seen", "hazard"))
    kind = np.select([cells["hazard"], cells["log_odds"] > 0, cells["seen"]], [3, 2, 1], 0)
    colours = ListedColormap([_UNSEEN, _FREE, _LOW, _HIGH])
    axis.pcolormesh(cells["x_m"], cells["y_m"], kind, cmap=colours, vmin=-0.5, vmax=3.5)
    for rock in read_parquet(folder / "world/rocks.parquet", ("x_m", "y_m", "width_m", "height_m")).to_dict("records"):
        high = rock["height_m"] > HIGH_M
        outline = {"fill": False, "color": INK if high else FAINT, "linewidth": 1.3 if high else 0.7}
        axis.add_patch(Circle((rock["x_m"], rock["y_m"]), rock["width_m"] / 2, **outline))
    axis.set_aspect("equal")
    axis.set_ylabel("north, m")


def _draw_path(axis: Any, path: pd.DataFrame, events: pd.DataFrame, shown: list[float]) -> None:
    axis.plot(path["x_m"], path["y_m"], **_PATH)
    for kind, style in _MARKS.items():
        marked = events[events["what"] == kind]
        axis.plot(marked["x_m"], marked["y_m"], linestyle="", zorder=3, **style)
    for number, time_s in enumerate(shown):
        at = [float(np.interp(time_s, path["time_s"], path[name])) for name in ("x_m", "y_m")]
        axis.annotate(
            str(number + 1), at, ha="center", va="center", fontsize="small", color="white", zorder=4,
            bbox={"boxstyle": "circle,pad=0.2", "color": INK},
        )  # fmt: skip


def _write_text(axis: Any, text: str) -> None:
    axis.set_axis_off()
    axis.text(0.0, 0.5, text, color=FAINT, va="center")


def _pixels(path: Path) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB"))
