"""From a place beside a path to a command, and from a command to four wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from polarsim.rover.vehicle import Vehicle

STRAIGHT = 1e-6  # rad: a smaller steering angle is none
Mode = Literal["drive", "crab", "turn"]
MODES: tuple[Mode, ...] = ("drive", "crab", "turn")
Steering = Literal["ackermann", "crab", "combined"]


@dataclass(frozen=True)
class Command:
    """What a rover is told.

    drive : the body moves at `speed_m_s`, `crab_rad` to the left of ahead, and turns: `steer_rad` is the angle at which
        a wheel midway between the front ones stands without crab, the rear ones steer the other way (as in the paper's
        demo).
    crab : all wheels point `steer_rad` to the left and the body moves that way without turning.
    turn : the body turns on the spot, leftwards where the speed, that of a wheel's rim, is positive.
    """

    speed_m_s: float = 0.0
    steer_rad: float = 0.0
    mode: Mode = "drive"
    crab_rad: float = 0.0


def wheel_commands(command: Command, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Steering angles (4,), rad, and speeds of the rims (4,), m/s, at which no wheel has to slide sideways."""
    limit = math.radians(vehicle.steering.limit_deg)
    places = vehicle.wheel_centres[:, :2]
    if command.mode == "crab":
        return np.full(4, np.clip(command.steer_rad, -limit, limit)), np.full(4, command.speed_m_s)
    if command.mode == "turn":
        angles = np.arctan2(places[:, 0], -places[:, 1])  # across the line to the middle
        speeds = np.full(4, command.speed_m_s)
    elif command.crab_rad:
        turn = 2 * math.tan(command.steer_rad) / vehicle.wheelbase  # rad per metre
        along = math.cos(command.crab_rad) - turn * places[:, 1]
        across = math.sin(command.crab_rad) + turn * places[:, 0]
        angles, speeds = np.arctan2(across, along), command.speed_m_s * np.hypot(along, across)
    elif abs(command.steer_rad) < STRAIGHT:
        return np.zeros(4), np.full(4, command.speed_m_s)
    else:
        # All axles point at one point beside the middle, where the front's and the rear's meet.
        radius = vehicle.wheelbase / 2 / math.tan(command.steer_rad)
        to_left = radius - places[:, 1]
        angles = np.arctan2(places[:, 0] * np.sign(radius), to_left * np.sign(radius))
        speeds = command.speed_m_s * np.hypot(places[:, 0], to_left) / abs(radius)
    # A wheel that would have to turn by more than a quarter runs backwards instead.
    back = np.abs(angles) > math.pi / 2 + 1e-9
    angles = np.where(back, angles - math.pi * np.sign(angles), angles)
    return np.clip(angles, -limit, limit), np.where(back, -speeds, speeds)


@dataclass(frozen=True)
class Path:
    """Straight lines through points (n, 2) of the world."""

    points: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        """(n - 1,) m of each line."""
        return np.asarray(np.hypot(*np.diff(self.points, axis=0).T))

    @property
    def length(self) -> float:
        return float(self.lengths.sum())

    @property
    def headings(self) -> np.ndarray:
        """(n - 1,) rad from x towards y."""
        steps = np.diff(self.points, axis=0)
        return np.asarray(np.arctan2(steps[:, 1], steps[:, 0]))

    def beside(self, x: float, y: float, line: int) -> tuple[float, float]:
        """How far along a line a place lies, m from its first point, and how far to its left."""
        step = (self.points[line + 1] - self.points[line]) / self.lengths[line]
        dx, dy = x - self.points[line, 0], y - self.points[line, 1]
        return float(dx * step[0] + dy * step[1]), float(step[0] * dy - step[1] * dx)


@dataclass(frozen=True)
class Law:
    """How a driver steers; see `options.DriveOptions`."""

    speed: float
    gain: float
    heading_gain: float
    limit: float
    steering: Steering = "ackermann"
    integral_gain: float = 0.0
    drift_limit: float = math.radians(10)
    turn_above: float = math.radians(45)
    turned: float = math.radians(2)  # a turn on the spot ends this near to the next line


@dataclass
class Driver:
    """Follows a path line by line.

    It remembers `line`, `turning`, `done` and `drift`: the angle held against what pushes it aside all the time.
    """

    path: Path
    law: Law
    line: int = 0
    turning: bool = False
    offset: float = 0.0
    heading_error: float = 0.0
    done: float = 0.0  # m along the path
    drift: float = 0.0  # rad

    @property
    def finished(self) -> bool:
        return self.done >= self.path.length

    def command(self, x: float, y: float, heading: float) -> Command:
        """What to do here; also notes how far off the path this is."""
        along, self.offset = self.path.beside(x, y, self.line)
        while along >= self.path.lengths[self.line] and self.line + 1 < len(self.path.lengths):
            bend = wrapped(self.path.headings[self.line + 1] - self.path.headings[self.line])
            self.line += 1
            self.turning = self.law.steering != "crab" and abs(bend) > self.law.turn_above
            along, self.offset = self.path.beside(x, y, self.line)
        done = float(self.path.lengths[: self.line].sum()) + along
        headway, self.done = max(done - self.done, 0.0), done
        self.heading_error = wrapped(heading - float(self.path.headings[self.line]))
        if self.turning:
            if abs(self.heading_error) > self.law.turned:
                return Command(-math.copysign(self.law.speed, self.heading_error), 0.0, "turn")
            self.turning = False
        law = self.law
        self.drift = _within(self.drift - law.integral_gain * self.offset * headway, law.drift_limit)
        aim = self.drift - law.gain * self.offset
        turn = -law.heading_gain * self.heading_error
        if law.steering == "crab":
            return Command(law.speed, _within(aim - self.heading_error, math.pi / 2), "crab")
        if law.steering == "combined":
            # Crab leads back to the line at once, without a swing; the bend keeps the rover pointing along it.
            crab = _within(_within(aim, law.limit) - self.heading_error, law.limit)
            return Command(law.speed, _within(turn, law.limit), "drive", crab)
        return Command(law.speed, _within(aim + turn, law.limit), "drive")


def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def wrapped(angle: float) -> float:
    """The same angle between -pi and pi."""
    return math.remainder(angle, 2 * math.pi)
