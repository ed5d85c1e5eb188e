"""Soils by name: Bekker-Wong, Mohr-Coulomb and Janosi-Hanamoto constants under Chrono's names, with their source."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field, StringConstraints, ValidationError
from pydantic.dataclasses import dataclass

from polarsim.errors import RoverError, with_path
from polarsim.formats.files import resolve_packaged
from polarsim.formats.yaml_files import describe_error

# Angle of friction between soil and a smooth rim over that within the soil, the usual value of foundation engineering;
# Potyondy (Geotechnique 11 (1961) 339) measured 0.54 and 0.76 for dry sand on smooth and rough steel.
SMOOTH_FRICTION = 2 / 3
Constant = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


@dataclass(frozen=True)
class Soil:
    """Constants of a soil, measured at a given gravity."""

    name: Text
    K_phi: Positive  # N/m^(n+2), pressure per depth, independent of width; Chrono's Bekker_Kphi
    K_c: Constant  # N/m^(n+1), pressure per depth, divided by the width of the plate; Bekker_Kc
    n: Positive  # exponent of depth; Bekker_n
    n_slip: Constant  # increase of n at slip 1 (Ding et al., 2010); 0: no slip sinkage
    c: Constant  # Pa, cohesion; Mohr_cohesion
    phi_deg: Annotated[Constant, Field(lt=90)]  # degrees, angle of internal friction; Mohr_friction
    K: Positive  # m, shear displacement scale; Janosi_shear
    K_e: Positive  # Pa/m, elastic stiffness; elastic_K
    R: Constant  # Pa s/m, damping of the elastic branches; damping_R
    gravity: Positive  # m/s2, gravity of the measurement
    source: Text

    def at_gravity(self, gravity: float) -> Soil:
        """Return the soil at another gravity: stiffnesses and cohesion scale as K(g) = K(g0) g / g0.

        So wheels of equal mass have equal sinkage, as Wong (2012) and Wong and Kobayashi (2012) found from 1/6 to 2 g.
        With constants independent of gravity, sinkage on Earth would be three times that on the Moon.
        """
        ratio = gravity / self.gravity
        scaled = {name: getattr(self, name) * ratio for name in ("K_phi", "K_c", "c", "K_e")}
        return replace(self, gravity=gravity, **scaled)

    def law(self, slip_sinkage: bool = True, smooth_rim: bool = False) -> ContactLaw:
        """Return the constants for the contact kernels.

        Grousers shear the soil; a smooth rim slides on it, with the friction of `SMOOTH_FRICTION` and without cohesion.
        """
        n_slip, K_e = self.n_slip if slip_sinkage else 0.0, max(self.K_e, self.K_phi)  # as Chrono does
        phi_deg, c = (SMOOTH_FRICTION * self.phi_deg, 0.0) if smooth_rim else (self.phi_deg, self.c)
        tan_phi = math.tan(math.radians(phi_deg))
        return ContactLaw(self.K_phi, self.K_c, self.n, n_slip, c, tan_phi, self.K, K_e, self.R)


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
    """Read a table of soils; a missing source and a constant that is out of range are errors."""
    from polarsim.formats import tables  # options import this module, and importing pandas takes a third of a second

    names = [field.name for field in fields(Soil)]
    soils: dict[str, Soil] = {}
    for row in tables.read_csv(resolve_packaged(path), names)[names].to_dict("records"):
        with with_path(path):
            try:
                soil = Soil(**{str(key): value for key, value in row.items()})
            except ValidationError as error:
                raise RoverError(f"soil {row['name']!r}: {describe_error(error, 'the row')}") from error
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
