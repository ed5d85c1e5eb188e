"""Collisions of a running simulation, counted as in `planning.touches` for recorded drives."""

from __future__ import annotations

import numpy as np

from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import RoverState
from polarsim.rover.drive.trace import trace_table
from polarsim.rover.planning.contacts import REACH_M, body_touch, rock_surface_points
from polarsim.schemas.rover import HIGH_M


class Collisions:
    """Rocks above `HIGH_M` of a world that the rover touches."""

    def __init__(self, simulation: Simulation) -> None:
        world = simulation.world
        high = world.rocks[world.rocks["height_m"] > HIGH_M]
        self._simulation, self._steps = simulation, simulation.steps
        self._rocks, self._radii = high["rock"].to_numpy(int), high["radius_m"].to_numpy(float)
        self._places = high[["x_m", "y_m"]].to_numpy(float)
        self._points: dict[int, np.ndarray] = {}  # of rocks near the rover's path
        self.touched: frozenset[int] = frozenset()

    def update(self, state: RoverState) -> frozenset[int]:
        """Return the numbers of the rocks touched since the last call and not at the last call.

        Wheel contacts include all physics steps since the last call; body contacts are computed for the current state.
        """
        by_wheels = self._simulation.rocks_touched_since(self._steps) & frozenset(self._rocks.tolist())
        self._steps = self._simulation.steps
        distance = np.hypot(*(self._places - state.position[:2]).T)
        near = self._rocks[distance < self._radii + REACH_M].tolist()
        touched = by_wheels | frozenset(rock for rock in near if self._touches_body(rock, state))
        new, self.touched = touched - self.touched, touched
        return new

    def _touches_body(self, rock: int, state: RoverState) -> bool:
        if rock not in self._points:
            self._points[rock] = rock_surface_points(self._simulation.world, rock)
        table = trace_table(state.row(0.0, 0.0))
        return bool(body_touch(table, self._simulation.vehicle, self._points[rock], np.zeros(1, int)))
