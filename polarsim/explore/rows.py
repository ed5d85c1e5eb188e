"""Rounding of numbers in the page's JSON files."""

from __future__ import annotations

import numpy as np


def as_rows(values: np.ndarray) -> list[float]:
    """Return the numbers of an array as a flat list, rounded to 4 decimals."""
    return [round(float(value), 4) for value in np.asarray(values).ravel()]
