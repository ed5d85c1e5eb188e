"""Initial pose and current state of a rover, and the margin to the edge of the ground."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from polarsim.errors import RoverError
from polarsim.rover.drive.control import Command
from polarsim.rover.drive.trace import BODY_COLUMNS, COLUMNS, CONTACTS, WHEEL_COLUMNS, Trace
from polarsim.rover.vehicle.table import WHEELS

EDGE_MARGIN_M = 0.05  # minimum distance of wheels from the edge of the ground, m


class OffGridError(RoverError):
    """A wheel is too close to the edge of the ground."""


@dataclass(frozen=True)
class Start:
    """Initial pose: position of base_link and heading from x towards y."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True)
class RoverState:
    """State of a rover at a time; arrays of wheels are in the order of `WHEELS`."""

    time: float  # s
    position: np.ndarray  # (3,) of base_link in the world
    rotation: np.ndarray  # (4,) quaternion w x y z, world from base_link
    velocity: np.ndarray  # (3,) world
    spin: np.ndarray  # (3,) base_link
    acceleration: np.ndarray  # (3,) reading of an accelerometer in base_link
    command: Command
    energy_open: float
    wheels: np.ndarray  # (4, len(WHEEL_COLUMNS)) wheel columns of the trace, contacts as indices in `CONTACTS`

    @property
    def heading(self) -> float:
        """Heading from x towards y."""
        return heading_of(self.rotation)

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll (left side up) and pitch (nose down), rad."""
        w, x, y, z = self.rotation
        return math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(np.clip(2 * (w * y - z * x), -1, 1))

    @property
    def upside_down(self) -> bool:
        """Whether base_link's z axis points downwards."""
        _, x, y, _ = self.rotation
        return bool(1 - 2 * (x * x + y * y) < 0)

    def wheel(self, column: str) -> np.ndarray:
        """Return (4,) values of a column of `WHEEL_COLUMNS`."""
        return np.asarray(self.wheels[:, WHEEL_COLUMNS.index(column)])

    def row(self, offset: float, heading_error: float) -> np.ndarray:
        """Return (len(COLUMNS),) values for the trace."""
        body = (
            self.time, *self.position, *self.rotation, *self.velocity, *self.spin, *self.acceleration,
            offset, heading_error, self.command.speed_m_s, self.command.steer_rad, self.command.crab_rad,
            self.energy_open,
        )  # fmt: skip
        row = np.concatenate([body, self.wheels.ravel()])
        assert len(row) == len(COLUMNS)
        return row


def recorded_states(trace: Trace) -> Iterator[RoverState]:
    """Yield the states in the rows of a trace."""
    contacts = {f"{code}_contact": list(CONTACTS).index for code in WHEELS}
    numbers = trace.table.assign(**{name: trace.table[name].map(index) for name, index in contacts.items()})
    split = np.cumsum([1, 3, 4, 3, 3, 3])
    for row in numbers[list(COLUMNS)].to_numpy(float):
        body = dict(zip(BODY_COLUMNS, row.tolist(), strict=False))
        _, position, rotation, velocity, spin, acceleration, _ = np.split(row, split)
        command = Command(body["command_speed_m_s"], body["command_steer_rad"], crab_rad=body["command_crab_rad"])
        wheels = row[len(BODY_COLUMNS) :].reshape(len(WHEELS), len(WHEEL_COLUMNS))
        yield RoverState(
            body["time_s"], position, rotation, velocity, spin, acceleration, command, body["energy_open"], wheels
        )


def heading_of(rotation: np.ndarray) -> float:
    """Return the heading, from x towards y, of a quaternion w x y z."""
    w, x, y, z = rotation
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
