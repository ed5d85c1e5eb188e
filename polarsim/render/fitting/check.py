"""How near materials come to photos that they were not fitted to."""

from __future__ import annotations

from typing import Any

import numpy as np


def errors(ratio: np.ndarray) -> dict[str, float]:
    """Of logarithms (n,) of photo over twin, one brightness taken out: median absolute value and RMS, in stops."""
    stops = (ratio - np.median(ratio)) / np.log(2)
    return {
        "median_stops": _rounded(float(np.median(np.abs(stops)))),
        "rms_stops": _rounded(float(np.sqrt(np.mean(stops * stops)))),
    }


def compared(before: np.ndarray, constant: np.ndarray, fitted: np.ndarray) -> dict[str, Any]:
    """Errors of twins without a fit, with all of it but the albedo, and with all of it; (n,) logarithms each."""
    return {
        "count": len(fitted),
        "unfitted": errors(before),
        "constant_albedo": errors(constant),
        "fitted": errors(fitted),
    }


def _rounded(value: float) -> float:
    return float(f"{value:.5g}")
