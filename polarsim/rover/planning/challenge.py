"""A drive's map by the rules of NASA's Lunar Autonomy Challenge (2025), as its public leaderboard code has them.

A cell's height is the mean of what 16 rays from above meet in it, ground or rock; it is a rock cell where any of them
meets a rock. The challenge scores the whole of its square of 15 cm cells; here it is the corridor along the straight
line. Its 150 points of localisation say only that no fiducials were used, as here: what odometry is worth, errors of
its trajectory tell. Of 1000 points, 300 go to heights, 300 to rocks, 250 to productivity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.rover.perception.cells import by_cells, part_centres, true_surface
from polarsim.rover.world.surface import World

GEOMETRY, ROCKS, PRODUCTIVITY, LOCALISATION = 300.0, 300.0, 250.0, 150.0
HEIGHT_M = 0.05
FULL_RATE_1_S = 180 * 180 / (24 * 3600)  # cells a second for all points of productivity: its square in its mission time
_RAYS = 4  # along a side of a cell


@dataclass(frozen=True)
class Points:
    """Of the challenge; NaN rocks where there is no rock cell to be found."""

    geometry: float
    rocks: float
    productivity: float
    localisation: float = LOCALISATION


def true_cells(world: World, x: np.ndarray, y: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) heights, m, and rock flags of a world's cells with centres at x (columns,) and y (rows,)."""
    gx, gy = np.meshgrid(*(part_centres(values, cell_m, _RAYS) for values in (x, y)))
    ground, rock = true_surface(world, gx, gy)
    meets_rock = by_cells(rock > ground, _RAYS).any(axis=(1, 3))
    return np.asarray(by_cells(np.maximum(rock, ground), _RAYS).mean(axis=(1, 3))), np.asarray(meets_rock)


def points(
    height: np.ndarray,
    rock: np.ndarray,
    true_height: np.ndarray,
    true_rock: np.ndarray,
    counted: np.ndarray,
    seconds: float,
) -> Points:
    """Of a map (rows, columns): heights, m, NaN where unknown, and rock flags; `counted`: the cells that count.

    An unknown height is wrong, an unknown rock is none; a cell is mapped where its height is known.
    """
    near = np.abs(np.where(np.isfinite(height), height, np.inf) - true_height) < HEIGHT_M
    right = int((rock & true_rock & counted).sum())
    wrong = int(((rock != true_rock) & counted).sum())
    rate = float((np.isfinite(height) & counted).sum()) / seconds if seconds else 0.0
    return Points(
        GEOMETRY * float(near[counted].mean()) if counted.any() else 0.0,
        ROCKS * 2 * right / (2 * right + wrong) if (true_rock & counted).any() else float("nan"),
        PRODUCTIVITY * min(rate / FULL_RATE_1_S, 1.0),
    )
