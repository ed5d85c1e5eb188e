"""95 % intervals: the bootstrap over independent units (Efron, Ann. Statist. 7 (1979) 1), and Student's.

Units are independent samples: views or photos of detectors, seeds or drives of the rover. The bootstrap applies to
statistics of any distribution, such as average precision, medians and shares. Means of drive metrics over seeds have
Student's interval, because the bootstrap interval of three to ten nearly normal values is too narrow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from polarsim.randomness import generator

RESAMPLES = 1000
LEVELS = (0.025, 0.975)


def bootstrap_draws(units: int, resamples: int, seed: int = 0, *purpose: object) -> np.ndarray:
    """Return (resamples, units) float: number of draws of each unit with replacement.

    All metrics of a purpose use the same draws, so differences between metrics are paired.
    """
    random = generator(seed, *(purpose or ("detect", "bootstrap", units)))
    return random.multinomial(units, np.full(units, 1 / units), size=resamples).astype(float)


def percentile_interval(values: np.ndarray, units: int) -> tuple[float, float]:
    """Return the bounds of the central 95 % of resampled values; NaN for fewer than two units.

    NaN values are ignored.
    """
    values = values[~np.isnan(values)]
    if units < 2 or not len(values):
        return math.nan, math.nan
    low, high = np.quantile(values, LEVELS)
    return float(low), float(high)


def resampled_means(values: np.ndarray, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return means (resamples,) of values (n,) of units (n,) for `bootstrap_draws`; NaN without any value."""
    return resampled_ratios(values, np.ones(len(values)), unit, drawn)


def resampled_ratios(values: np.ndarray, weights: np.ndarray, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return (resamples,) sums of values over sums of weights, both (n,), with units (n,) drawn; NaN for weight 0."""
    total, weight = (drawn @ np.bincount(unit, each, drawn.shape[1]) for each in (values, weights))
    return np.divide(total, weight, out=np.full(len(drawn), np.nan), where=weight > 0)


def resampled_medians(values: np.ndarray, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return medians (resamples,) of finite values (n,) of units (n,) for `bootstrap_draws`; NaN without any value.

    A value counts as often as its unit is drawn; the median of an even number of values is the mean of the middle two.
    """
    order = np.argsort(values, kind="stable")
    values, counts = values[order], drawn[:, unit[order]].cumsum(axis=1)
    if not len(values):
        return np.full(len(drawn), np.nan)
    half = counts[:, -1:] / 2
    lower, upper = ((counts >= half).argmax(axis=1), (counts > half).argmax(axis=1))
    return np.where(counts[:, -1] > 0, (values[lower] + values[upper]) / 2, np.nan)


def bootstrap_interval(
    groups: Sequence[np.ndarray],
    statistic: Callable[[np.ndarray], float],
    random: np.random.Generator,
    resamples: int = RESAMPLES,
) -> tuple[float, float]:
    """Return the bootstrap interval of any statistic over units with values `groups`, each (n, ...)."""
    if len(groups) < 2:
        return math.nan, math.nan
    drawn = random.integers(len(groups), size=(resamples, len(groups)))
    values = np.array([statistic(np.concatenate([groups[unit] for unit in draw])) for draw in drawn])
    return percentile_interval(values[np.isfinite(values)], len(groups))


def student_interval(values: np.ndarray) -> tuple[float, float]:
    """Return mean -+ t(0.975, n - 1) s / sqrt(n) of values (n,); NaN for fewer than two."""
    from scipy import stats

    if len(values) < 2:
        return math.nan, math.nan
    half = stats.t.ppf(LEVELS[1], len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    return float(values.mean() - half), float(values.mean() + half)
