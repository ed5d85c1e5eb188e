"""Figure of slip, sinkage and lateral offset of drives over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from polarsim.formats.tables import read_parquet
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, figure_title, page

WHEELS = {"lf": "left front", "rf": "right front", "lr": "left rear", "rr": "right rear"}
COLUMNS = ("time_s", "offset_m", *(f"{code}_{name}" for code in WHEELS for name in ("slip", "sinkage_m", "contact")))


def draw_drive(*, traces: Sequence[Path], figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Draw slip and sinkage per wheel and the offset of the first drive over time; other drives are grey."""
    tables = [read_parquet(trace, COLUMNS) for trace in traces]
    with page(figure, width, round(width * 0.7)) as sheet:
        axes = sheet.subplots(3, 1, sharex=True)
        others = f", {len(tables) - 1} more drives in grey" if len(tables) > 1 else ""
        figure_title(
            sheet, f"Slip, sinkage and offset from the path, first drive by wheel{others}; source {origin['source']}"
        )
        for table in tables[1:]:
            axes[2].plot(table["time_s"], 1000 * table["offset_m"], color=FAINT, alpha=0.4, linewidth=0.8)
        first = tables[0]
        for (code, name), colour in zip(WHEELS.items(), SERIES, strict=False):
            soil = first[f"{code}_contact"] == "soil"
            for axis, column, scale in ((axes[0], "slip", 100), (axes[1], "sinkage_m", 1000)):
                shown = (scale * first[f"{code}_{column}"]).where(soil)  # not defined on rocks
                axis.plot(first["time_s"], shown, color=colour, linewidth=1, label=name)
        axes[2].plot(first["time_s"], 1000 * first["offset_m"], color=INK, linewidth=1.2)
        for axis, text in zip(axes, ("slip, %", "sinkage, mm", "lateral offset, mm"), strict=True):
            axis.set_ylabel(text)
            axis.grid(visible=True)
        axes[2].set_xlabel("time, s")
        axes[0].legend(ncols=4, loc="upper right")
