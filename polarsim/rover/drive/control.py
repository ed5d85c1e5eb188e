"""Path following: from a position to a command, and from a command to angles and speeds of four wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

STRAIGHT = 1e-6  # rad; smaller steering angles count as zero
DRIFT_LIMIT = math.radians(10)  # maximum angle that compensates a steady lateral drift
TURN_ABOVE = math.radians(45)  # sharper corners are turned on the spot
TURN_TOLERANCE = math.radians(2)  # a turn on the spot ends within this angle of the next segment's heading
Mode = Literal["drive", "crab", "turn"]
Steering = Literal["ackermann", "crab", "combined"]


@dataclass(frozen=True)
class Command:
    """Motion command.

    drive : the body moves at `speed_m_s`, `crab_rad` to the left of forward, and turns. `steer_rad` is the steering
        angle of a virtual wheel midway between the front wheels without crab; rear wheels steer in the opposite
        direction (as in the paper's demo).
    crab : all wheels point `steer_rad` to the left and the body moves in this direction without turning.
    turn : the body turns on the spot, to the left if `speed_m_s`, the speed of a wheel's rim, is positive.
    """

    speed_m_s: float = 0.0
    steer_rad: float = 0.0
    mode: Mode = "drive"
    crab_rad: float = 0.0


def steer(
    command: Command, wheels: list[tuple[float, float]], wheelbase: float, limit: float
) -> tuple[list[float], list[float]]:
    """Return steering angles, rad, and rim speeds, m/s, at which no wheel slides sideways.

    `wheels`: x, y in base_link, as Python numbers, since arrays of four elements are slower.
    """
    speed = command.speed_m_s
    if command.mode == "crab":
        return [_within(command.steer_rad, limit)] * len(wheels), [speed] * len(wheels)
    if command.mode == "turn":
        angles = [math.atan2(x, -y) for x, y in wheels]  # perpendicular to the line to the centre
        speeds = [speed] * len(wheels)
    elif command.crab_rad:
        curvature = 2 * math.tan(command.steer_rad) / wheelbase  # rad per metre
        ways = [
            (math.cos(command.crab_rad) - curvature * y, math.sin(command.crab_rad) + curvature * x) for x, y in wheels
        ]
        angles = [math.atan2(across, along) for along, across in ways]
        speeds = [speed * math.hypot(along, across) for along, across in ways]
    elif abs(command.steer_rad) < STRAIGHT:
        return [0.0] * len(wheels), [speed] * len(wheels)
    else:
        # All axles point at a common point at the side, the intersection of the front and rear axle lines.
        radius = wheelbase / 2 / math.tan(command.steer_rad)
        side = math.copysign(1.0, radius)
        angles = [math.atan2(x * side, (radius - y) * side) for x, y in wheels]
        speeds = [speed * math.hypot(x, radius - y) / abs(radius) for x, y in wheels]
    # A wheel with an angle above 90 degrees runs backwards instead.
    back = [abs(angle) > math.pi / 2 + 1e-9 for angle in angles]
    angles = [angle - math.copysign(math.pi, angle) if far else angle for angle, far in zip(angles, back, strict=True)]
    return [_within(angle, limit) for angle in angles], [-v if far else v for v, far in zip(speeds, back, strict=True)]


@dataclass(frozen=True)
class ReferencePath:
    """Polyline through points (n, 2) of the world."""

    points: np.ndarray

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """(n - 1,) m of each line segment."""
        return tuple(np.hypot(*np.diff(self.points, axis=0).T).tolist())

    @cached_property
    def length(self) -> float:
        return float(sum(self.lengths))

    @cached_property
    def headings(self) -> tuple[float, ...]:
        """(n - 1,) rad from x towards y."""
        steps = np.diff(self.points, axis=0)
        return tuple(np.arctan2(steps[:, 1], steps[:, 0]).tolist())

    @cached_property
    def _lines(self) -> list[tuple[float, float, float, float]]:
        """Start point and unit direction of each line segment."""
        steps = np.diff(self.points, axis=0) / np.array(self.lengths)[:, None]
        return [(*point, *step) for point, step in zip(self.points[:-1].tolist(), steps.tolist(), strict=True)]

    def along_and_offset(self, x: float, y: float, segment: int) -> tuple[float, float]:
        """Return the distance along a segment, m from its start, and the offset to the left, m."""
        from_x, from_y, along, across = self._lines[segment]
        dx, dy = x - from_x, y - from_y
        return dx * along + dy * across, along * dy - across * dx


@dataclass(frozen=True)
class SteeringLaw:
    """Parameters of path following; see `options.DriveOptions`."""

    speed: float
    gain: float
    heading_gain: float
    limit: float
    steering: Steering = "ackermann"
    integral_gain: float = 0.0


@dataclass
class Driver:
    """Follow a path segment by segment.

    State: `line`, `turning`, `done` and `drift`, the angle that compensates a steady lateral drift.
    """

    path: ReferencePath
    law: SteeringLaw
    line: int = 0
    turning: bool = False
    offset: float = 0.0
    heading_error: float = 0.0
    done: float = 0.0  # m along the path
    drift: float = 0.0  # rad

    @property
    def finished(self) -> bool:
        return self.done >= self.path.length

    @property
    def headway(self) -> float:
        """Progress, m; a rover without progress is stuck."""
        return self.done

    def command(self, x: float, y: float, heading: float) -> Command:
        """Return the command at a position and update the offset from the path."""
        along, self.offset = self.path.along_and_offset(x, y, self.line)
        while along >= self.path.lengths[self.line] and self.line + 1 < len(self.path.lengths):
            bend = wrapped(self.path.headings[self.line + 1] - self.path.headings[self.line])
            self.line += 1
            self.turning = self.law.steering != "crab" and abs(bend) > TURN_ABOVE
            along, self.offset = self.path.along_and_offset(x, y, self.line)
        done = sum(self.path.lengths[: self.line]) + along
        headway, self.done = max(done - self.done, 0.0), done
        self.heading_error = wrapped(heading - self.path.headings[self.line])
        if self.turning:
            if abs(self.heading_error) > TURN_TOLERANCE:
                return Command(-math.copysign(self.law.speed, self.heading_error), 0.0, "turn")
            self.turning = False
        law = self.law
        self.drift = _within(self.drift - law.integral_gain * self.offset * headway, DRIFT_LIMIT)
        aim = self.drift - law.gain * self.offset
        correction = -law.heading_gain * self.heading_error
        if law.steering == "crab":
            return Command(law.speed, _within(aim - self.heading_error, math.pi / 2), "crab")
        if law.steering == "combined":
            # Crab returns to the line at once, without oscillation; steering keeps the body parallel to the line.
            crab = _within(_within(aim, law.limit) - self.heading_error, law.limit)
            return Command(law.speed, _within(correction, law.limit), "drive", crab)
        return Command(law.speed, _within(aim + correction, law.limit), "drive")


def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def wrapped(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return math.remainder(angle, 2 * math.pi)
