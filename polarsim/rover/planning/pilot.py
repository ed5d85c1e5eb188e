"""Driver that observes, maps, plans and follows the path; without a path it stops, backs off and plans again."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from polarsim.rover.drive.control import Command, Driver, ReferencePath, SteeringLaw, wrapped
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.localisation.localiser import Localiser
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.perception.observation import MAX_PAN_RAD, Observation, Perception
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.planner import HazardField, Planner, hazard_field

OBSERVATIONS_HZ = 1.0  # observations per second
_LOOK_AHEAD_M = 0.7  # distance of the target point on the path
_WATCHED_M = 2.5  # distance of the point of the plan to which the stereo pair turns
_BACK_M = 0.8  # distance of backing off without a path
_TRIES = 8  # maximum number of times of backing off
_OBSERVATIONS_AT_REST = 2  # observations without a path before the rover backs off: the second may correct the first
_KEPT_M = 2.5  # minimum length of a free plan that is kept
_SAME_PLACE_M = 1.5  # distance from an earlier stop within which the rover backs off farther
_FARTHEST_BACK = 4  # maximum factor of the distance of backing off
_BACK_STEP_M = 0.15  # step between poses of backing off at which clearance is checked
_ROLLS_ON_M = 0.2  # stopping distance after backing off, which must also be free
_ARRIVED_M = 0.3  # distance before the goal's line
_SHOWN_EVERY_S = 4.0  # between stored pictures, to limit memory
_MOVED_M = 0.05  # minimum motion that counts as progress: wheels that spin in place shake the body


@dataclass(frozen=True)
class Stop:
    """Pose at which the rover found no path."""

    time_s: float
    x: float
    y: float
    heading: float


class Pilot(Driver):
    """Driver to the end of a straight line, along planned paths."""

    def __init__(self, path: ReferencePath, perception: Perception, options: AutonomyOptions) -> None:
        super().__init__(path, SteeringLaw(options.speed_m_s, 0.0, 0.0, math.radians(90)))
        self.perception, self.options = perception, options
        self.stops: list[Stop] = []
        self.observations: list[tuple[float, Observation]] = []
        self.given_up = False
        self.travelled = 0.0  # m in any direction, since a detour may cross the line or lead back along it

    def attach(self, simulation: Simulation, localiser: Localiser | None = None) -> None:
        """Attach the driver to a simulation and observe its world; without a localiser its pose is known."""
        self._simulation, self._localiser = simulation, localiser
        self.grid = HazardGrid(simulation.world)
        vehicle = simulation.vehicle
        self.planner = Planner(vehicle.wheel_centres[:, :2], self.options.planner)
        self._wheelbase, self._every = vehicle.wheelbase, 1 / OBSERVATIONS_HZ
        self._next, self._at_rest, self._backed = 0.0, 0, 0
        self._next_shown = 0.0
        self._plan: np.ndarray | None = None
        self._back_to: tuple[float, float] | None = None
        self._back_by, self._back_steer = 0.0, 0.0
        self._last_position: tuple[float, float] | None = None

    @property
    def finished(self) -> bool:
        return self.done >= self.path.length - _ARRIVED_M

    @property
    def headway(self) -> float:
        return self.travelled

    def command(self, x: float, y: float, heading: float) -> Command:
        """Return the command at a pose; observe and plan when due."""
        self.done, self.offset = self.path.along_and_offset(x, y, 0)
        self.heading_error = wrapped(heading - self.path.headings[0])
        self._update_travelled(x, y)
        now = self._simulation.time
        if now >= self._next - 1e-9:
            self._next += self._every
            self._observe(now, x, y, heading)
            if self._localiser is not None:
                x, y, heading = self._localiser.plane_pose  # corrected by the observation
            self._decide(now, x, y, heading)
        self.turning = self._plan is None  # no progress is expected
        if self._back_to is not None:
            if math.hypot(x - self._back_to[0], y - self._back_to[1]) < self._back_by:
                return Command(-self.options.speed_m_s, self._back_steer)
            self._back_to = None
        if self._plan is None:
            return Command()
        return Command(self.options.speed_m_s, self._pursue(self._plan, x, y, heading))

    def field(self) -> HazardField:
        """Return the distances to hazards of the map."""
        options = self.options
        hazards = self.grid.hazards(options.planner.hazard_m)
        return hazard_field(self.grid, hazards, self.grid.hazards(options.planner.clearance_m), self.grid.seen)

    def _update_travelled(self, x: float, y: float) -> None:
        before = self._last_position or (x, y)
        moved = math.hypot(x - before[0], y - before[1])
        if self._last_position is None or moved >= _MOVED_M:
            self.travelled, self._last_position = self.travelled + moved, (x, y)

    def _observe(self, now: float, x: float, y: float, heading: float) -> None:
        self.grid.fade(now)
        observation = self.perception.observe(
            self._simulation.state(),
            self._simulation.ground.level,
            self.grid,
            self._localiser,
            self._pan(x, y, heading),
        )
        for update in observation.updates:
            self.grid.add(update)
        if now < self._next_shown - 1e-9:
            observation = replace(observation, shown=None)
        else:
            self._next_shown = now + _SHOWN_EVERY_S
        self.observations.append((now, observation))

    def _pan(self, x: float, y: float, heading: float) -> float:
        """Return the angle of the plan `_WATCHED_M` ahead, rad to the left; at a stop, one side after the other."""
        if self._plan is None:
            return MAX_PAN_RAD * (-1) ** self._at_rest if self._at_rest else 0.0
        dx, dy = _point_ahead(self._plan, x, y, _WATCHED_M) - [x, y]
        return wrapped(math.atan2(dy, dx) - heading)

    def _decide(self, now: float, x: float, y: float, heading: float) -> None:
        if self._back_to is not None or self.given_up:
            return
        start = time.process_time()
        ground = self.field()
        self._plan = self._still_free(ground, x, y, heading)
        if self._plan is None:
            self._plan = self.planner.plan(ground, x, y, heading, self.path.points[-1])
        self.perception.seconds["plan"] += time.process_time() - start
        if self._plan is not None:
            self._at_rest = 0
            return
        self._at_rest += 1
        if self._at_rest == 1:
            self.stops.append(Stop(now, x, y, heading))
        if self._at_rest > _OBSERVATIONS_AT_REST:
            self._at_rest, self._backed = 0, self._backed + 1
            self.given_up = self._backed > _TRIES
            if not self.given_up:
                self._back_off(ground, x, y, heading)

    def _still_free(self, ground: HazardField, x: float, y: float, heading: float) -> np.ndarray | None:
        """Return the rest of the plan if it is free, and long enough or ends at the goal; otherwise None."""
        if self._plan is None:
            return None
        rest = self._plan[_nearest(self._plan, x, y) :]
        length = float(np.hypot(*np.diff(rest[:, :2], axis=0).T).sum())
        near_goal = np.hypot(*(rest[-1, :2] - self.path.points[-1])) < 2 * _ARRIVED_M
        if (length < _KEPT_M and not near_goal) or len(rest) < 2:
            return None
        return rest if self.planner.free(ground, rest[1:], np.array([x, y, heading])).all() else None

    def _back_off(self, ground: HazardField, x: float, y: float, heading: float) -> None:
        """Back off along the freest of three arcs, farther at places of earlier stops, to make room for a new path."""
        stops_here = sum(math.hypot(stop.x - x, stop.y - y) < _SAME_PLACE_M for stop in self.stops)
        farther = min(max(stops_here, 1), _FARTHEST_BACK)
        for times in range(farther, 0, -1):
            if self._free_arc_back(ground, x, y, heading, times * _BACK_M):
                self._back_to = (x, y)
                return

    def _free_arc_back(self, ground: HazardField, x: float, y: float, heading: float, distance: float) -> bool:
        """Choose the freest of three arcs of this length; return whether it is free."""
        best, limit = -np.inf, 0.5 * self.options.planner.curvature_1_m
        count = math.ceil((distance + _ROLLS_ON_M) / _BACK_STEP_M)
        for curvature in (0.0, limit, -limit):
            steps = -np.linspace(0.1, distance + _ROLLS_ON_M, count)
            chord = heading + curvature * steps / 2
            poses = np.column_stack([x + steps * np.cos(chord), y + steps * np.sin(chord), heading + curvature * steps])
            room = float(self.planner.clearance(ground, poses).min())
            if room > best + 1e-9:
                best, self._back_steer = room, self._steer(curvature)
        self._back_by = distance
        return best > self.planner.required_room(ground, np.array([x, y, heading]))

    def _pursue(self, plan: np.ndarray, x: float, y: float, heading: float) -> float:
        """Return the steering angle of pure pursuit to the look-ahead point (Coulter, CMU-RI-TR-92-01)."""
        dx, dy = _point_ahead(plan, x, y, _LOOK_AHEAD_M) - [x, y]
        left = -math.sin(heading) * dx + math.cos(heading) * dy
        return self._steer(2 * left / max(dx * dx + dy * dy, 0.04))

    def _steer(self, curvature: float) -> float:
        """Return the steering angle for a curvature, clipped to the maximum."""
        limit = self.options.planner.curvature_1_m
        return math.atan(min(max(curvature, -limit), limit) * self._wheelbase / 2)


def _nearest(plan: np.ndarray, x: float, y: float) -> int:
    return int(np.argmin(np.hypot(plan[:, 0] - x, plan[:, 1] - y)))


def _point_ahead(plan: np.ndarray, x: float, y: float, distance: float) -> np.ndarray:
    """Return the first point (2,) of the rest of a plan at a distance from a position, or the end of the plan."""
    rest = plan[_nearest(plan, x, y) :, :2]
    farther = np.flatnonzero(np.hypot(*(rest - [x, y]).T) >= distance)
    return np.asarray(rest[farther[0]] if len(farther) else rest[-1])
