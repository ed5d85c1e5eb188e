"""Number of rocks per area, the share of the ground that they cover, and the fitted law, by terrain."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from polarsim.formats.tables import typed
from polarsim.geometry.size_frequency import fit_abundance, poisson_interval
from polarsim.photo import Terrain, terrain_text
from polarsim.schemas import report

COMPLETE = 0.08  # metres: minimum diameter of rocks of which nearly all are detected, for numbers per area


def abundance_table(diameters: Mapping[Terrain, np.ndarray], areas: Mapping[Terrain, float]) -> pd.DataFrame:
    """Return a row per terrain, and a row of all terrains if there are several."""
    parts = {terrain_text(terrain): (diameters[terrain], area) for terrain, area in areas.items()}
    if len(parts) > 1:
        parts["all"] = (np.concatenate(list(diameters.values())), sum(areas.values()))
    rows = [{"terrain": name, **abundance_of(*part, COMPLETE)} for name, part in parts.items()]
    return typed(rows, report.ROCK_ABUNDANCE)


def abundance_of(diameters: np.ndarray, area: float, smallest: float) -> dict[str, float]:
    """Return number, number per m^2, covered share and k of rocks of at least `smallest` metres on `area` m^2."""
    counted = diameters[diameters >= smallest]
    low, high = poisson_interval(len(counted))
    fit = fit_abundance(counted, area, smallest)
    return {
        "rocks": len(counted), "area_m2": area,
        "per_m2": len(counted) / area, "per_m2_low": float(low) / area, "per_m2_high": float(high) / area,
        "covered": float(np.pi / 4 * (counted**2).sum() / area),
        "k": fit.k, "k_low": fit.low, "k_high": fit.high,
    }  # fmt: skip
