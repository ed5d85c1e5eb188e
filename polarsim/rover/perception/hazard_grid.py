"""The rover's map: by cell the log-odds of a rock, which looks raise and lower and time lets fade, and its height.

Log-odds add up over looks that are independent (Moravec & Elfes, ICRA 1985); bounds keep a cell open to a change of
mind, and fading (exponential, `decay_s`) makes an old look worth less than a new one.

Beside that, the height of the surface, rocks and all, by parts of cells: the mean of what was seen, nearer looks
counting more. Gaps that nothing was seen of are filled from around them when the map is read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.interpolate import LinearNDInterpolator

from polarsim.rover.planning.options import MapOptions
from polarsim.rover.world.surface import World

PARTS = 4  # along a side of a cell, by which the surface's heights are kept


@dataclass(frozen=True)
class Look:
    """What one look says of cells (rows, columns)."""

    weight: np.ndarray  # 0 where it says nothing, 1 in full
    rock: np.ndarray  # log-odds of a rock that a look in full adds; 0: it shows none
    height: np.ndarray  # m, of the rock; NaN where there is none
    surface: np.ndarray  # (rows PARTS, columns PARTS) m, of what is seen in the world; NaN where nothing is


class HazardGrid:
    """Cells of a world; centres at `x` (columns) and `y` (rows), metres."""

    def __init__(self, world: World, options: MapOptions) -> None:
        self.options = options
        cell = options.cell_m
        self.x, self.y = (
            start + cell * (np.arange(int((end - start) / cell)) + 0.5)
            for start, end in ((world.x[0], world.x[-1]), (world.y[0], world.y[-1]))
        )
        shape = len(self.y), len(self.x)
        self.log_odds, self.seen = np.zeros(shape), np.zeros(shape, bool)
        fine = PARTS * shape[0], PARTS * shape[1]
        self.surface = np.full(fine, np.nan)
        self._surface_weight = np.zeros(fine)
        self._height_sum, self._height_weight = (np.zeros(shape) for _ in range(2))
        self._time = 0.0

    def fade(self, time_s: float) -> None:
        """Let what is known fade up to a time."""
        self.log_odds *= math.exp(-(time_s - self._time) / self.options.decay_s)
        self._time = time_s

    def add(self, look: Look) -> None:
        """Fuse a look."""
        options, rock = self.options, look.rock > 0
        change = look.weight * np.where(rock, look.rock, -options.miss_log_odds)
        self.log_odds = np.clip(self.log_odds + change, -options.most_log_odds, options.most_log_odds)
        self.seen |= look.weight > 0
        weight = look.weight * rock
        self._height_sum += np.where(weight > 0, weight * np.nan_to_num(look.height), 0.0)
        self._height_weight += weight
        fine = np.where(np.isfinite(look.surface), by_part(look.weight), 0.0)
        total = self._surface_weight + fine
        mean = np.nan_to_num(self.surface)
        mean += np.divide(fine, total, out=np.zeros(fine.shape), where=fine > 0) * (np.nan_to_num(look.surface) - mean)
        self.surface = np.where(total > 0, mean, np.nan)
        self._surface_weight = total

    @property
    def rock(self) -> np.ndarray:
        """Cells that are more likely rock than not."""
        return np.asarray(self.log_odds > 0)

    @property
    def height(self) -> np.ndarray:
        """Mean height of the rock that was seen in a cell, m; 0 without one."""
        return np.divide(
            self._height_sum, self._height_weight, out=np.zeros(self.log_odds.shape), where=self._height_weight > 0
        )

    def hazards(self, height_m: float) -> np.ndarray:
        """Cells with a rock of this height or more."""
        return self.rock & (self.height >= height_m)

    def surface_of_cells(self) -> np.ndarray:
        """(rows, columns) m, mean height of the surface; NaN where nothing was seen within `fill_m`."""
        filled = without_gaps(self.surface, self.options.fill_m * PARTS / self.options.cell_m)
        return np.asarray(of_parts(filled, "mean"))


def by_part(cells: np.ndarray) -> np.ndarray:
    """(rows PARTS, columns PARTS) values of cells (rows, columns)."""
    return np.repeat(np.repeat(cells, PARTS, axis=0), PARTS, axis=1)


def of_parts(parts: np.ndarray, how: str) -> np.ndarray:
    """(rows, columns) from parts of cells (rows PARTS, columns PARTS), by an array's method: mean, max ..."""
    rows, columns = parts.shape
    return np.asarray(getattr(parts.reshape(rows // PARTS, PARTS, columns // PARTS, PARTS), how)(axis=(1, 3)))


def without_gaps(values: np.ndarray, reach: float) -> np.ndarray:
    """Values (rows, columns) with NaN filled linearly between what is known, no farther from it than `reach` elements.

    Linear over Delaunay's triangles of the gaps' rims; outside of all of them, the nearest known value.
    """
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    away, nearest = ndimage.distance_transform_edt(~known, return_indices=True)
    gap = ~known & (away <= reach)
    rim = known & ndimage.binary_dilation(~known)
    filled = np.where(known | gap, values[tuple(nearest)], np.nan)
    if gap.any() and rim.sum() > 3:
        between = LinearNDInterpolator(np.argwhere(rim), values[rim])(np.argwhere(gap))
        filled[gap] = np.where(np.isfinite(between), between, filled[gap])
    return filled
