"""Light field of a lamp: irradiance over the sand, perpendicular to the beam, relative to the centre of the sandbox.

The logarithm is a cubic polynomial in x and y. Real spotlights follow neither the inverse square of the distance nor a
constant: reflector, lens and aim shape the beam.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

REACH_M = 2.0  # usual reach: the unit of x and y, and the limit beyond which the field is constant, metres
_DEGREE = 3
POWERS = tuple((i, j) for i in range(_DEGREE + 1) for j in range(_DEGREE + 1 - i) if i + j)  # of x and y, by term
EVEN = (0.0,) * len(POWERS)  # the same irradiance everywhere


def terms(points: np.ndarray, reach_m: float = REACH_M) -> np.ndarray:
    """Return the terms (n, k) of the polynomial at points (n, 2 or 3), sandbox frame, metres."""
    x, y = _scaled(points, reach_m)
    return np.stack([x**i * y**j for i, j in POWERS], axis=1)


def relative_irradiance(coefficients: Sequence[float], points: np.ndarray, reach_m: float = REACH_M) -> np.ndarray:
    """Return the irradiance (n,) at points (n, 2 or 3), sandbox frame, metres, in the precision of the points."""
    return np.asarray(np.exp(log_irradiance(coefficients, points, reach_m)))


def log_irradiance(coefficients: Sequence[float], points: np.ndarray, reach_m: float = REACH_M) -> np.ndarray:
    """Return the natural logarithm (n,) of `relative_irradiance`."""
    if len(coefficients) != len(POWERS):
        raise ValueError(f"{len(coefficients)} coefficients of a light field, expected {len(POWERS)}")
    x, y = _scaled(points, reach_m)
    of_power = dict(zip(POWERS, coefficients, strict=True))
    total = np.zeros_like(x)
    for i in reversed(range(_DEGREE + 1)):  # Horner's scheme in x, with polynomials in y as coefficients
        part = np.zeros_like(y)
        for j in reversed(range(_DEGREE + 1 - i)):
            part = part * y + y.dtype.type(of_power.get((i, j), 0.0))
        total = total * x + part
    return np.asarray(total)


def _scaled(points: np.ndarray, reach_m: float) -> tuple[np.ndarray, np.ndarray]:
    x, y = (np.clip(points[:, axis] / points.dtype.type(reach_m), -1, 1) for axis in range(2))
    return x, y
