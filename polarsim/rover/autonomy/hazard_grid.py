"""The rover's map: by cell the log-odds of a rock, which looks raise and lower and time lets fade, and its height.

Log-odds add up over looks that are independent (Moravec & Elfes, ICRA 1985); bounds keep a cell open to a change of
mind, and fading (exponential, `decay_s`) makes an old look worth less than a new one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.rover.autonomy.options import MapOptions
from polarsim.rover.world.surface import World


@dataclass(frozen=True)
class Look:
    """What one look says of cells (rows, columns)."""

    weight: np.ndarray  # 0 where it says nothing, 1 in full
    rock: np.ndarray  # log-odds of a rock that a look in full adds; 0: it shows none
    height: np.ndarray  # m, of the rock; NaN where there is none
    ground: np.ndarray  # m, of the ground in the world; NaN where it is not measured


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
        self.ground = np.full(shape, np.nan)
        self._height_sum, self._height_weight, self._ground_weight = (np.zeros(shape) for _ in range(3))
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
        known = np.isfinite(look.ground) & (look.weight > 0)
        total = self._ground_weight + look.weight
        before = np.nan_to_num(self.ground)
        with np.errstate(invalid="ignore"):
            mean = before + (look.ground - before) * look.weight / np.where(known, total, 1.0)
        self.ground = np.where(known, mean, self.ground)
        self._ground_weight = np.where(known, total, self._ground_weight)

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
