"""A bed of soil, a plate press, a wheel locked on a slope: what the soil is measured and tested on beside the rig."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.errors import RoverError
from polarsim.rover.soil import bulldozing_numba, contact_numba
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.check import Press
from polarsim.rover.soil.contact import Rule, Wrenches, press
from polarsim.rover.soil.law import ContactLaw
from polarsim.rover.soil.nodes import Ground, flat_ground
from polarsim.rover.soil.shapes import Bodies, Plate, Wheel, reach

AXES = np.eye(3)


def patch_inverse_width(length: float, width: float) -> float:
    """Chrono's 1/b of a rectangular patch: perimeter over twice the area, which is 1/b + 1/L."""
    return (length + width) / (length * width)


def rest_plate(plate: Plate, law: ContactLaw, load: float, cell: float, press: Press = press) -> float:
    """Depth, metres, at which a plate comes to rest that is pressed ever harder until it bears the load."""
    ground = flat_ground(2 * plate.length, 2 * plate.width, cell)
    # The centre lies on a node, or between two where that makes the length a whole number of cells.
    centre = ground.x[len(ground.x) // 2] + (cell / 2 if round(plate.length / cell) % 2 == 0 else 0.0)
    numbers, still = plate.numbers(cell)[None], np.zeros((1, 3))
    low, high = 0.0, 0.5

    def borne(depth: float) -> float:
        bodies = Bodies(numbers, np.array([[centre, 0.0, -depth]]), AXES[None], still, still)
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
    law: ContactLaw,
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

    The grid lies along the slope and gravity is rotated, which is the same.
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


class SoilBin:
    """Ground and the law by which it gives way; `steps` counts the steps so far."""

    def __init__(self, ground: Ground, law: ContactLaw, bulldozing_rule: Bulldozing | None = None) -> None:
        self.ground, self.law, self.bulldozing, self.steps = ground, law, bulldozing_rule, 0

    def step(self, bodies: Bodies, dt: float) -> Wrenches:
        """Forces on the bodies where they are now; the ground gives way."""
        self.ground.require_inside(bodies.centres, reach(bodies.numbers))
        wrenches = contact_numba.press(self.ground, bodies, self.law, Rule(), dt)
        self.steps += 1
        if self.bulldozing is not None and self.steps % self.bulldozing.every == 0:
            bulldozing_numba.bulldoze(self.ground, bodies, self.bulldozing)
        return wrenches
