"""A single-wheel rig and a plate press: the soil alone, without a rover."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from polarsim.errors import RoverError
from polarsim.rover.contact import Bodies, Rule, Wrenches, press
from polarsim.rover.ground import Ground, flat_ground
from polarsim.rover.shapes import Plate, Wheel
from polarsim.rover.soil import Law

Press = Callable[[Ground, Bodies, Law, Rule, float], Wrenches]
AXES = np.eye(3)


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


def rest_plate(plate: Plate, law: Law, load: float, cell: float, press: Press = press) -> float:
    """Depth, metres, at which a plate comes to rest that is pressed ever harder until it bears the load."""
    ground = flat_ground(2 * plate.length, 2 * plate.width, cell)
    # The middle lies on a node, or between two where that makes the length a whole number of cells.
    middle = ground.x[len(ground.x) // 2] + (cell / 2 if round(plate.length / cell) % 2 == 0 else 0.0)
    numbers, still = plate.numbers(cell)[None], np.zeros((1, 3))
    low, high = 0.0, 0.5

    def borne(depth: float) -> float:
        bodies = Bodies(numbers, np.array([[middle, 0.0, -depth]]), AXES[None], still, still)
        return float(press(ground.copy(), bodies, law, Rule(), 1e-3).forces[0, 2])

    if borne(high) < load:
        raise RoverError(f"the soil does not bear {load:g} N on a plate of {plate.length:g} x {plate.width:g} m")
    while high - low > 1e-9:
        low, high = (low, (low + high) / 2) if borne((low + high) / 2) > load else ((low + high) / 2, high)
    return (low + high) / 2


@dataclass(frozen=True)
class Parked:
    """A wheel that stands on a slope with its brake on."""

    time: np.ndarray  # (n,) s
    slid: np.ndarray  # (n,) m downhill
    sinkage: np.ndarray  # (n,) m

    def creep(self, begin: float, end: float) -> float:
        """How far it slid between two times, metres."""
        return float(np.interp(end, self.time, self.slid) - np.interp(begin, self.time, self.slid))


def park(
    wheel: Wheel,
    law: Law,
    mass: float,
    gravity: float,
    slope_deg: float,
    cell: float,
    seconds: float,
    press: Press,
    rule: Rule | None = None,
    dt: float = 1e-3,
) -> Parked:
    """Let a locked wheel down on a slope and watch it; free along the slope and across it, nothing damps but the soil.

    The grid lies along the slope and gravity is turned, which is the same.
    """
    ground = flat_ground(4 * wheel.reach, wheel.width + 0.12, cell)
    pull = mass * gravity * np.array([math.sin(math.radians(slope_deg)), 0.0, -math.cos(math.radians(slope_deg))])
    centre, velocity, still = np.array([2 * wheel.reach, 0.0, wheel.radius]), np.zeros(3), np.zeros((1, 3))
    numbers, start = wheel.numbers(cell)[None], 2 * wheel.reach
    steps = round(seconds / dt)
    slid, sinkage = np.zeros(steps), np.zeros(steps)
    for step in range(steps):
        bodies = Bodies(numbers, centre[None], AXES[None], velocity[None], still)
        force = press(ground, bodies, law, rule or Rule(), dt).forces[0]
        velocity = velocity + dt * (force + pull) / mass
        centre = centre + dt * velocity
        slid[step], sinkage[step] = centre[0] - start, wheel.radius - centre[2]
    return Parked(dt * np.arange(1, steps + 1), slid, sinkage)


def _rolled(angle: float) -> np.ndarray:
    """A wheel's frame after it rolled forward by an angle, about +y."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
