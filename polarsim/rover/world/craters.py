"""Small craters in equilibrium, distributed over a square: their number, sizes and shape.

Number: in equilibrium, when craters are destroyed as fast as they form, a unit of area has at most
N(D) = 0.079 D^-2 craters of diameter D or more (Trask, JPL Technical Report 32-800 (1966) 252: 10^10.9 D^-2 on 10^6
km2, D in metres).

Shape: a paraboloid up to the rim. The height of the rim above the ground is that of fresh craters, 0.036 / 0.196 of the
depth from rim to floor (Pike, in Impact and Explosion Cratering (1977) 489). Outside, ejecta decrease with the third
power of the distance (McGetchin, Settle & Head, Earth Planet. Sci. Lett. 20 (1973) 226) and fade between two and three
radii. The profile is then averaged over 0.2 radii, since worn craters have rounded rims. Fresh craters have a depth of
0.196 diameters; craters in equilibrium are worn to all degrees, so ratios are uniform between bounds. Overlapping
craters are added.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import ndimage

from polarsim.randomness import generator

TRASK = 0.079
SMALLEST_M, LARGEST_M = 0.3, 5.0  # m; larger craters are part of the elevation model
DEPTH_OVER_DIAMETER = 0.02, 0.08  # uniform between these bounds; fresh craters have 0.196
RIM_SHARE = 0.036 / 0.196  # ratio of rim height to depth of fresh craters
_ROUNDED, _FINE = 0.2, 0.01  # in radii: width of the average of the profile, and step of the table
EJECTA_FADE, EJECTA_RADII = 2.0, 3.0  # in radii: start and end of the fade of ejecta
_CELLS = 3.0  # minimum number of cells across a crater; nodes do not resolve smaller craters


@dataclass(frozen=True)
class Craters:
    """n craters: centres, diameters from rim to rim, and depths from rim to floor, m."""

    x: np.ndarray
    y: np.ndarray
    diameter: np.ndarray
    depth: np.ndarray


def craters_per_m2(diameter_m: np.ndarray | float) -> np.ndarray:
    """Return the number of craters of at least this diameter per square metre in equilibrium."""
    return np.asarray(TRASK * np.asarray(diameter_m, float) ** -2)


def random_craters(share: float, size_m: float, seed: int) -> Craters:
    """Return a share of the craters in equilibrium, with centres on a square of side `size_m` about the origin."""
    rng = generator(seed, "craters")
    ends = craters_per_m2(np.array([SMALLEST_M, LARGEST_M]))
    count = rng.poisson(share * size_m**2 * (ends[0] - ends[1]))
    diameter = np.sqrt(TRASK / rng.uniform(ends[1], ends[0], count))
    x, y = rng.uniform(-size_m / 2, size_m / 2, (2, count))
    return Craters(x, y, diameter, diameter * rng.uniform(*DEPTH_OVER_DIAMETER, count))


def profile(radii: np.ndarray) -> np.ndarray:
    """Return heights divided by the depth, for distances from the centre divided by the radius."""
    return np.interp(radii, *_tabulated())


@cache
def _tabulated() -> tuple[np.ndarray, np.ndarray]:
    """Return distances divided by the radius, and heights divided by the depth."""
    radii = np.arange(0.0, EJECTA_RADII + _ROUNDED + _FINE / 2, _FINE)
    t = np.clip((radii - EJECTA_FADE) / (EJECTA_RADII - EJECTA_FADE), 0.0, 1.0)
    outside = RIM_SHARE * np.maximum(radii, 1.0) ** -3 * (1 - t * t * (3 - 2 * t))
    sharp = np.where(radii < 1, RIM_SHARE - 1 + radii**2, outside)
    round_ = ndimage.uniform_filter1d(sharp, round(_ROUNDED / _FINE), mode="reflect")
    return radii, round_ / np.ptp(round_)


def dig(level: np.ndarray, x: np.ndarray, y: np.ndarray, craters: Craters) -> None:
    """Add craters to heights (rows, columns) at nodes x (columns,) and y (rows,), in place.

    Parts of a crater at nodes that are too coarse to resolve it are omitted.
    """
    step_x, step_y = np.gradient(x), np.gradient(y)
    for cx, cy, diameter, depth in zip(craters.x, craters.y, craters.diameter, craters.depth, strict=True):
        reach = EJECTA_RADII * diameter / 2
        columns = slice(*np.searchsorted(x, [cx - reach, cx + reach]))
        rows = slice(*np.searchsorted(y, [cy - reach, cy + reach]))
        resolved = np.maximum(step_y[rows, None], step_x[columns]) * _CELLS <= diameter
        radii = np.hypot(x[columns] - cx, y[rows, None] - cy) * (2 / diameter)
        level[rows, columns] += np.where(resolved, depth * profile(radii), 0.0)
