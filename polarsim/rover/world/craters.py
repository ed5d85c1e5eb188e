"""Small craters in equilibrium, strewn over a square: how many of which size, and their shape.

Numbers: where as many craters wear away as are made, N(D) = 0.079 D^-2 craters of diameter D or more lie on a unit of
area (Trask, JPL Technical Report 32-800 (1966) 252: 10^10.9 D^-2 on 10^6 km2, D in metres), at most as many as that.

Shape: a paraboloid up to the rim; the rim stands as high above the ground around as in fresh craters, 0.036 / 0.196
of the depth from rim to floor (Pike, in Impact and Explosion Cratering (1977) 489); outside, ejecta fall off with the
third power of the distance (McGetchin, Settle & Head, Earth Planet. Sci. Lett. 20 (1973) 226), and fade out between two
and three radii. Then the profile is averaged over 0.2 radii, for worn craters have round rims. Fresh craters are 0.196
deep for their diameter; those in equilibrium are worn at all stages, so ratios are drawn evenly between bounds. Craters
add up where they overlap.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import ndimage

from polarsim.randomness import generator
from polarsim.rover.world.options import CraterOptions

TRASK = 0.079
RIM_SHARE = 0.036 / 0.196  # height of the rim over the depth, of fresh craters
_ROUNDED, _FINE = 0.2, 0.01  # radii over which the profile is averaged, and between its values
EJECTA_FADE, EJECTA_RADII = 2.0, 3.0  # where ejecta begin to fade, and end
_CELLS = 3.0  # across a crater, at least: of a smaller one nodes show nothing right


@dataclass(frozen=True)
class Craters:
    """n of them: centres, diameters from rim to rim, and depths from rim to floor, m."""

    x: np.ndarray
    y: np.ndarray
    diameter: np.ndarray
    depth: np.ndarray


def per_m2(diameter_m: np.ndarray | float) -> np.ndarray:
    """Craters of this diameter or more on a square metre in equilibrium."""
    return np.asarray(TRASK * np.asarray(diameter_m, float) ** -2)


def strewn_craters(options: CraterOptions, size_m: float, seed: int) -> Craters:
    """Craters with centres on a square of side `size_m` about 0."""
    rng = generator(seed, "craters")
    ends = per_m2(np.array([options.smallest_m, options.largest_m]))
    count = rng.poisson(options.share * size_m**2 * max(ends[0] - ends[1], 0.0))
    diameter = np.sqrt(TRASK / rng.uniform(ends[1], ends[0], count))
    x, y = rng.uniform(-size_m / 2, size_m / 2, (2, count))
    return Craters(x, y, diameter, diameter * rng.uniform(*options.depth_over_diameter, count))


def profile(radii: np.ndarray) -> np.ndarray:
    """Heights over the depth from rim to floor, at distances from the centre over the radius."""
    return np.interp(radii, *_tabulated())


@cache
def _tabulated() -> tuple[np.ndarray, np.ndarray]:
    """Distances over the radius, and heights over the depth."""
    radii = np.arange(0.0, EJECTA_RADII + _ROUNDED + _FINE / 2, _FINE)
    t = np.clip((radii - EJECTA_FADE) / (EJECTA_RADII - EJECTA_FADE), 0.0, 1.0)
    outside = RIM_SHARE * np.maximum(radii, 1.0) ** -3 * (1 - t * t * (3 - 2 * t))
    sharp = np.where(radii < 1, RIM_SHARE - 1 + radii**2, outside)
    round_ = ndimage.uniform_filter1d(sharp, round(_ROUNDED / _FINE), mode="reflect")
    return radii, round_ / np.ptp(round_)


def dig(level: np.ndarray, x: np.ndarray, y: np.ndarray, craters: Craters) -> None:
    """Add craters to heights (rows, columns) at nodes x (columns,) and y (rows,), in place.

    A crater is left out where nodes stand too far apart to show it.
    """
    step_x, step_y = np.gradient(x), np.gradient(y)
    for cx, cy, diameter, depth in zip(craters.x, craters.y, craters.diameter, craters.depth, strict=True):
        reach = EJECTA_RADII * diameter / 2
        columns = slice(*np.searchsorted(x, [cx - reach, cx + reach]))
        rows = slice(*np.searchsorted(y, [cy - reach, cy + reach]))
        shown = np.maximum(step_y[rows, None], step_x[columns]) * _CELLS <= diameter
        radii = np.hypot(x[columns] - cx, y[rows, None] - cy) * (2 / diameter)
        level[rows, columns] += np.where(shown, depth * profile(radii), 0.0)
