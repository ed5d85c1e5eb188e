"""What NASA measured with VIPER's wheel on Earth, to compare soils with.

Digitised from Hu et al., arXiv 2405.11001, figure 4, by others' public code; repeats on the rig scatter by 1.5 degrees.
The two do not agree with each other (at 20 % slip 20 degrees on the rig, 12 on the bed), so each has a soil of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.rover.soil.law import Law
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.shapes import Wheel

SMOOTH_MGRU3 = Wheel(radius=0.25, width=0.20)  # the rim alone: the limit knows no grousers


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


def misses_deg(curve: SlopeCurve, law: Law, wheel: Wheel = SMOOTH_MGRU3) -> np.ndarray:
    """(n,) degrees by which a soil's slope lies above the measured one at the same slip."""
    found = []
    for (slip, slope), load in zip(curve.points, curve.loads(), strict=True):
        pull = steady_wheel(wheel, law, float(load), slip / 100).pull
        found.append(math.degrees(math.atan2(pull, load)) - slope)
    return np.array(found)
