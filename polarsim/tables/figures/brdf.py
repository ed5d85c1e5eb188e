"""Reflectance over phase angle: a fixed lamp seen from every side, and lamp and viewer moved apart together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.render.goniometer import phase_deg, reflectance_at
from polarsim.render.options import Parameters
from polarsim.tables.figures.canvas import SERIES, page

STEP_DEG = 0.25
WIDEST_DEG = 89.0


def draw_brdf(figure: Path, models: Mapping[str, Parameters], incidence_deg: float, width_px: int = 1600) -> None:
    """Write pi f_r of named parameters over the phase angle: in the plane of incidence, and at i = e = g / 2."""
    emergence = np.arange(-WIDEST_DEG, WIDEST_DEG + STEP_DEG / 2, STEP_DEG)
    seen = (np.full_like(emergence, incidence_deg), np.abs(emergence), np.where(emergence < 0, 180.0, 0.0))
    half = np.arange(0, WIDEST_DEG + STEP_DEG / 4, STEP_DEG / 2)
    mirrored = (half, half, np.full_like(half, 180.0))
    with page(figure, width_px, round(width_px * 0.5)) as sheet:
        left, right = sheet.subplots(1, 2)
        for colour, (name, parameters) in zip(SERIES * len(models), models.items(), strict=False):
            sign = np.where(emergence > incidence_deg, -1, 1)  # beyond the lamp: phase angles below 0
            left.plot(sign * phase_deg(*seen), np.pi * reflectance_at(parameters, *seen), color=colour)
            right.plot(phase_deg(*mirrored), np.pi * reflectance_at(parameters, *mirrored), color=colour, label=name)
        for axes, title in (
            (left, f"incidence {incidence_deg:g}°, viewer in its plane"),
            (right, "viewer opposite the lamp, i = e = g / 2"),
        ):
            axes.set_title(title)
            axes.set_xlabel("phase angle, degrees")
            axes.set_yscale("log")
            axes.grid(visible=True)
        left.set_ylabel("reflectance factor, pi f_r")
        sheet.legend(loc="outside lower center", ncols=min(4, len(models)))
