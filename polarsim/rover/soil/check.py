"""The soil against its limit: wheels driven over fine and coarse cells beside the integrals that they must meet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd

from polarsim.formats import tables
from polarsim.formats.schemas import SOIL_LIMIT, SOIL_MEASURED
from polarsim.rover.soil import contact_numba, measured
from polarsim.rover.soil.contact import Rule
from polarsim.rover.soil.law import read_soils
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.rig import Rig, drive
from polarsim.rover.soil.shapes import Wheel

# VIPER's wheel with a quarter of the rover on the Moon, and a small laboratory wheel: load, N.
WHEELS = {"A": (Wheel(0.25, 0.20), "lunar", 174.15), "B": (Wheel(0.15735, 0.165), "hit-simulant", 80.0)}
SLIPS = (0.0, 0.2, 0.4, 0.6, 0.8)
GRIDS = ((0.005, 4e9), (0.02, 2e8))  # cell, m, and elastic stiffness, Pa/m
CURVES = {"trec-grc3": measured.TREC, "mgru3-tilt-bed": measured.TILT_BED}


def check_soil(*, soils: Path, limit: Path, measured_slopes: Path) -> None:
    """Write both tables: wheels against the limit, and soils against what NASA measured.

    Raises
    ------
    PolarsimError
        The table of soils is broken, or lacks a soil of the check.
    """
    tables.write_parquet(limit, against_limit(soils))
    tables.write_parquet(measured_slopes, against_measured(soils))


def against_limit(soils: Path) -> pd.DataFrame:
    """A row a wheel, grid and slip, `SOIL_LIMIT`; normals of the contact, no slip sinkage, no damping."""
    known, rows = read_soils(soils), []
    for cell, K_e in GRIDS:
        for name, (wheel, soil, load) in WHEELS.items():
            law = replace(known[soil], K_e=K_e, R=0.0).law(slip_sinkage=False)
            for slip in SLIPS:
                found = drive(wheel, law, load, slip, cell, Rig(), Rule(False), contact_numba.press)
                wanted = steady_wheel(wheel, law, load, slip, False)
                pairs = (1000 * found.sinkage, 1000 * wanted.sinkage, found.pull, wanted.pull)
                rows.append((name, soil, cell, slip, *pairs, found.torque, wanted.torque))
    return pd.DataFrame(rows, columns=list(SOIL_LIMIT.columns))


def against_measured(soils: Path) -> pd.DataFrame:
    """A row a measured point and soil, `SOIL_MEASURED`: the slope that a wheel climbs, or pulls as if, at a slip."""
    known, rows = read_soils(soils), []
    for own, curve in CURVES.items():
        for soil in (own, "lunar"):
            misses = measured.misses_deg(curve, known[soil].law(slip_sinkage=False))
            for (slip, slope), miss in zip(curve.points, misses, strict=True):
                rows.append((curve.name, soil, slip / 100, slope, slope + float(miss)))
    return pd.DataFrame(rows, columns=list(SOIL_MEASURED.columns))
