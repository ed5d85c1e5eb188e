"""The soil beside laws that others published, in their units, and beside what must hold of any soil.

Kern et al. (arXiv 2601.04547) drove EX1, a rover with four wheels, over Tohoku silica sand No. 5 and fitted its slip
and a wheel's sinkage. Their formulas are taken from a public review of the paper, which names neither the wheel nor the
units of speed and slope: metres a second and degrees, for with any others slips leave 0 to 1. Their term of the load is
left out: its reference load is not given there. The wheel is that of OmniLRS's rover, by the same laboratory.

Hu et al. (arXiv 2405.11001) hold that a wheel's power P / (M g sqrt(L g)) depends on its speed V / sqrt(L g) alone, not
on gravity (granular scaling laws, Slonaker et al., arXiv 1604.02490). So a wheel's power on the Moon is what must come
out on Earth at a speed sqrt(6) times as high.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from polarsim.errors import RoverError
from polarsim.formats import tables
from polarsim.randomness import generator
from polarsim.rover.soil import bulldozing_numba, contact_numba
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.check import Rig, against_limit, against_measured, drive
from polarsim.rover.soil.contact import Rule
from polarsim.rover.soil.law import ContactLaw, Soil, read_soils
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.nodes import LEVEL, PLASTIC, START, Ground, make_ground
from polarsim.rover.soil.shapes import Wheel
from polarsim.schemas.soil import SOIL_CHECKS

EARTH, MOON = 9.81, 1.62  # m/s2
EX1_WHEEL, EX1_LOAD = Wheel(0.11, 0.10), 20.0 * EARTH / 4  # N; 20 kg on four wheels
EX1_SOIL = "ex1-silica-5"
SLOPES_DEG = (0.0, 5.0, 10.0, 15.0, 18.0)  # to the steepest that was driven
SINKING_SLIPS = (0.0, 0.1, 0.2, 0.4, 0.6)
SCALED_SLIPS = (0.05, 0.2, 0.4)
_SLIPS_TRIED = tuple(k / 20 for k in range(20))
_BESIDE_M = 0.3  # of ground beside a wheel whose berms are measured
_SWEEPS, _STILL_M = 50_000, 1e-8  # of avalanches, until they rest
_SPEED_M_S = 0.1  # of EX1's wheels: the soil's law knows no speed


def slip_of_slope(slope_deg: float, speed_m_s: float = _SPEED_M_S) -> float:
    """EX1's slip on a slope at a speed of its wheels' rims (Kern et al.)."""
    return (0.00522 * speed_m_s + 0.00105) * slope_deg**2 + 0.0265 * speed_m_s + 0.0256


def sinkage_of_slip_mm(slip: float) -> float:
    """Sinkage of a wheel under the reference load, downwards (Kern et al.)."""
    return 33.56 * slip + 3.11


def slip_on_slope(wheel: Wheel, law: ContactLaw, weight: float, slope_deg: float) -> float:
    """The slip at which a wheel that carries `weight`, N on the level, climbs a slope; NaN: it does not climb it."""
    slope = math.radians(slope_deg)

    def missing(slip: float) -> float:
        return steady_wheel(wheel, law, weight * math.cos(slope), slip).pull - weight * math.sin(slope)

    # With slip a wheel digs itself in and comes to pull less again: the least slip that does is wanted.
    before = 0.0
    try:
        for slip in _SLIPS_TRIED:
            if missing(slip) >= 0:
                return float(brentq(missing, before, slip, xtol=1e-6)) if slip else 0.0
            before = slip
    except RoverError:  # it sinks to its axle
        pass
    return math.nan


def check_soil(*, soils: Path, limit: Path, measured_slopes: Path, checks: Path) -> None:
    """Write all tables: wheels against the limit, soils against NASA's slopes, and against what others published.

    Raises
    ------
    PolarsimError
        The table of soils is broken, or lacks a soil of the check.
    """
    tables.write_parquet(limit, against_limit(soils))
    tables.write_parquet(measured_slopes, against_measured(soils))
    tables.write_parquet(checks, against_published(soils))


def against_published(soils: Path) -> pd.DataFrame:
    """A row a condition and soil, `SOIL_CHECKS`: what was published or must hold, and what the model does."""
    known = read_soils(soils)
    rows = [*_ex1(known), *_scaling(known["lunar"]), *_kept(known["lunar"]), *_rest()]
    return pd.DataFrame(rows, columns=list(SOIL_CHECKS.columns))


Row = tuple[str, str, str, str, str, float, float, float]


def _ex1(known: dict[str, Soil]) -> Iterator[Row]:
    for name in (EX1_SOIL, "lunar"):
        law = known[name].at_gravity(EARTH).law()
        for slope in SLOPES_DEG:
            found = slip_on_slope(EX1_WHEEL, law, EX1_LOAD, slope)
            yield "Kern et al.", "slip", "", name, "slope, degrees", slope, slip_of_slope(slope), found
        for slip in SINKING_SLIPS:
            found = 1000 * steady_wheel(EX1_WHEEL, law, EX1_LOAD, slip).sinkage
            yield "Kern et al.", "sinkage", "mm", name, "slip", slip, sinkage_of_slip_mm(slip), found


@dataclass(frozen=True)
class Trial:
    """A wheel of a size under a gravity, of VIPER's mass at full size, on a soil; all of a size scales with it."""

    gravity: float
    size: float = 1.0
    scaled: bool = True  # the soil's constants with gravity

    def numbers(self, soil: Soil, slip: float) -> tuple[float, float]:
        """V / sqrt(L g) and P / (M g sqrt(L g)), L the wheel's radius."""
        wheel, mass = Wheel(0.25 * self.size, 0.20 * self.size), 107.5 * self.size**3
        law = (soil.at_gravity(self.gravity) if self.scaled else soil).law()
        natural = math.sqrt(wheel.radius * self.gravity)
        quick = math.sqrt(self.gravity / (MOON * self.size))  # times of a process scale with its inverse
        rig = Rig(
            rim_speed=0.1 * quick * self.size, dt=1e-3 / quick, mass=20.0 * self.size**3,
            damper=1500.0 * self.size**3 * quick, run_in=0.24 * self.size, run=0.06 * self.size,
            margin=0.06 * self.size,
        )  # fmt: skip
        rule = Rule(False, slip_length=0.1 * self.size)
        found = drive(wheel, law, mass * self.gravity, slip, 0.02 * self.size, rig, rule, contact_numba.press)
        power = found.torque * rig.rim_speed / wheel.radius
        return (1 - slip) * rig.rim_speed / natural, power / (mass * self.gravity * natural)


def _scaling(soil: Soil) -> Iterator[Row]:
    trials = {
        "on Earth": Trial(EARTH),
        "on Earth, constants of the Moon": Trial(EARTH, scaled=False),
        "on Earth, half size": Trial(EARTH, size=0.5),
    }
    on_moon = [Trial(MOON).numbers(soil, slip) for slip in SCALED_SLIPS]
    for how, trial in trials.items():
        for slip, (speed, power) in zip(SCALED_SLIPS, on_moon, strict=True):
            there = trial.numbers(soil, slip)[1]
            yield "Hu et al.", "P / (M g sqrt(L g))", "", soil.name, f"V / sqrt(L g), {how}", speed, power, there


def _kept(soil: Soil) -> Iterator[Row]:
    """Of the soil that a wheel presses, a share must be found beside its rut."""
    for share in (0.5, 1.0):
        rig = Rig(margin=_BESIDE_M)
        ground = drive(
            Wheel(0.25, 0.20), soil.law(), 107.5 * MOON, 0.1, 0.02, rig, Rule(), contact_numba.press, Bulldozing(share)
        ).ground
        pressed = float((ground.state[..., PLASTIC] / ground.normals[..., 2]).sum()) * ground.cell**2
        moved = ground.volume() + pressed
        yield "mass", "volume moved aside over pressed", "", soil.name, "share", share, share, moved / pressed


def _rest() -> Iterator[Row]:
    """After avalanches no soil is lost, and none is steeper than it can rest."""
    for angle_deg in (30.0, 36.0):
        ground = heap(angle_deg)
        before, level = ground.volume(), ground.level.copy()
        bulldozing_numba.settle(ground, angle_deg, sweeps=_SWEEPS, still_m=_STILL_M)
        moved = float(np.abs(ground.level - level).sum()) * ground.cell**2 / 2
        drift_ppm = 1e6 * (ground.volume() - before) / moved
        condition = "angle of repose, degrees"
        yield "mass", "volume lost in avalanches", "ppm of what moved", "any", condition, angle_deg, 0.0, drift_ppm
        for name, slope in (
            ("steepest slope between nodes", steepest_between(ground)),
            ("steepest plane through a cell", steepest_plane(ground)),
        ):
            yield "repose", name, "degrees", "any", condition, angle_deg, angle_deg, math.degrees(math.atan(slope))


def steepest_between(ground: Ground) -> float:
    """Tangent of the steepest slope between neighbours along rows, columns and across corners."""
    level = ground.level
    straight = max(float(np.abs(np.diff(level, axis=axis)).max()) for axis in (0, 1))
    corners = max(
        float(np.abs(one).max()) for one in (level[1:, 1:] - level[:-1, :-1], level[1:, :-1] - level[:-1, 1:])
    )
    return max(straight, corners / math.sqrt(2)) / ground.cell


def steepest_plane(ground: Ground) -> float:
    """Tangent of the steepest of the planes that fit the four nodes of a cell best."""
    down = ground.level[1:, 1:] - ground.level[:-1, :-1], ground.level[1:, :-1] - ground.level[:-1, 1:]
    return float(np.hypot(*down).max() / math.sqrt(2) / ground.cell)


def heap(angle_deg: float) -> Ground:
    """Soil that was poured out: a cone twice as steep as it can rest, and random heaps and pits beside it."""
    ground = make_ground(np.zeros((81, 81)), 0.02)
    x, y = np.meshgrid(ground.x - 0.6, ground.y - 0.8)
    poured = np.maximum(0.2 - 2 * math.tan(math.radians(angle_deg)) * np.hypot(x, y), 0.0)
    poured += (x > 0.5) * generator(0, "rover", "heap").uniform(-0.03, 0.03, poured.shape)
    for field in (START, LEVEL):
        ground.state[..., field] += poured
    return ground
