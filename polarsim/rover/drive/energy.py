"""Energy balance of a drive, which detects time steps that are too long."""

from __future__ import annotations

import math
from typing import NamedTuple

from polarsim.errors import RoverError
from polarsim.rover.soil.law import ContactLaw
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import Vehicle

MAX_PHASE_RAD = 1.0  # maximum phase, rad per step, of the stiffest oscillation: a wheel on elastic soil
BOUND = 0.02  # maximum share of missing energy; a valid drive misses at most 0.0007
MIN_INPUT_J = 5.0  # J; minimum input for which a share is computed
# A few metres of drive: minimum denominator of the check, since settling wheels cause small errors.
MIN_CHECKED_J = 100.0


class EnergyError(RoverError):
    """The energy balance does not close, so the drive is invalid."""


class Account(NamedTuple):
    """Energy since `Simulation.zero`, J; wheels in the order of `WHEELS`."""

    motor: float  # work of drives and steering servos
    soil: float  # dissipated by soil
    damper: float  # dissipated by dampers
    rock: float  # dissipated by rocks and joint stops
    driving: float  # sum of absolute work of the drives
    motor_of: tuple[float, ...]
    soil_of: tuple[float, ...]
    change: float  # change of kinetic and potential energy

    @property
    def missing(self) -> float:
        """Energy that is unaccounted for, J."""
        return self.motor - self.soil - self.damper - self.rock - self.change

    @property
    def put_in(self) -> float:
        """Input of the drives, plus the decrease of kinetic and potential energy, J."""
        return self.driving + max(-self.change, 0.0)

    @property
    def open(self) -> float:
        """`missing` as a share of `put_in`; 0 while the input is small."""
        return self.missing / self.put_in if self.put_in > MIN_INPUT_J else 0.0


def require_closed(account: Account, time: float) -> None:
    """Raise `EnergyError` if more than `BOUND` of the energy is unaccounted for."""
    whole = max(account.put_in, MIN_CHECKED_J)
    if not abs(account.missing) <= BOUND * whole:  # true for NaN
        raise EnergyError(
            f"at {time:.2f} s {100 * account.missing / whole:.2g} % of the energy is missing, at most "
            f"{100 * BOUND:.2g} % were expected: use a smaller step_s or a softer soil"
        )


def largest_step(vehicle: Vehicle, law: ContactLaw, gravity: float) -> float:
    """Return the longest time step, s, that resolves the oscillation of a wheel on elastic soil.

    The contact patch is that of a wheel at rest: by Bekker's law with n = 1 its sinkage is
    (3 W / (2 b K sqrt(2 R)))^(2/3). The demo's soil has a limit of 2.7 ms (8.4 ms at a tenth of the elastic
    stiffness); drives are valid at 2 (5) ms and gain energy at 4 ms.
    """
    steps = []
    for wheel in vehicle.wheels:
        load = vehicle.mass * gravity / len(vehicle.wheels)
        stiffness = law.K_c / wheel.width_m + law.K_phi
        sunk = (1.5 * load / (wheel.width_m * stiffness * math.sqrt(2 * wheel.outer_radius_m))) ** (2 / 3)
        area = wheel.width_m * math.sqrt(2 * wheel.outer_radius_m * sunk)
        unsprung = wheel.mass_kg + wheel.arm_mass_kg + wheel.upright_mass_kg
        steps.append(MAX_PHASE_RAD / math.sqrt(law.K_e * area / unsprung))
    return min(steps)


def require_small_step(vehicle: Vehicle, law: ContactLaw, options: SoilOptions) -> None:
    """Raise `RoverError` if the time step is too large for the soil's elastic stiffness."""
    largest = largest_step(vehicle, law, options.gravity_m_s2)
    if options.step_s > largest:
        raise RoverError(
            f"a step of {1000 * options.step_s:g} ms is too large for an elastic stiffness of {law.K_e:.3g} Pa/m, "
            f"{1000 * largest:.2g} ms is the largest: use a smaller step_s or K_e"
        )
