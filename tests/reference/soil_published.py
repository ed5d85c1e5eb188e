"""Published measurements and laws of wheels on soil, in their original units.

Kern et al. (arXiv 2601.04547) drove EX1, a rover with four wheels, over Tohoku silica sand No. 5 and fitted slip and
sinkage. The formulas here are from a public review of the paper, without the wheel and the units of speed and slope.
These must be metres per second and degrees, since slips leave 0 to 1 in other units. The load term is omitted, because
the review does not contain the reference load. The wheel is that of OmniLRS's rover, from the same laboratory.

Hu et al. (arXiv 2405.11001) state that the power P / (M g sqrt(L g)) of a wheel depends only on the speed V / sqrt(L g)
and not on gravity (granular scaling laws, Slonaker et al., arXiv 1604.02490). The power on the Moon must therefore
equal that on Earth at sqrt(6) times the speed.
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
from tests.reference.soil_rig import Rig, drive

EARTH, MOON = 9.81, 1.62  # m/s2
MGRU3_WHEEL = Wheel(0.275, 0.20)  # at the tips of its grousers
EX1_WHEEL, EX1_LOAD = Wheel(0.11, 0.10), 20.0 * EARTH / 4  # N; 20 kg on four wheels
SLOPES_DEG = (0.0, 5.0, 10.0, 15.0, 18.0)  # up to the steepest slope of the experiment
SINKING_SLIPS = (0.0, 0.1, 0.2, 0.4, 0.6)
_SLIPS_TRIED = tuple(k / 20 for k in range(20))
_SPEED_M_S = 0.1  # of EX1's wheels; the soil's law is independent of speed


def slip_of_slope(slope_deg: float, speed_m_s: float = _SPEED_M_S) -> float:
    """Return EX1's slip on a slope at a rim speed (Kern et al.)."""
    return (0.00522 * speed_m_s + 0.00105) * slope_deg**2 + 0.0265 * speed_m_s + 0.0256


def sinkage_of_slip_mm(slip: float) -> float:
    """Return the sinkage of a wheel under the reference load, mm (Kern et al.)."""
    return 33.56 * slip + 3.11


def slip_on_slope(wheel: Wheel, law: ContactLaw, weight: float, slope_deg: float) -> float:
    """Return the slip at which a wheel with `weight`, N on level ground, climbs a slope; NaN if it cannot climb."""
    slope = math.radians(slope_deg)

    def missing(slip: float) -> float:
        return steady_wheel(wheel, law, weight * math.cos(slope), slip).pull - weight * math.sin(slope)

    # A wheel with much slip digs in and loses pull, so the smallest sufficient slip is returned.
    before = 0.0
    try:
        for slip in _SLIPS_TRIED:
            if missing(slip) >= 0:
                return float(brentq(missing, before, slip, xtol=1e-6)) if slip else 0.0
            before = slip
    except RoverError:  # the wheel sinks to the axle
        pass
    return math.nan


@dataclass(frozen=True)
class SlopeCurve:
    """Slip, %, and slope, degrees, of a wheel under a load; for a rig the angle of the pull."""

    name: str
    load: float  # N, of a wheel on level ground
    tilted: bool  # a slope reduces the load of the wheel, a rig does not
    points: tuple[tuple[float, float], ...]


# Digitised from Hu et al., arXiv 2405.11001, figure 4, with public code; repeats on the rig scatter by 1.5 degrees.
# The data sets disagree (at 20 % slip 20 degrees on the rig, 12 degrees on the bed), so each has a separate soil.
TREC = SlopeCurve(
    "TREC rig, MGRU3 in GRC-3", 171.7, False,
    (
        (-0.2, -1.7), (4.9, 8.1), (9.8, 13.8), (9.9, 16.9), (20.0, 20.1), (30.0, 19.9), (30.0, 22.3), (40.0, 21.5),
        (40.0, 23.1), (40.0, 24.9), (50.1, 24.4), (60.1, 21.8), (60.1, 25.6), (60.1, 25.7), (70.1, 25.0), (70.1, 29.7),
        (80.1, 31.3), (80.1, 33.6),
    ),
)  # fmt: skip
# Four wheels carry 88 kg. Points at 25 and 30 degrees are excluded: no set of constants fits all points.
TILT_BED = SlopeCurve(
    "MGRU3 tilt bed to 20 degrees", 88 * 9.81 / 4, True,
    ((2.5, 0.3), (5.1, 5.6), (10.4, 10.0), (35.5, 15.3), (73.8, 20.0)),
)  # fmt: skip


def misses_deg(curve: SlopeCurve, law: ContactLaw) -> np.ndarray:
    """Return (n,) degrees by which a soil's slope exceeds the measured slope at the same slip."""
    found = []
    for slip, slope in curve.points:
        load = curve.load * (math.cos(math.radians(slope)) if curve.tilted else 1.0)
        pull = steady_wheel(MGRU3_WHEEL, law, load, slip / 100).pull
        found.append(math.degrees(math.atan2(pull, load)) - slope)
    return np.array(found)


@dataclass(frozen=True)
class Trial:
    """A wheel of scaled size with VIPER's mass at full size, under a gravity, on a soil."""

    gravity: float
    size: float = 1.0
    scaled: bool = True  # scale the soil's constants with gravity

    def numbers(self, soil: Soil, slip: float) -> tuple[float, float]:
        """Return V / sqrt(L g) and P / (M g sqrt(L g)), L the wheel's radius."""
        wheel, mass = Wheel(0.25 * self.size, 0.20 * self.size), 107.5 * self.size**3
        law = (soil.at_gravity(self.gravity) if self.scaled else soil).law()
        natural = math.sqrt(wheel.radius * self.gravity)
        quick = math.sqrt(self.gravity / (MOON * self.size))  # time scales are inversely proportional
        rig = Rig(
            rim_speed=0.1 * quick * self.size, dt=1e-3 / quick, mass=20.0 * self.size**3,
            damper=1500.0 * self.size**3 * quick, run_in=0.24 * self.size, run=0.06 * self.size,
            margin=0.06 * self.size,
        )  # fmt: skip
        result = drive(wheel, law, mass * self.gravity, slip, 0.02 * self.size, rig)
        power = result.torque * rig.rim_speed / wheel.radius
        return (1 - slip) * rig.rim_speed / natural, power / (mass * self.gravity * natural)


def ex1_misses(law: ContactLaw) -> tuple[np.ndarray, np.ndarray]:
    """Return errors relative to Kern et al.: (5,) slips, 1 if the slope is too steep, and (5,) sinkages, mm."""
    slips = [slip_on_slope(EX1_WHEEL, law, EX1_LOAD, slope) for slope in SLOPES_DEG]
    sinkages = [1000 * steady_wheel(EX1_WHEEL, law, EX1_LOAD, slip).sinkage for slip in SINKING_SLIPS]
    expected = [slip_of_slope(slope) for slope in SLOPES_DEG]
    expected_sinkages = [sinkage_of_slip_mm(slip) for slip in SINKING_SLIPS]
    return np.nan_to_num(slips, nan=1.0) - expected, np.subtract(sinkages, expected_sinkages)
