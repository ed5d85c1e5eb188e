"""Single wheels on beds of soil: driven at constant slip, locked on a slope, or moved by the caller."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.rover.soil.bulldozing import Bulldozing, bulldoze_nodes
from polarsim.rover.soil.contact import SLIP_LENGTH, Loads, press_nodes, update_slips
from polarsim.rover.soil.law import ContactLaw
from polarsim.rover.soil.nodes import LEVEL, ORIGINAL, SoilGround, make_soil_ground
from polarsim.rover.soil.shapes import Bodies, Wheel

# VIPER's wheel with a quarter of the rover on the Moon, and a small laboratory wheel.
WHEEL_A, WHEEL_B = Wheel(0.25, 0.20), Wheel(0.15735, 0.165)
LOAD_A, LOAD_B = 174.15, 80.0  # N


def press(ground: SoilGround, bodies: Bodies, law: ContactLaw, dt: float) -> Loads:
    """Compute a step of the contact of all wheels, in order; changes `ground` and `bodies.slips`."""
    count = len(bodies.shapes)
    length = 0.0 if bodies.slips is None else SLIP_LENGTH
    if bodies.slips is None:
        bodies = bodies._replace(slips=np.zeros(count))
    loads = Loads.zeros(count)
    update_slips(bodies, length, dt)
    press_nodes(ground, bodies, law, dt, loads)
    return loads


def bulldoze(ground: SoilGround, bodies: Bodies, rule: Bulldozing) -> None:
    """Move aside the soil that the bodies pressed since the last call, then let it slide around them."""
    if bodies.slips is None:  # unused here, but the kernels need an array
        bodies = bodies._replace(slips=np.zeros(len(bodies.shapes)))
    bulldoze_nodes(ground, bodies, rule)


def flat_ground(length: float, width: float, cell: float) -> SoilGround:
    """Return level ground from x = 0 to `length`; y = 0 is midway between two rows, so that widths are whole cells."""
    columns, rows = round(length / cell) + 1, 2 * round(width / (2 * cell))
    return make_soil_ground(np.zeros((rows, columns)), cell, y0=-(rows - 1) / 2 * cell)


def copied(ground: SoilGround) -> SoilGround:
    return ground._replace(state=ground.state.copy(), normals=ground.normals.copy(), owner=ground.owner.copy())


def rut(ground: SoilGround) -> np.ndarray:
    """Return the depth of the surface below the original surface, m; negative in a berm."""
    return ground.state[..., ORIGINAL] - ground.state[..., LEVEL]


def volume(ground: SoilGround) -> float:
    """Return the volume of soil above the original surface minus that missing below it, m3."""
    return -float(rut(ground).sum()) * ground.cell**2


@dataclass(frozen=True)
class Rig:
    """Test rig: constant rim speed, and a carriage with mass and a vertical damper."""

    rim_speed: float = 0.1  # m/s
    dt: float = 1e-3  # s
    mass: float = 20.0  # kg, of wheel and carriage, in addition to the load
    damper: float = 1500.0  # N s/m
    run_in: float = 0.24  # m driven before averaging
    run: float = 0.06  # m of averaging
    margin: float = 0.06  # m of ground at the sides of the wheel


@dataclass(frozen=True)
class Driven:
    """Averages of a wheel at constant slip over the end of a run."""

    sinkage: float  # m
    pull: float  # N
    torque: float  # N m


def drive(wheel: Wheel, law: ContactLaw, load: float, slip: float, cell: float, rig: Rig) -> Driven:
    """Drive over undisturbed level ground at constant slip; forward is +x, and the wheel starts on the surface."""
    length = rig.run_in + rig.run + 2 * wheel.reach + 2 * rig.margin
    ground = flat_ground(length, 2 * (wheel.width / 2 + rig.margin), cell)
    speed, spin = (1 - slip) * rig.rim_speed, rig.rim_speed / wheel.radius
    steps = math.ceil((rig.run_in + rig.run) / (speed * rig.dt))
    centre = np.array([wheel.reach + rig.margin, 0.0, wheel.radius])
    rolled, sinking = 0.0, 0.0
    numbers = wheel.numbers()[None]
    measured = np.zeros((steps, 3))
    for step in range(steps):
        velocity = np.array([speed, 0.0, sinking])
        bodies = Bodies(numbers, centre[None], _rolled(rolled)[None], velocity[None], np.array([[0.0, spin, 0.0]]))
        loads = press(ground, bodies, law, rig.dt)
        force = loads.forces[0]
        measured[step] = -(centre[2] - wheel.radius), force[0], -loads.torques[0, 1]
        # The damper is implicit, so that it cannot overshoot.
        sinking = (sinking + rig.dt * (force[2] - load) / rig.mass) / (1 + rig.dt * rig.damper / rig.mass)
        centre = centre + rig.dt * np.array([speed, 0.0, sinking])
        rolled += rig.dt * spin
    return Driven(*measured[steps - math.floor(rig.run / (speed * rig.dt)) :].mean(axis=0))


def _rolled(angle: float) -> np.ndarray:
    """Return the rotation of a wheel that rolled forward by an angle, about +y."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def park(
    wheel: Wheel, law: ContactLaw, mass: float, gravity: float, slope_deg: float, cell: float, seconds: float
) -> np.ndarray:
    """Lower a locked wheel onto a slope; return (n,) how far it slid downhill after each millisecond, m.

    Only the soil damps the motion. The grid is parallel to the slope and gravity is rotated, which is equivalent.
    """
    ground, dt = flat_ground(4 * wheel.reach, wheel.width + 0.12, cell), 1e-3
    pull = mass * gravity * np.array([math.sin(math.radians(slope_deg)), 0.0, -math.cos(math.radians(slope_deg))])
    centre, velocity, still = np.array([2 * wheel.reach, 0.0, wheel.radius]), np.zeros(3), np.zeros((1, 3))
    numbers, slid = wheel.numbers()[None], np.zeros(round(seconds / dt))
    for step in range(len(slid)):
        bodies = Bodies(numbers, centre[None], np.eye(3)[None], velocity[None], still)
        velocity = velocity + dt * (press(ground, bodies, law, dt).forces[0] + pull) / mass
        centre = centre + dt * velocity
        slid[step] = centre[0] - 2 * wheel.reach
    return slid


class SoilBin:
    """Ground and contact law; `steps` counts the steps."""

    def __init__(self, ground: SoilGround, law: ContactLaw, bulldozing: Bulldozing | None = None) -> None:
        self.ground, self.law, self.bulldozing, self.steps = ground, law, bulldozing, 0

    def step(self, bodies: Bodies, dt: float) -> Loads:
        """Return the forces on the bodies at their current pose; changes the ground."""
        loads = press(self.ground, bodies, self.law, dt)
        self.steps += 1
        if self.bulldozing is not None and self.steps % self.bulldozing.every == 0:
            bulldoze(self.ground, bodies, self.bulldozing)
        return loads
