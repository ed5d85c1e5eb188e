"""The map by which the rover drives: log-odds and height of rocks by cell, and the surface by parts of cells.

Log-odds of independent observations are added (Moravec & Elfes, ICRA 1985). Bounds allow a cell to change, and decay
lowers the weight of old observations. The surface, rocks included, is the weighted mean of the observed heights;
gaps are filled on reading. The map that the rule `rover_onboard` scores is `hazard_map`: it accumulates votes of all
pictures of a recorded drive, without decay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.interpolate import LinearNDInterpolator

from polarsim.rover.perception.ground_view import CELL_M, by_cells, grid_points
from polarsim.rover.world.surface import World

PARTS = 4  # parts along a side of a cell, the resolution of the surface
MISS_LOG_ODDS = 0.7  # decrease of a cell's log-odds by an update without a rock
MAX_LOG_ODDS = 4.0  # bound of log-odds in both directions, so that a few updates can change a cell's state
DECAY_S = 120.0  # time constant of the decay of log-odds, s
_FILL_M = 0.6  # maximum distance over which gaps of the surface are interpolated


@dataclass(frozen=True)
class MapUpdate:
    """An observation of the cells (rows, columns) of a map."""

    weight: np.ndarray  # 0 (unobserved) to 1
    rock: np.ndarray  # log-odds of a rock, added at weight 1; 0: no rock
    height: np.ndarray  # m, of the rock; NaN without a rock
    surface: np.ndarray  # (rows PARTS, columns PARTS) m; NaN where unobserved


class HazardGrid:
    """Cells of a world; centres at `x` (columns) and `y` (rows), metres."""

    cell_m = CELL_M

    def __init__(self, world: World) -> None:
        self.x, self.y = grid_points(world)
        shape = len(self.y), len(self.x)
        self.log_odds, self.seen = np.zeros(shape), np.zeros(shape, bool)
        fine = PARTS * shape[0], PARTS * shape[1]
        self.surface = np.full(fine, np.nan)
        self._surface_weight = np.zeros(fine)
        self._height_sum, self._height_weight = (np.zeros(shape) for _ in range(2))
        self._time = 0.0

    def fade(self, time_s: float) -> None:
        """Decay the log-odds up to a time."""
        self.log_odds *= math.exp(-(time_s - self._time) / DECAY_S)
        self._time = time_s

    def add(self, update: MapUpdate) -> None:
        """Fuse an update."""
        rock = update.rock > 0
        change = update.weight * np.where(rock, update.rock, -MISS_LOG_ODDS)
        self.log_odds = np.clip(self.log_odds + change, -MAX_LOG_ODDS, MAX_LOG_ODDS)
        self.seen |= update.weight > 0
        weight = update.weight * rock
        self._height_sum += np.where(weight > 0, weight * np.nan_to_num(update.height), 0.0)
        self._height_weight += weight
        fine = np.where(np.isfinite(update.surface), by_part(update.weight), 0.0)
        total = self._surface_weight + fine
        mean = np.nan_to_num(self.surface)
        share = np.divide(fine, total, out=np.zeros(fine.shape), where=fine > 0)
        mean += share * (np.nan_to_num(update.surface) - mean)
        self.surface = np.where(total > 0, mean, np.nan)
        self._surface_weight = total

    @property
    def rock(self) -> np.ndarray:
        """(rows, columns) bool: cells that are more likely rock than not."""
        return np.asarray(self.log_odds > 0)

    @property
    def height(self) -> np.ndarray:
        """Mean height of the rock observed in each cell, m; 0 without a rock."""
        total, weight = self._height_sum, self._height_weight
        return np.divide(total, weight, out=np.zeros(total.shape), where=weight > 0)

    def hazards(self, height_m: float) -> np.ndarray:
        """Return the cells with a rock of at least this height."""
        return self.rock & (self.height >= height_m)

    def surface_of_cells(self) -> np.ndarray:
        """Return (rows, columns) mean height of the surface, m; NaN without an observation within `_FILL_M`."""
        filled = without_gaps(self.surface, _FILL_M * PARTS / CELL_M)
        return np.asarray(of_parts(filled, "mean"))


def by_part(cells: np.ndarray) -> np.ndarray:
    """Return the values of cells (rows, columns) by parts (rows PARTS, columns PARTS)."""
    return np.repeat(np.repeat(cells, PARTS, axis=0), PARTS, axis=1)


def of_parts(parts: np.ndarray, how: str) -> np.ndarray:
    """Reduce parts of cells (rows PARTS, columns PARTS) to cells by an array method, such as mean or max."""
    return np.asarray(getattr(by_cells(parts, PARTS), how)(axis=(1, 3)))


def without_gaps(values: np.ndarray, reach: float) -> np.ndarray:
    """Fill NaN in values (rows, columns) linearly, up to `reach` elements from finite values.

    Interpolation is linear on the Delaunay triangles of the rims of gaps; outside them, the nearest value is used.
    """
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    distance, nearest = ndimage.distance_transform_edt(~known, return_indices=True)
    gap = ~known & (distance <= reach)
    rim = known & ndimage.binary_dilation(~known)
    filled = np.where(known | gap, values[tuple(nearest)], np.nan)
    if gap.any() and rim.sum() > 3:
        between = LinearNDInterpolator(np.argwhere(rim), values[rim])(np.argwhere(gap))
        filled[gap] = np.where(np.isfinite(between), between, filled[gap])
    return filled
