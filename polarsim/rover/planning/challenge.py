"""Score of a drive by the rules of NASA's Lunar Autonomy Challenge (2025), 1000 points.

Rules of the public leaderboard code (`leaderboard/utils/constants.py`, `statistics/statistics_manager.py`), cells of 15
cm:

- geometric map, 300: share of the cells whose height is known and less than 5 cm from the true height;
- rock map, 300: F1 of the cells with a rock; a cell without an answer counts as a cell without a rock;
- productivity, 250: mapped cells (height and rock) per second of mission, full at 180 x 180 cells in 24 hours;
- localisation, 150: in full if the rover uses no fiducials of the lander, otherwise 0. The error of the pose has no
  points of its own: it costs points of both maps.

As in the challenge, the map has to be in the frame of the world. A rover with an estimated pose places observations by
the estimate, so errors of the pose move cells and change heights. The true height of a cell is the mean over 16
vertical rays of the first hit on ground or rock; the cell is rock if a ray hits a rock.

Differences from the challenge:

- The rover crosses a strip once instead of exploring a square of 27 m. Cells of the corridor along the straight line
  are scored, from the first ground that the front camera sees to the goal, because no drive can see a whole square.
- The mission is the drive. A rover at 0.2 m/s maps about 50 times faster than the challenge asks, so drives that map
  anything have all points of productivity.
- A corridor without rocks has no score of rocks (NaN) and no total, instead of 0 points.
- No rover here has fiducials, so all drives have the 150 points of localisation.
"""

from __future__ import annotations

import math

import numpy as np

from polarsim.rover.perception.ground_view import by_cells, part_centres, true_surface
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.world.surface import World

POINTS = {"geometric map": 300.0, "rock map": 300.0, "productivity": 250.0, "localisation": 150.0}
HEIGHT_M = 0.05  # maximum error of a right height
FULL_RATE_1_S = 180 * 180 / (24 * 3600)  # cells per second for full productivity: the square in the mission time
_CORRIDOR_M = 1.05  # half width of the scored corridor along the straight line: the wheels and a margin
_BLIND_M = 2.2  # ground ahead of base_link at the start that the camera does not see
_RAYS = 4  # rays along a side of a cell


def points_of(grid: HazardGrid, world: World, line: np.ndarray, seconds: float) -> dict[str, float]:
    """Return the challenge's score of a map in the corridor along a line (2, 2), from the first visible ground on."""
    height, rock = true_cells(world, grid.x, grid.y, grid.cell_m)
    return challenge_score(grid.surface_of_cells(), grid.rock, height, rock, corridor(grid, line), seconds)


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
) -> dict[str, float]:
    """Return the points of a map (rows, columns): heights, m, NaN where unknown, and rock flags.

    `counted`: cells that are scored. An unknown height is wrong, an unknown rock means no rock; a cell is mapped if its
    height is known.
    """
    near = np.abs(np.where(np.isfinite(height), height, np.inf) - true_height) < HEIGHT_M
    right = int((rock & true_rock & counted).sum())
    wrong = int(((rock != true_rock) & counted).sum())
    rate = float((np.isfinite(height) & counted).sum()) / seconds if seconds else 0.0
    return {
        "geometric map": POINTS["geometric map"] * float(near[counted].mean()) if counted.any() else 0.0,
        "rock map": POINTS["rock map"] * 2 * right / (2 * right + wrong) if (true_rock & counted).any() else math.nan,
        "productivity": POINTS["productivity"] * min(rate / FULL_RATE_1_S, 1.0),
        "localisation": POINTS["localisation"],
    }


def corridor(grid: HazardGrid, line: np.ndarray) -> np.ndarray:
    """Return (rows, columns) bool: scored cells along a line (2, 2)."""
    x, y = np.meshgrid(grid.x - line[0, 0], grid.y - line[0, 1])
    length = float(np.hypot(*(line[-1] - line[0])))
    step = (line[-1] - line[0]) / length
    along, aside = x * step[0] + y * step[1], y * step[0] - x * step[1]
    return np.asarray((along > _BLIND_M) & (along < length) & (np.abs(aside) < _CORRIDOR_M))
