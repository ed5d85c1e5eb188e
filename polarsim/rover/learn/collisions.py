"""Which rocks a rover that drives now touches: as drives that are over count them, moment by moment."""

from __future__ import annotations

import numpy as np

from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import State
from polarsim.rover.drive.trace import trace_table
from polarsim.rover.planning.touches import REACH_M, body_touch, surface_points
from polarsim.schemas.rover import HIGH_M


class Collisions:
    """Rocks above `HIGH_M` of a world: those that are touched, and those that were not a moment before."""

    def __init__(self, simulation: Simulation) -> None:
        world = simulation.world
        high = world.rocks[world.rocks["height_m"] > HIGH_M]
        self._simulation, self._steps = simulation, simulation.steps
        self._rocks, self._radii = high["rock"].to_numpy(int), high["radius_m"].to_numpy(float)
        self._places = high[["x_m", "y_m"]].to_numpy(float)
        self._points: dict[int, np.ndarray] = {}  # of rocks that the rover came near
        self.touched: frozenset[int] = frozenset()

    def update(self, state: State) -> frozenset[int]:
        """Return the numbers of the rocks that were touched since the last call and not before it.

        By wheels at any physics step since then, by the body now.
        """
        by_wheels = self._simulation.rocks_touched_since(self._steps) & frozenset(self._rocks.tolist())
        self._steps = self._simulation.steps
        away = np.hypot(*(self._places - state.position[:2]).T)
        near = self._rocks[away < self._radii + REACH_M].tolist()
        touched = by_wheels | frozenset(rock for rock in near if self._touches_body(rock, state))
        new, self.touched = touched - self.touched, touched
        return new

    def _touches_body(self, rock: int, state: State) -> bool:
        if rock not in self._points:
            self._points[rock] = surface_points(self._simulation.world, rock)
        table = trace_table(state.row(0.0, 0.0))
        return bool(body_touch(table, self._simulation.vehicle, self._points[rock], np.zeros(1, int)))
