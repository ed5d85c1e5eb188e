"""The energy balance of a drive: the guard against steps that are too long, which nothing else shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.errors import RoverError
from polarsim.rover.soil.law import ContactLaw
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import Vehicle

LARGEST_PHASE = 1.0  # rad of the stiffest swing, wheel on elastic soil, in one step
BOUND = 0.02  # share of the energy that may be missing; a sound drive misses 0.0007 at most
LEAST = 5.0  # J put in before a share of it means anything
GUARDED = 100.0  # J, some metres of drive: the guard takes no less as the whole, for wheels set down jolt a little


class EnergyError(RoverError):
    """The balance is open: what the drive gave is no physics."""


@dataclass(frozen=True)
class Account:
    """J since the count began; by wheel in the order of `WHEELS`."""

    motor: float  # given by drives and steering servos
    soil: float  # taken by the soil
    damper: float  # taken by dampers
    rock: float  # taken by rocks and by stops of joints
    driving: float  # given or taken by drives, whatever its sign
    change: float  # of kinetic and potential energy
    motor_of: tuple[float, ...]
    soil_of: tuple[float, ...]

    @classmethod
    def of(cls, numbers: np.ndarray, change: float) -> Account:
        """From the kernel's numbers."""
        values = [float(number) for number in numbers]
        motor, soil, damper, rock, driving = values[:5]
        return cls(motor, soil, damper, rock, driving, change, tuple(values[5:9]), tuple(values[9:13]))

    @property
    def missing(self) -> float:
        """J that nobody took."""
        return self.motor - self.soil - self.damper - self.rock - self.change

    @property
    def put_in(self) -> float:
        """By drives, and by what the rover gave up of its own in falling and slowing down."""
        return self.driving + max(-self.change, 0.0)

    @property
    def open(self) -> float:
        """`missing` as a share of what was put in, 0 before that means anything."""
        return self.missing / self.put_in if self.put_in > LEAST else 0.0


def require_closed(account: Account, time: float) -> None:
    """The guard of every run.

    Raises
    ------
    EnergyError
        More than `BOUND` of the energy is unaccounted for.
    """
    whole = max(account.put_in, GUARDED)
    if not abs(account.missing) <= BOUND * whole:  # NaN is open too
        raise EnergyError(
            f"at {time:.2f} s {100 * account.missing / whole:.2g} % of the energy is missing, {100 * BOUND:.2g} % may "
            "be: take a smaller step or a softer soil"
        )


def largest_step(vehicle: Vehicle, law: ContactLaw, gravity: float) -> float:
    """Longest time step, s, in which a wheel's swing on elastic soil is followed.

    The patch is that of the wheel at rest: by Bekker's law with n = 1 it sinks by (3 W / (2 b K sqrt(2 R)))^(2/3).
    With the demo's soil this gives 2.7 ms (8.4 at a tenth of the elastic stiffness), where a drive still is sound at 2
    (5) ms and pumps energy at 4.
    """
    steps = []
    for wheel in vehicle.wheels:
        load = vehicle.mass * gravity / len(vehicle.wheels)
        stiffness = law.K_c / wheel.width_m + law.K_phi
        sunk = (1.5 * load / (wheel.width_m * stiffness * math.sqrt(2 * wheel.radius_m))) ** (2 / 3)
        area = wheel.width_m * math.sqrt(2 * wheel.radius_m * sunk)
        unsprung = wheel.mass_kg + wheel.arm_mass_kg + wheel.upright_mass_kg
        steps.append(LARGEST_PHASE / math.sqrt(law.K_e * area / unsprung))
    return min(steps)


def require_small_step(vehicle: Vehicle, law: ContactLaw, options: SoilOptions) -> None:
    """Refuse a step before anything runs.

    Raises
    ------
    RoverError
        It is too large for the soil's elastic stiffness.
    """
    largest = largest_step(vehicle, law, options.gravity_m_s2)
    if options.step_s > largest:
        raise RoverError(
            f"a step of {1000 * options.step_s:g} ms is too large for an elastic stiffness of {law.K_e:.3g} Pa/m, "
            f"{1000 * largest:.2g} ms is the largest: take a smaller step_s or K_e"
        )
