"""Cumulative size-frequency distributions of rocks, and the law of Golombek and Rapp.

Golombek and Rapp (J. Geophys. Res. 102 (1997) 4117) describe the share of the ground that rocks of a diameter of at
least D metres cover as F_k(D) = k exp(-q(k) D) with q(k) = 1.79 + 0.152 / k (equations 1 and 2): k is the share that
all rocks cover. The law was found for Mars; on the Moon and in a sandbox, k is a descriptive number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.special import exp1
from scipy.stats import chi2

K_BOUNDS = (1e-4, 1.0)
HALF_DEVIANCE = chi2.ppf(0.95, 1) / 2  # decrease of the log-likelihood at the bounds of a 95 % interval


@dataclass(frozen=True)
class Abundance:
    """Share k of the ground that rocks cover, by the law, and its 95 % interval."""

    k: float
    low: float
    high: float


def decay(k: np.ndarray | float) -> np.ndarray:
    """Return q(k), 1 / m."""
    return np.asarray(1.79 + 0.152 / np.asarray(k))


def covered_share(diameter: np.ndarray | float, k: float) -> np.ndarray:
    """Return F_k(D), the share of the ground covered by rocks of at least `diameter` metres."""
    return np.asarray(k * np.exp(-decay(k) * np.asarray(diameter)))


def number_density(diameter: np.ndarray | float, k: float) -> np.ndarray:
    """Return the number of rocks per m^2 of at least `diameter` metres by the law, for discs of area pi D^2 / 4.

    The number with a diameter in dD is -F_k'(D) dD / (pi D^2 / 4), integrated by parts.
    """
    q, d = decay(k), np.asarray(diameter, float)
    return np.asarray(4 * k * q / np.pi * (np.exp(-q * d) / d - q * exp1(q * d)))


def fit_abundance(diameters: np.ndarray, area: float, smallest: float) -> Abundance:
    """Fit k to the diameters (n,) of rocks on `area` m^2 by maximum likelihood; rocks below `smallest` are ignored.

    Rocks are independent points (Poisson process) with the density of the law. Bounds are those of the likelihood
    ratio. Without rocks, k and the lower bound are 0.
    """
    counted = np.asarray(diameters, float)
    counted = counted[counted >= smallest]

    def log_likelihood(log_k: float) -> float:
        k = np.exp(log_k)
        q = decay(k)
        density = len(counted) * np.log(4 * k * q / np.pi) - q * counted.sum() - 2 * np.log(counted).sum()
        return float(density - area * number_density(smallest, k))

    bounds = (float(np.log(K_BOUNDS[0])), float(np.log(K_BOUNDS[1])))
    if len(counted):
        best = float(minimize_scalar(lambda log_k: -log_likelihood(log_k), bounds=bounds, method="bounded").x)
    else:
        best = bounds[0]
    floor = log_likelihood(best) - HALF_DEVIANCE

    def bound(end: float) -> float:
        if log_likelihood(end) >= floor:
            return float(np.exp(end))
        return float(np.exp(brentq(lambda log_k: log_likelihood(log_k) - floor, best, end)))

    high = bound(bounds[1])
    return Abundance(float(np.exp(best)), bound(bounds[0]), high) if len(counted) else Abundance(0.0, 0.0, high)


def poisson_interval(count: np.ndarray | int) -> tuple[np.ndarray, np.ndarray]:
    """Return the exact 95 % interval of the mean of a Poisson distribution (Garwood, Biometrika 28 (1936) 437)."""
    n = np.asarray(count)
    low = np.where(n > 0, chi2.ppf(0.025, 2 * np.maximum(n, 1)) / 2, 0.0)
    return low, np.asarray(chi2.ppf(0.975, 2 * n + 2) / 2)
