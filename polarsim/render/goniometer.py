"""Reflectance as a function of incidence, emergence and relative azimuth, degrees.

At azimuth 0, lamp and viewer are on the same side of the normal; at 180 on opposite sides, as for a mirror.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import RenderError
from polarsim.formats.tables import write_csv
from polarsim.render.brdf import reflectance
from polarsim.render.hits import between_deg
from polarsim.render.options import MODELS, Model, RenderOptions
from polarsim.render.parameters import HAPKE_SETS, HapkeChronoParameters, Parameters

STEP_DEG = 0.25  # angular step of the curves
WIDEST_DEG = 89.0
SHOWN_INCIDENCE_DEG = 30.0  # incidence of the figure in the report

Curve = tuple[np.ndarray, np.ndarray]  # phase angles, degrees, and reflectance factors pi f_r


def parameters_of(model: Model, soil: str | None = None) -> Parameters:
    """Return the default parameters of a model, or a parameter set of `HAPKE_SETS` for Hapke's models."""
    if soil is None:
        return RenderOptions().parameters(model)
    if model not in ("hapke", "hapke_chrono"):
        raise RenderError(f"set {soil!r}: {model} has no parameter sets, expected hapke or hapke_chrono")
    if soil not in HAPKE_SETS:
        raise RenderError(f"unknown set {soil!r}, expected {', '.join(HAPKE_SETS)}")
    return HAPKE_SETS[soil] if model == "hapke" else HapkeChronoParameters(soil=soil)


def reflectance_at(
    parameters: Parameters, incidence_deg: np.ndarray, emergence_deg: np.ndarray, azimuth_deg: np.ndarray
) -> np.ndarray:
    """Return f_r (n,), 1/sr, at angles (n,); 0 from 90 degrees on."""
    normal, to_lamp, to_viewer = goniometer_directions(incidence_deg, emergence_deg, azimuth_deg)
    return reflectance(parameters, normal, to_lamp, to_viewer)


def goniometer_directions(
    incidence_deg: np.ndarray, emergence_deg: np.ndarray, azimuth_deg: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit vectors (n, 3) along the normal, to the lamp and to the viewer for angles (n,)."""
    i, e, psi = (
        np.radians(a) for a in np.broadcast_arrays(*map(np.atleast_1d, (incidence_deg, emergence_deg, azimuth_deg)))
    )
    zero = np.zeros_like(i)
    to_lamp = np.stack([np.sin(i), zero, np.cos(i)], axis=1)
    to_viewer = np.stack([np.sin(e) * np.cos(psi), np.sin(e) * np.sin(psi), np.cos(e)], axis=1)
    return np.tile([0.0, 0.0, 1.0], (len(i), 1)), to_lamp, to_viewer


def phase_deg(incidence_deg: np.ndarray, emergence_deg: np.ndarray, azimuth_deg: np.ndarray) -> np.ndarray:
    """Return the angle (n,) between the directions to lamp and viewer, degrees."""
    _, to_lamp, to_viewer = goniometer_directions(incidence_deg, emergence_deg, azimuth_deg)
    return between_deg(to_lamp, to_viewer)


def in_plane_of_incidence(parameters: Parameters, incidence_deg: float) -> Curve:
    """Return the curve for viewers in the plane of incidence.

    Phase angles are negative if the viewer is on the side of the lamp and lower than the lamp.
    """
    emergence = np.arange(-WIDEST_DEG, WIDEST_DEG + STEP_DEG / 2, STEP_DEG)
    angles = (np.full_like(emergence, incidence_deg), np.abs(emergence), np.where(emergence < 0, 180.0, 0.0))
    sign = np.where(emergence > incidence_deg, -1, 1)
    return sign * phase_deg(*angles), np.pi * reflectance_at(parameters, *angles)


def opposite_the_lamp(parameters: Parameters) -> Curve:
    """Return the curve for i = e = g / 2, as for a mirror."""
    half = np.arange(0, WIDEST_DEG + STEP_DEG / 4, STEP_DEG / 2)
    angles = (half, half, np.full_like(half, 180.0))
    return phase_deg(*angles), np.pi * reflectance_at(parameters, *angles)


def reflectance_panels(chosen: Mapping[str, Parameters], incidence_deg: float) -> dict[str, dict[str, Curve]]:
    """Return curves of named parameters by panel title: for a fixed lamp, and for a viewer opposite a moving lamp."""
    return {
        f"incidence {incidence_deg:g}°, viewer in its plane": {
            name: in_plane_of_incidence(parameters, incidence_deg) for name, parameters in chosen.items()
        },
        "viewer opposite the lamp, i = e = g / 2": {
            name: opposite_the_lamp(parameters) for name, parameters in chosen.items()
        },
    }


def write_reflectance(*, curves: Path, options: RenderOptions) -> None:
    """Write the curves of all models for the options as CSV with columns panel, model, phase_deg, pi_f_r."""
    panels = reflectance_panels({model: options.parameters(model) for model in MODELS}, SHOWN_INCIDENCE_DEG)
    rows = [
        pd.DataFrame({"panel": title, "model": model, "phase_deg": phase, "pi_f_r": factor})
        for title, of_models in panels.items()
        for model, (phase, factor) in of_models.items()
    ]
    write_csv(curves, pd.concat(rows, ignore_index=True))
