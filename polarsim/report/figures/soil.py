"""The soil's checks: wheels against their limit, soils against measured wheels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, page
from polarsim.schemas.soil import SOIL_LIMIT, SOIL_MEASURED


def draw_soil(*, limit: Path, measured: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the soil's checks: wheels against their limit, and soils against NASA's measured wheels."""
    wheels = read_parquet(limit, SOIL_LIMIT.columns)
    slopes = read_parquet(measured, SOIL_MEASURED.columns)
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
