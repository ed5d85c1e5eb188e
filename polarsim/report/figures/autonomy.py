"""Ways of a rover that finds its own, over the rocks that lay there, and its modes side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.formats.npz import read_arrays
from polarsim.formats.schemas import AUTONOMY
from polarsim.formats.tables import read_parquet
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, INK, SERIES, heading, page

MODES = ("truth", "detector", "stereo", "both", "blind")
HIGH_M = 0.10
SHOWN = {
    "collisions": "collisions a drive",
    "success": "share of drives that succeed",
    "energy over the blind one's": "energy over the blind one's",
}


def draw_autonomy(
    *, folders: Sequence[Path], together: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH
) -> None:
    """Above: ways of all drives, rocks above 10 cm filled. Below: means of each mode over lights, with intervals."""
    table = read_parquet(together, AUTONOMY.columns)
    modes = [mode for mode in MODES if (table["mode"] == mode).any()]
    colours = dict(zip(modes, SERIES, strict=False))
    with page(figure, width, round(width * 0.62)) as sheet:
        heading(sheet, f"The rover finds its way; source {origin['source']}")
        parts = sheet.subfigures(2, 1, height_ratios=[1.1, 1])
        above = parts[0].subplots()
        _draw_rocks(above, folders[0] / "world")
        for folder in folders:
            mode = folder.name.split("_")[0]
            way = read_parquet(folder / "trace.parquet", ("x_m", "y_m"))
            above.plot(way["x_m"], way["y_m"], color=colours[mode], linewidth=1, alpha=0.8)
        for mode in modes:
            above.plot([], [], color=colours[mode], label=mode)
        above.set_aspect("equal")
        above.set_xlabel("east, m")
        above.set_ylabel("north, m")
        above.legend(ncols=len(modes), loc="lower right")
        for axis, (metric, text) in zip(parts[1].subplots(1, len(SHOWN)), SHOWN.items(), strict=True):
            own = table[(table["metric"] == metric) & table["sun"].isin(["all", "any"])].set_index("mode")
            for place, mode in enumerate(modes):
                if mode not in own.index:
                    continue
                value, low, high = own.loc[mode, ["value", "low", "high"]].to_numpy(float)
                axis.bar(place, value, color=colours[mode], width=0.7)
                if np.isfinite(low):
                    axis.plot([place, place], [low, high], color=INK, linewidth=1.2)
            axis.set_xticks(range(len(modes)), modes)
            axis.set_xlim(-0.6, len(modes) - 0.4)
            axis.set_ylim(0, max(1.0, axis.get_ylim()[1]))  # without a collision there is no bar, and no scale
            axis.set_title(text)


def _draw_rocks(axis, world: Path) -> None:  # type: ignore[no-untyped-def]
    from matplotlib.patches import Circle

    ground = read_arrays(world / "ground.npz", ("x0_m", "y0_m", "cell_m", "level_m"))
    rows, columns = ground["level_m"].shape
    x0, y0, cell = (float(ground[name]) for name in ("x0_m", "y0_m", "cell_m"))
    axis.imshow(
        ground["level_m"],
        extent=(x0, x0 + cell * columns, y0, y0 + cell * rows),
        origin="lower",
        cmap="gray",
        alpha=0.4,
    )
    axis.set_xlim(x0, x0 + cell * columns)
    axis.set_ylim(y0, y0 + cell * rows)  # rocks may lie beyond
    for rock in read_parquet(world / "rocks.parquet", ("x_m", "y_m", "width_m", "height_m")).to_dict("records"):
        high = rock["height_m"] > HIGH_M
        axis.add_patch(Circle((rock["x_m"], rock["y_m"]), rock["width_m"] / 2, fill=high, color=INK if high else FAINT))
