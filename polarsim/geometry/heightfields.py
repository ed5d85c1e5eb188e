"""Relief that repeats itself over a range of scales: self-affine heights.

Heights of points that lie L apart differ by `deviation_m` (L / 1 m)^H in the root mean square (structure function of
fractional Brownian relief; H is the Hurst exponent). Of the Moon at 17 m and more H is 0.95 in the median of highlands
and 0.76 of maria (Rosenburg et al., J. Geophys. Res. 116 (2011) E02001).

It is a sum of octaves: on a square lattice of spacing s stand normal numbers, a cubic B-spline leads through them, and
its amplitude grows as s^H. So heights can be asked for on any nodes, fine ones here, coarse ones there. Octaves finer
than nodes can show fade out, along either axis: where fine columns cross coarse rows they would be ridges as long as
the rows are apart, and a fan of streaks and specks at the horizon. Where octaves end the power is lower: of octaves
from 4 cm to 41 m it is 0.84 between 0.5 and 4 m with H = 0.9, and 0.74 with 0.76.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from polarsim.randomness import generator

_CUBIC = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False)
_SEPTIC = BSpline.basis_element(np.arange(-4.0, 5.0), extrapolate=False)  # what two cubic ones have in common
NEAR_ONLY_M = 2.0  # octaves finer than this are left out beyond the site: there they are less than a pixel


def spacings(finest_m: float, below_m: float) -> np.ndarray:
    """(n,) spacings of octaves from the finest on, each twice the one before, all below another length, m."""
    count = max(int(np.ceil(np.log2(below_m / finest_m))), 0)
    return np.asarray(finest_m * 2.0 ** np.arange(count))


def amplitudes(spacing: np.ndarray, hurst: float, deviation_m: float) -> np.ndarray:
    """(n,) standard deviations of each octave's lattice, m, so that points 1 m apart differ by `deviation_m`."""
    if not len(spacing):
        return spacing
    own = spacing**hurst
    peak = float(_SEPTIC(0.0))
    squared = 2 * peak * (peak - np.nan_to_num(_SEPTIC(1.0 / spacing))) * own**2
    return np.asarray(own * deviation_m / np.sqrt(squared.sum()))


def relief(
    x: np.ndarray,
    y: np.ndarray,
    *,
    spacing: np.ndarray,
    amplitude: np.ndarray,
    half_m: float,
    far_m: float,
    seed: int,
) -> np.ndarray:
    """Heights (rows, columns) at nodes x (columns,) and y (rows,), m; fine octaves within `half_m`, all in `far_m`.

    There are two nodes or more along each axis, in rising order.
    """
    level = np.zeros((len(y), len(x)))
    for step, deviation in zip(spacing.tolist(), amplitude.tolist(), strict=True):
        reach = half_m if step < NEAR_ONLY_M else far_m
        count = 2 * int(np.ceil(reach / step)) + 3
        numbers = generator(seed, "relief", f"{step:.6g}").normal(0.0, deviation, (count, count))
        level += _weights(y, step, count) @ numbers @ _weights(x, step, count).T
    return level


def _shown(apart: np.ndarray, step: float) -> np.ndarray:
    """(n,) share of an octave that nodes so far apart show: all up to half its spacing, nothing from its spacing on."""
    t = np.clip(2 * apart / step - 1, 0.0, 1.0)
    return np.asarray(1 - t * t * (3 - 2 * t))


def _weights(at: np.ndarray, step: float, count: int) -> csr_array:
    """(n, count): of the lattice's numbers at each node; beyond the lattice there is nothing, on sparse nodes less."""
    place = at / step + (count - 1) / 2
    number = np.floor(place).astype(int)[:, None] + np.arange(-1, 3)
    weight = np.nan_to_num(_CUBIC(place[:, None] - number)) * _shown(np.gradient(at), step)[:, None]
    inside = (number >= 0) & (number < count)
    rows = np.broadcast_to(np.arange(len(at))[:, None], number.shape)
    return csr_array((weight[inside], (rows[inside], number[inside])), shape=(len(at), count))
