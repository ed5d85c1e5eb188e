"""How well two masks of classes agree, pixel by pixel."""

from __future__ import annotations

import numpy as np


def confusion(truth: np.ndarray, found: np.ndarray, classes: int) -> np.ndarray:
    """(classes, classes) pixels by their true class (row) and the class that was found (column).

    Parameters
    ----------
    truth, found
        Class numbers of the same shape; pixels whose true class is none of them do not count.

    Raises
    ------
    ValueError
        Shapes differ.
    """
    if truth.shape != found.shape:
        raise ValueError(f"masks of shapes {truth.shape} and {found.shape}")
    counted = truth < classes
    pairs = truth[counted].astype(int) * classes + found[counted]
    return np.bincount(pairs, minlength=classes**2).reshape(classes, classes)


def iou(counts: np.ndarray) -> np.ndarray:
    """(..., classes) intersection over union of each class, of `confusion` (..., classes, classes).

    NaN of a class that neither has.
    """
    both = np.diagonal(counts, axis1=-2, axis2=-1)
    either = counts.sum(axis=-1) + counts.sum(axis=-2) - both
    return np.divide(both, either, out=np.full(both.shape, np.nan), where=either > 0)
