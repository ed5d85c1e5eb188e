"""Measurements and laws of wheels on soil that others published, in their units.

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
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from polarsim.errors import RoverError
from polarsim.rover.soil.law import ContactLaw, Soil
from polarsim.rover.soil.shapes import Wheel
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_rig import WHEEL_A, Rig, drive

EARTH, MOON = 9.81, 1.62  # m/s2
EX1_WHEEL, EX1_LOAD = Wheel(0.11, 0.10), 20.0 * EARTH / 4  # N; 20 kg on four wheels
SLOPES_DEG = (0.0, 5.0, 10.0, 15.0, 18.0)  # to the steepest that was driven
SINKING_SLIPS = (0.0, 0.1, 0.2, 0.4, 0.6)
_SLIPS_TRIED = tuple(k / 20 for k in range(20))
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


@dataclass(frozen=True)
class SlopeCurve:
    """Slip, per cent, and the slope, degrees, at which a wheel under a load has it; of a rig the angle of its pull."""

    name: str
    load: float  # N, of one wheel on the level
    tilted: bool  # a slope takes load off the wheel, a rig does not
    points: tuple[tuple[float, float], ...]

    def loads(self) -> np.ndarray:
        """(n,) N on the wheel at each point."""
        slopes = np.radians([slope for _, slope in self.points])
        return self.load * (np.cos(slopes) if self.tilted else np.ones_like(slopes))


# Digitised from Hu et al., arXiv 2405.11001, figure 4, by others' public code; repeats on the rig scatter by 1.5
# degrees. The two do not agree with each other (at 20 % slip 20 degrees on the rig, 12 on the bed), so each has its
# own soil.
TREC = SlopeCurve(
    "TREC rig, MGRU3 in GRC-3", 171.7, False,
    (
        (-0.2, -1.7), (4.9, 8.1), (9.8, 13.8), (9.9, 16.9), (20.0, 20.1), (30.0, 19.9), (30.0, 22.3), (40.0, 21.5),
        (40.0, 23.1), (40.0, 24.9), (50.1, 24.4), (60.1, 21.8), (60.1, 25.6), (60.1, 25.7), (70.1, 25.0), (70.1, 29.7),
        (80.1, 31.3), (80.1, 33.6),
    ),
)  # fmt: skip
# Four wheels carry 88 kg. Points of 25 and 30 degrees are left out: no set of the model reaches them and the others.
TILT_BED = SlopeCurve(
    "MGRU3 tilt bed to 20 degrees", 88 * 9.81 / 4, True,
    ((2.5, 0.3), (5.1, 5.6), (10.4, 10.0), (35.5, 15.3), (73.8, 20.0)),
)  # fmt: skip
CURVES = {"trec-grc3": TREC, "mgru3-tilt-bed": TILT_BED}  # by the soil that each was fitted to


def misses_deg(curve: SlopeCurve, law: ContactLaw) -> np.ndarray:
    """(n,) degrees by which a soil's slope lies above the measured one at the same slip."""
    found = []
    for (slip, slope), load in zip(curve.points, curve.loads(), strict=True):
        pull = steady_wheel(WHEEL_A, law, float(load), slip / 100).pull
        found.append(math.degrees(math.atan2(pull, load)) - slope)
    return np.array(found)


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
        found = drive(wheel, law, mass * self.gravity, slip, 0.02 * self.size, rig)
        power = found.torque * rig.rim_speed / wheel.radius
        return (1 - slip) * rig.rim_speed / natural, power / (mass * self.gravity * natural)


def ex1_misses(law: ContactLaw) -> tuple[np.ndarray, np.ndarray]:
    """(5,) slips, of 1 where it does not climb, and (5,) sinkages, mm, above those of Kern et al."""
    slips = [slip_on_slope(EX1_WHEEL, law, EX1_LOAD, slope) for slope in SLOPES_DEG]
    sinkages = [1000 * steady_wheel(EX1_WHEEL, law, EX1_LOAD, slip).sinkage for slip in SINKING_SLIPS]
    wanted = [slip_of_slope(slope) for slope in SLOPES_DEG]
    deep = [sinkage_of_slip_mm(slip) for slip in SINKING_SLIPS]
    return np.nan_to_num(slips, nan=1.0) - wanted, np.subtract(sinkages, deep)
