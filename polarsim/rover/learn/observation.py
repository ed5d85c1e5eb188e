"""Observation of a learner: a crop of the map around the rover, and a state vector.

`hazards` is (3, n, n) uint8 with the rover's heading up: probability of rock, height of the rock, and whether the cell
was observed. `state` contains the values of `STATE`, each clipped to its bounds.
"""

from __future__ import annotations

import math

import numpy as np

from polarsim.rover.drive.control import ReferencePath, wrapped
from polarsim.rover.drive.state import RoverState
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.vehicle.table import WHEELS

HIGHEST_M = 0.5  # height of a rock at full scale
CELLS, AHEAD_M = 48, 5.4  # cells along each side of the crop, and its extent ahead of base_link, m
# Values of `state` and their symmetric bounds: metres, radians, seconds.
STATE: dict[str, float] = {
    "goal_distance": 1000.0, "sin_goal_bearing": 1.0, "cos_goal_bearing": 1.0,  # bearing from the heading to the left
    "to_go": 1000.0, "offset": 1000.0,  # along the straight line, and to the left of it
    "sin_heading_error": 1.0, "cos_heading_error": 1.0,
    "speed": 5.0, "yaw_rate": 10.0, "roll": math.pi, "pitch": math.pi,
    "command_speed": 2.0, "command_steer": math.pi / 2,
    **{f"{code}_slip": 10.0 for code in WHEELS},
    "look_age": 1000.0,  # since the last observation
}  # fmt: skip


def crop(grid: HazardGrid, state: RoverState) -> np.ndarray:
    """Return (3, n, n) uint8 of the map's nearest cells; points outside the map are full-scale rock."""
    cell = grid.cell_m
    ahead = AHEAD_M - cell * (np.arange(CELLS) + 0.5)
    left = cell * (CELLS / 2 - 0.5 - np.arange(CELLS))
    u, v = ahead[:, None], left[None, :]
    cos, sin = math.cos(state.heading), math.sin(state.heading)
    column = np.floor((state.position[0] + cos * u - sin * v - grid.x[0]) / cell + 0.5).astype(int)
    row = np.floor((state.position[1] + sin * u + cos * v - grid.y[0]) / cell + 0.5).astype(int)
    on = (column >= 0) & (column < len(grid.x)) & (row >= 0) & (row < len(grid.y))
    at = row.clip(0, len(grid.y) - 1), column.clip(0, len(grid.x) - 1)
    layers = 1 / (1 + np.exp(-grid.log_odds)), grid.height / HIGHEST_M, grid.seen
    crops = [np.where(on, np.asarray(layer, float)[at], 1.0) for layer in layers]
    return np.rint(255 * np.clip(crops, 0.0, 1.0)).astype(np.uint8)


def observation_values(state: RoverState, line: ReferencePath, look_age_s: float) -> np.ndarray:
    """Return (len(STATE),) float32 for a state and a straight line."""
    x, y, heading = float(state.position[0]), float(state.position[1]), state.heading
    along, offset = line.along_and_offset(x, y, 0)
    dx, dy = (line.points[-1] - (x, y)).tolist()
    bearing, error = math.atan2(dy, dx) - heading, wrapped(heading - line.headings[0])
    roll, pitch = state.tilt
    values = [
        math.hypot(dx, dy), math.sin(bearing), math.cos(bearing), line.length - along, offset,
        math.sin(error), math.cos(error),
        state.velocity[0] * math.cos(heading) + state.velocity[1] * math.sin(heading), state.spin[2], roll, pitch,
        state.command.speed_m_s, state.command.steer_rad, *state.wheel("slip"), look_age_s,
    ]  # fmt: skip
    bounds = np.array(list(STATE.values()))
    return np.clip(np.nan_to_num(values), -bounds, bounds).astype(np.float32)
