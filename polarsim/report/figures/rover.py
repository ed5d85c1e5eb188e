"""The rover's figures: a drive seen from behind, what its front camera sees, slip and sinkage, the soil's checks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from polarsim.formats.tone import to_8bit
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import ROCK
from polarsim.report.figures.canvas import FAINT, INK, SERIES, note, page, picture
from polarsim.report.rover_table import SOIL_COLUMNS
from polarsim.scoring.options import TablesOptions

POSES, SHOTS = ["frame", "time_s"], 6
WHEELS = {"lf": "left front", "rf": "right front", "lr": "left rear", "rr": "right rear"}
BOX = ["frame", "kind", "x0", "y0", "x1", "y1"]
ROCKS, SEEN = "#ffb000", "#56b4e9"  # true rocks, and what a judge takes for one
COLUMNS = ("time_s", "offset_m", *(f"{code}_{name}" for code in WHEELS for name in ("slip", "sinkage_m", "contact")))


def draw_sequence(*, view: Path, pictures: str, figure: Path, options: TablesOptions) -> None:
    """Write `SHOTS` moments of a view, evenly over the drive; `pictures` names the set, `<Sun>_<model>_<exposure>`."""
    _draw_shots(view, pictures, figure, options, truth=None, detections=None)


def draw_front(
    *,
    view: Path,
    pictures: str,
    truth: Path,
    detections: Path | None,
    confidence: float,
    figure: Path,
    options: TablesOptions,
) -> None:
    """The same with boxes: true rocks, and, where a judge looked, what it takes for rocks with this confidence."""
    found = None
    if detections:
        found = read_parquet(detections, [*BOX, "confidence"])
        found = found[found["confidence"] >= confidence]
    _draw_shots(view, pictures, figure, options, truth=read_parquet(truth, BOX), detections=found)


def draw_drive(*, traces: Sequence[Path], figure: Path, origin: dict[str, str], options: TablesOptions) -> None:
    """Write slip, sinkage and offset over time: of the first drive by wheel, of the others in the background."""
    width = options.figure_width_px
    tables = [read_parquet(trace, COLUMNS) for trace in traces]
    with page(figure, width, round(width * 0.7)) as sheet:
        axes = sheet.subplots(3, 1, sharex=True)
        others = f", {len(tables) - 1} more drives in grey" if len(tables) > 1 else ""
        sheet.suptitle(f"First drive by wheel{others}; source {origin['source']}", x=0.01, ha="left")
        for table in tables[1:]:
            axes[2].plot(table["time_s"], 1000 * table["offset_m"], color=FAINT, alpha=0.4, linewidth=0.8)
        first = tables[0]
        for (code, name), colour in zip(WHEELS.items(), SERIES, strict=False):
            soil = first[f"{code}_contact"] == "soil"
            for axis, column, scale in ((axes[0], "slip", 100), (axes[1], "sinkage_m", 1000)):
                shown = (scale * first[f"{code}_{column}"]).where(soil)  # on a rock neither is the ground's
                axis.plot(first["time_s"], shown, color=colour, linewidth=1, label=name)
        axes[2].plot(first["time_s"], 1000 * first["offset_m"], color=INK, linewidth=1.2)
        for axis, text in zip(axes, ("slip, %", "sinkage, mm", "offset, mm"), strict=True):
            axis.set_ylabel(text)
            axis.grid(visible=True)
        axes[2].set_xlabel("time, s")
        axes[0].legend(ncols=4, loc="upper right")


def draw_soil(*, limit: Path, measured: Path, figure: Path, options: TablesOptions) -> None:
    """Write the soil's checks: wheels against their limit, and soils against NASA's measured wheels."""
    wheels = read_parquet(limit, SOIL_COLUMNS)
    slopes = read_parquet(measured, ["rig", "soil", "slip", "slope_deg", "model_deg"])
    width = options.figure_width_px
    with page(figure, width, round(width * 0.62)) as sheet:
        axes = sheet.subplots(2, 3)
        for axis, (name, text) in zip(
            axes[0], (("sinkage", "sinkage, mm"), ("pull", "drawbar pull, N"), ("torque", "torque, N m")), strict=True
        ):
            _draw_limit(axis, wheels, name)
            axis.set(xlabel="slip", ylabel=text)
        axes[0, 0].legend(fontsize="small")
        for axis, (rig, rows) in zip(axes[1], slopes.groupby("rig", sort=True), strict=False):
            _draw_measured(axis, rows)
            axis.set_title(str(rig))
            axis.set(xlabel="slip, %", ylabel="slope, degrees")
        axes[1, 2].set_axis_off()
        lines = "lines: limit; circles: 5 mm cells; crosses: 2 cm"
        axes[1, 2].text(0, 0.9, f"Above, wheels against their limit:\n{lines}.", va="top", color=FAINT)


def _draw_limit(axis: Any, wheels: pd.DataFrame, name: str) -> None:
    unit = {"sinkage": "_mm", "pull": "_n", "torque": "_n_m"}[name]
    for (wheel, rows), colour in zip(wheels.groupby("wheel", sort=True), SERIES, strict=False):
        cells = sorted(rows["cell_m"].unique())
        fine = rows[rows["cell_m"] == cells[0]]
        axis.plot(fine["slip"], fine[f"{name}_limit{unit}"], color=colour, label=f"wheel {wheel}")
        for cell, mark in zip(cells, "ox", strict=False):
            shown = rows[rows["cell_m"] == cell]
            axis.plot(shown["slip"], shown[f"{name}{unit}"], mark, color=colour, markerfacecolor="none")
    axis.grid(visible=True)


def _draw_measured(axis: Any, rows: pd.DataFrame) -> None:
    points = rows.drop_duplicates(["slip", "slope_deg"])
    axis.plot(100 * points["slip"], points["slope_deg"], "o", color=INK, markerfacecolor="none", label="NASA")
    for (soil, shown), colour in zip(rows.groupby("soil", sort=True), SERIES, strict=False):
        shown = shown.sort_values("slip")
        axis.plot(100 * shown["slip"], shown["model_deg"], color=colour, label=str(soil))
    axis.grid(visible=True)
    axis.legend(fontsize="small")


def _draw_shots(
    view: Path,
    pictures: str,
    figure: Path,
    options: TablesOptions,
    truth: pd.DataFrame | None,
    detections: pd.DataFrame | None,
) -> None:
    poses = read_parquet(view / "poses.parquet", POSES)
    chosen = poses.iloc[np.unique(np.linspace(0, len(poses) - 1, SHOTS).round().astype(int))] if len(poses) else poses
    width = options.figure_width_px
    with page(figure, width, round(width * 0.5)) as sheet:
        if not len(chosen):
            note(sheet, "no picture was taken")
            return
        sun, model, exposure = pictures.split("_")
        title = f"{view.name}, Sun {sun}, {model}, {int(exposure)} ms"
        panels = np.ravel(sheet.subplots(2, SHOTS // 2))
        for axes in panels:
            axes.set_axis_off()
        for axes, (frame, time_s) in zip(panels, chosen[POSES].itertuples(index=False), strict=False):
            pixels = png.read(view / pictures / f"{int(frame):05d}.png")
            picture(axes, to_8bit(pixels), f"{time_s:.1f} s")
            for boxes, colour in ((truth, ROCKS), (detections, SEEN)):
                if boxes is not None:
                    _draw_boxes(axes, boxes[(boxes["frame"] == frame) & (boxes["kind"] == ROCK)], colour)
        if truth is not None:
            title += "; yellow: rocks" + ("" if detections is None else ", blue: what the judge takes for rocks")
        sheet.suptitle(title, x=0.01, ha="left")


def _draw_boxes(axes: Any, boxes: pd.DataFrame, colour: str) -> None:
    from matplotlib.patches import Rectangle

    for row in boxes.to_dict("records"):
        corner = (row["x0"] - HALF_PIXEL, row["y0"] - HALF_PIXEL)  # imshow puts the first pixel's centre at 0
        size = (row["x1"] - row["x0"], row["y1"] - row["y0"])
        axes.add_patch(Rectangle(corner, *size, fill=False, edgecolor=colour, linewidth=1))
