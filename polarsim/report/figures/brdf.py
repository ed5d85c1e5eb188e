"""Figure of the reflectance factor over the phase angle: fixed lamp with moving viewer, and both moving."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.formats.tables import read_csv
from polarsim.report.figures.canvas import FIGURE_WIDTH, SERIES, page

_DASHES = ("-", "--", ":", "-.")
Curves = Mapping[str, tuple[np.ndarray, np.ndarray]]  # by name: phase angles in degrees, reflectance factors


def draw_reflectance(*, curves: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the figure of a run's models from its `renders/reflectance.csv`."""
    table = read_csv(curves, ["panel", "model", "phase_deg", "pi_f_r"])
    panels = {
        str(title): {
            str(model): (part["phase_deg"].to_numpy(float), part["pi_f_r"].to_numpy(float))
            for model, part in of_panel.groupby("model", sort=False)
        }
        for title, of_panel in table.groupby("panel", sort=False)
    }
    draw_brdf(figure, panels, width)


def line_style(number: int) -> dict[str, str]:
    """Return the colour and dashes of a curve; colours repeat with different dashes."""
    cycle, colour = divmod(number, len(SERIES))
    return {"color": SERIES[colour], "linestyle": _DASHES[cycle % len(_DASHES)]}


def draw_brdf(figure: Path, panels: Mapping[str, Curves], width_px: int = 1600) -> None:
    """Write a figure with a panel per title; a model has the same line style in all panels."""
    names = list(dict.fromkeys(name for curves in panels.values() for name in curves))
    styles = {name: line_style(number) for number, name in enumerate(names)}
    with page(figure, width_px, round(width_px * 0.5)) as sheet:
        all_axes = np.atleast_1d(sheet.subplots(1, len(panels)))
        for axes, (title, curves) in zip(all_axes, panels.items(), strict=True):
            for name, (phase_deg, factor) in curves.items():
                axes.plot(phase_deg, factor, **styles[name], label=name if axes is all_axes[0] else None)
            axes.set_title(title)
            axes.set_xlabel("phase angle, degrees")
            axes.set_yscale("log")
            axes.grid(visible=True)
        all_axes[0].set_ylabel("reflectance factor $\\pi f_r$")
        sheet.legend(loc="outside lower center", ncols=min(4, len(names)))
