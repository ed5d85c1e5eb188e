"""The soil against its limit and NASA's wheels: single wheels led over cells, beside integrals and measured slopes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import RoverError
from polarsim.rover.soil import contact_numba
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.bulldozing_numba import bulldoze
from polarsim.rover.soil.contact import Rule, Wrenches
from polarsim.rover.soil.law import ContactLaw, read_soils
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.nodes import Ground, flat_ground
from polarsim.rover.soil.shapes import Bodies, Wheel
from polarsim.schemas.soil import SOIL_LIMIT, SOIL_MEASURED

# VIPER's wheel with a quarter of the rover on the Moon, and a small laboratory wheel: load, N.
WHEELS = {"A": (Wheel(0.25, 0.20), "lunar", 174.15), "B": (Wheel(0.15735, 0.165), "hit-simulant", 80.0)}
SLIPS = (0.0, 0.2, 0.4, 0.6, 0.8)
GRIDS = ((0.005, 4e9), (0.02, 2e8))  # cell, m, and elastic stiffness, Pa/m
Press = Callable[[Ground, Bodies, ContactLaw, Rule, float], Wrenches]
SMOOTH_MGRU3 = Wheel(radius=0.25, width=0.20)  # the rim alone: the limit knows no grousers


@dataclass(frozen=True)
class Rig:
    """How a wheel is led: speed of its rim, a carriage of some mass with a damper that holds back its height."""

    rim_speed: float = 0.1  # m/s
    dt: float = 1e-3  # s
    mass: float = 20.0  # kg, of wheel and carriage; the load is set apart
    damper: float = 1500.0  # N s/m
    run_in: float = 0.24  # m driven before anything is averaged
    run: float = 0.06  # m over which it is
    margin: float = 0.06  # m of ground beside the wheel


@dataclass(frozen=True)
class Driven:
    """What a wheel did at one slip, averaged over the end of its run."""

    slip: float
    sinkage: float  # m
    pull: float  # N
    torque: float  # N m
    ripple: float  # of the load, standard deviation over mean
    ground: Ground = field(repr=False)


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


def drive(
    wheel: Wheel,
    law: ContactLaw,
    load: float,
    slip: float,
    cell: float,
    rig: Rig,
    rule: Rule,
    press: Press,
    bulldozing: Bulldozing | None = None,
) -> Driven:
    """Drive over fresh level ground at one slip; forward is +x, and the wheel starts on the surface.

    With `bulldozing` soil moves aside while it drives, and the wheel is lifted off at the end for what is under it.
    """
    if not slip < 1:
        raise RoverError(f"slip {slip:g}, a wheel that moves has less than 1")
    length = rig.run_in + rig.run + 2 * wheel.reach + 2 * rig.margin
    ground = flat_ground(length, 2 * (wheel.width / 2 + rig.margin), cell)
    speed, spin = (1 - slip) * rig.rim_speed, rig.rim_speed / wheel.radius
    steps = math.ceil((rig.run_in + rig.run) / (speed * rig.dt))
    centre = np.array([wheel.reach + rig.margin, 0.0, wheel.radius])
    rolled, sinking = 0.0, 0.0
    numbers = wheel.numbers(cell)[None]
    seen = np.zeros((steps, 4))
    for step in range(steps):
        velocity = np.array([speed, 0.0, sinking])
        bodies = Bodies(numbers, centre[None], _rolled(rolled)[None], velocity[None], np.array([[0.0, spin, 0.0]]))
        loads = press(ground, bodies, law, rule, rig.dt)
        if bulldozing and (step + 1) % bulldozing.every == 0:
            bulldoze(ground, bodies, bulldozing)
        force = loads.forces[0]
        seen[step] = -(centre[2] - wheel.radius), force[0], -loads.torques[0, 1], force[2]
        # The damper is taken at the end of the step, so that it cannot overshoot.
        sinking = (sinking + rig.dt * (force[2] - load) / rig.mass) / (1 + rig.dt * rig.damper / rig.mass)
        centre = centre + rig.dt * np.array([speed, 0.0, sinking])
        rolled += rig.dt * spin
    if bulldozing:
        lifted = replace(bodies, centres=centre[None] + [0.0, 0.0, wheel.reach])
        press(ground, lifted, law, rule, rig.dt)  # what gave way elastically comes back
        bulldoze(ground, lifted, bulldozing)
    kept = seen[steps - math.floor(rig.run / (speed * rig.dt)) :]
    sinkage, pull, torque, borne = kept.mean(axis=0)
    return Driven(slip, sinkage, pull, torque, float(kept[:, 3].std() / borne), ground)


def _rolled(angle: float) -> np.ndarray:
    """A wheel's frame after it rolled forward by an angle, about +y."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


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
            misses = misses_deg(curve, known[soil].law(slip_sinkage=False))
            for (slip, slope), miss in zip(curve.points, misses, strict=True):
                rows.append((curve.name, soil, slip / 100, slope, slope + float(miss)))
    return pd.DataFrame(rows, columns=list(SOIL_MEASURED.columns))


def misses_deg(curve: SlopeCurve, law: ContactLaw, wheel: Wheel = SMOOTH_MGRU3) -> np.ndarray:
    """(n,) degrees by which a soil's slope lies above the measured one at the same slip."""
    found = []
    for (slip, slope), load in zip(curve.points, curve.loads(), strict=True):
        pull = steady_wheel(wheel, law, float(load), slip / 100).pull
        found.append(math.degrees(math.atan2(pull, load)) - slope)
    return np.array(found)
