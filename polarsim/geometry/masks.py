"""Masks: agreement of two class masks pixel by pixel, windows of ids, and removal of small components."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import find_objects

from polarsim.photo import NO_ROCK

Window = tuple[slice, slice]  # rows and columns of a picture
SMALL_PART = 0.15  # of a mask's largest connected part: nobody would outline or box smaller ones


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


def windows_of(ids: np.ndarray) -> dict[int, Window]:
    """Where each rock lies in a picture of rock ids."""
    windows = find_objects(ids - NO_ROCK)  # counts from 1 on; None for ids that no pixel has
    return {rock: (window[0], window[1]) for rock, window in enumerate(windows, 1 + NO_ROCK) if window}


def without_small_components(mask: np.ndarray, connectivity: int = 4) -> np.ndarray:
    """A mask (h, w) less the parts that are much smaller than its largest one; parts hang together by edges.

    With a connectivity of 8 corners hold too.
    """
    import cv2

    _, parts, figures, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=connectivity)
    areas = figures[:, cv2.CC_STAT_AREA] * (np.arange(len(figures)) > 0)  # number 0 is what lies around
    kept = areas >= SMALL_PART * max(1, areas.max())
    return np.asarray(kept[parts])
