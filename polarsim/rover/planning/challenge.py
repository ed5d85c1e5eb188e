"""Score of a drive's map by the rules of NASA's Lunar Autonomy Challenge (2025), as in the public leaderboard code.

The height of a cell is the mean over 16 vertical rays of the first hit on ground or rock; the cell is rock if a ray
hits a rock. The challenge scores a complete square of 15 cm cells; here only cells of the corridor along the straight
line are scored. The 150 points for localisation are given in full, since no fiducials are used; for the accuracy of
odometry see `trajectory`. Of 1000 points, 300 are for heights, 300 for rocks, 250 for productivity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.rover.perception.ground_view import by_cells, part_centres, true_surface
from polarsim.rover.world.surface import World

GEOMETRY, ROCKS, PRODUCTIVITY, LOCALISATION = 300.0, 300.0, 250.0, 150.0
HEIGHT_M = 0.05
FULL_RATE_1_S = (
    180 * 180 / (24 * 3600)
)  # cells per second for full productivity: the challenge's square in its mission time
_RAYS = 4  # rays along a side of a cell


@dataclass(frozen=True)
class ChallengeScore:
    """Points of the challenge; `rocks` is NaN if there is no true rock cell."""

    geometry: float
    rocks: float
    productivity: float
    localisation: float = LOCALISATION


def true_cells(world: World, x: np.ndarray, y: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return heights (rows, columns), m, and rock flags of cells with centres at x (columns,) and y (rows,)."""
    gx, gy = np.meshgrid(*(part_centres(values, cell_m, _RAYS) for values in (x, y)))
    ground, rock = true_surface(world, gx, gy)
    meets_rock = by_cells(rock > ground, _RAYS).any(axis=(1, 3))
    return np.asarray(by_cells(np.maximum(rock, ground), _RAYS).mean(axis=(1, 3))), np.asarray(meets_rock)


def challenge_score(
    height: np.ndarray,
    rock: np.ndarray,
    true_height: np.ndarray,
    true_rock: np.ndarray,
    counted: np.ndarray,
    seconds: float,
) -> ChallengeScore:
    """Return the points of a map (rows, columns): heights, m, NaN where unknown, and rock flags.

    `counted`: cells that are scored. An unknown height is wrong, an unknown rock means no rock; a cell is mapped if its
    height is known.
    """
    near = np.abs(np.where(np.isfinite(height), height, np.inf) - true_height) < HEIGHT_M
    right = int((rock & true_rock & counted).sum())
    wrong = int(((rock != true_rock) & counted).sum())
    rate = float((np.isfinite(height) & counted).sum()) / seconds if seconds else 0.0
    return ChallengeScore(
        GEOMETRY * float(near[counted].mean()) if counted.any() else 0.0,
        ROCKS * 2 * right / (2 * right + wrong) if (true_rock & counted).any() else float("nan"),
        PRODUCTIVITY * min(rate / FULL_RATE_1_S, 1.0),
    )
