"""Which rocks a rover that drives now touches: the measure of drives that are over, moment by moment."""

from __future__ import annotations

import numpy as np

from polarsim.formats.schemas import HIGH_M
from polarsim.rover.autonomy.touches import REACH_M, TOUCH_M, least_gap, surface_points
from polarsim.rover.drive.state import State
from polarsim.rover.drive.trace import trace_table
from polarsim.rover.vehicle.table import Vehicle
from polarsim.rover.world.surface import World


class Collisions:
    """Rocks above `HIGH_M` of a world: those that are touched, and those that were not a moment before."""

    def __init__(self, world: World, vehicle: Vehicle) -> None:
        high = world.rocks[world.rocks["height_m"] > HIGH_M]
        self._world, self._vehicle = world, vehicle
        self._rocks, self._radii = high["rock"].to_numpy(int), high["radius_m"].to_numpy(float)
        self._places = high[["x_m", "y_m"]].to_numpy(float)
        self._points: dict[int, np.ndarray] = {}  # of rocks that the rover came near
        self.touched: frozenset[int] = frozenset()

    def update(self, state: State) -> frozenset[int]:
        """Numbers of the rocks that are touched now and were not at the last call."""
        away = np.hypot(*(self._places - state.position[:2]).T)
        near = self._rocks[away < self._radii + REACH_M].tolist()
        touched = frozenset(rock for rock in near if self._gap(rock, state) <= TOUCH_M)
        new, self.touched = touched - self.touched, touched
        return new

    def _gap(self, rock: int, state: State) -> float:
        if rock not in self._points:
            self._points[rock] = surface_points(self._world, rock)
        table = trace_table(state.row(0.0, 0.0))
        return least_gap(table, self._vehicle, self._points[rock], np.zeros(1, int))[1]
