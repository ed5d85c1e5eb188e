"""A single-wheel rig: the soil alone, without a rover."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from polarsim.errors import RoverError
from polarsim.rover.soil.contact import Rule, Wrenches
from polarsim.rover.soil.law import Law
from polarsim.rover.soil.nodes import Ground, flat_ground
from polarsim.rover.soil.shapes import Bodies, Wheel

Press = Callable[[Ground, Bodies, Law, Rule, float], Wrenches]


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


def drive(wheel: Wheel, law: Law, load: float, slip: float, cell: float, rig: Rig, rule: Rule, press: Press) -> Driven:
    """Drive over fresh level ground at one slip; forward is +x, and the wheel starts on the surface."""
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
        force = loads.forces[0]
        seen[step] = -(centre[2] - wheel.radius), force[0], -loads.torques[0, 1], force[2]
        # The damper is taken at the end of the step, so that it cannot overshoot.
        sinking = (sinking + rig.dt * (force[2] - load) / rig.mass) / (1 + rig.dt * rig.damper / rig.mass)
        centre = centre + rig.dt * np.array([speed, 0.0, sinking])
        rolled += rig.dt * spin
    kept = seen[steps - math.floor(rig.run / (speed * rig.dt)) :]
    sinkage, pull, torque, borne = kept.mean(axis=0)
    return Driven(slip, sinkage, pull, torque, float(kept[:, 3].std() / borne), ground)


def _rolled(angle: float) -> np.ndarray:
    """A wheel's frame after it rolled forward by an angle, about +y."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
