"""Soils by name: Bekker-Wong, Mohr-Coulomb and Janosi-Hanamoto constants under Chrono's names, with their source."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import NamedTuple

from polarsim.errors import RoverError, with_path
from polarsim.formats.files import resolve_packaged

CONSTANTS = ("K_phi", "K_c", "n", "n_slip", "c", "phi_deg", "K", "K_e", "R")
POSITIVE = ("K_phi", "n", "K", "K_e", "gravity")


@dataclass(frozen=True)
class Soil:
    """Constants of a soil, measured at a given gravity."""

    name: str
    K_phi: float  # N/m^(n+2), pressure per depth, independent of width; Chrono's Bekker_Kphi
    K_c: float  # N/m^(n+1), pressure per depth, divided by the width of the plate; Bekker_Kc
    n: float  # exponent of depth; Bekker_n
    n_slip: float  # increase of n at slip 1 (Ding et al., 2010); 0: no slip sinkage
    c: float  # Pa, cohesion; Mohr_cohesion
    phi_deg: float  # degrees, angle of internal friction; Mohr_friction
    K: float  # m, shear displacement scale; Janosi_shear
    K_e: float  # Pa/m, elastic stiffness; elastic_K
    R: float  # Pa s/m, damping of the elastic branches; damping_R
    gravity: float  # m/s2, gravity of the measurement
    source: str

    def at_gravity(self, gravity: float) -> Soil:
        """Return the soil at another gravity: stiffnesses and cohesion scale as K(g) = K(g0) g / g0.

        So wheels of equal mass have equal sinkage, as Wong (2012) and Wong and Kobayashi (2012) found from 1/6 to 2 g.
        With constants independent of gravity, sinkage on Earth would be three times that on the Moon.
        """
        if not gravity > 0:
            raise RoverError(f"gravity of {gravity:g} m/s2, expected a positive value")
        ratio = gravity / self.gravity
        return replace(
            self,
            K_phi=self.K_phi * ratio,
            K_c=self.K_c * ratio,
            c=self.c * ratio,
            K_e=self.K_e * ratio,
            gravity=gravity,
        )

    def law(self, slip_sinkage: bool = True) -> ContactLaw:
        """Return the constants for the contact kernels."""
        return ContactLaw(
            self.K_phi,
            self.K_c,
            self.n,
            self.n_slip if slip_sinkage else 0.0,
            self.c,
            math.tan(math.radians(self.phi_deg)),
            self.K,
            max(self.K_e, self.K_phi),  # as Chrono does
            self.R,
        )


class ContactLaw(NamedTuple):
    """Constants of a soil for the kernels."""

    K_phi: float
    K_c: float
    n: float
    n_slip: float
    c: float
    tan_phi: float
    K: float
    K_e: float
    R: float


def read_soils(path: str | Path) -> dict[str, Soil]:
    """Read a table of soils.

    Raises
    ------
    FormatError
        The table is unreadable, or a column is missing.
    RoverError
        A soil has no name, source or gravity, or a constant is out of range.
    """
    from polarsim.formats import tables  # options import this module, and importing pandas takes a third of a second

    table = tables.read_csv(resolve_packaged(path), [field.name for field in fields(Soil)])
    soils: dict[str, Soil] = {}
    with with_path(path):
        for row in table.to_dict("records"):
            soil = _checked({str(key): value for key, value in row.items()})
            if soil.name in soils:
                raise RoverError(f"soil {soil.name!r} is defined twice")
            soils[soil.name] = soil
    return soils


def read_soil(path: str | Path, name: str) -> Soil:
    """Return a soil of a table by name."""
    soils = read_soils(path)
    if name not in soils:
        raise RoverError(f"unknown soil {name!r}, expected {', '.join(sorted(soils))}", path=path)
    return soils[name]


def _checked(row: dict[str, object]) -> Soil:
    name = _text(row["name"])
    if not name:
        raise RoverError("a soil has no name")
    source = _text(row["source"])
    if not source:
        raise RoverError(f"soil {name!r} has no source: state the origin of the constants")
    numbers = {key: _number(name, key, row[key]) for key in (*CONSTANTS, "gravity")}
    for key, value in numbers.items():
        if value < 0 or (key in POSITIVE and value == 0) or (key == "phi_deg" and value >= 90):
            raise RoverError(f"soil {name!r}: {key} is {value:g}, out of range")
    return Soil(name=name, source=source, **numbers)


def _text(value: object) -> str:
    return value.strip() if isinstance(value, str) else ""


def _number(name: str, key: str, value: object) -> float:
    try:
        number = float(str(value))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise RoverError(f"soil {name!r}: {key} is {value!r}, expected a number")
    return number
