"""Masks: confusion of two class masks, windows of ids, and removal of small components."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import find_objects

from polarsim.photo import NO_ROCK

Window = tuple[slice, slice]  # rows and columns of an image
SMALL_PART = 0.15  # minimum area of a connected part, share of the largest part; people do not outline smaller parts


def confusion_matrix(truth: np.ndarray, found: np.ndarray, classes: int) -> np.ndarray:
    """Return numbers of pixels (classes, classes) by true class (row) and predicted class (column).

    `truth`, `found`: class numbers of the same shape; pixels with an unknown true class are ignored.
    """
    if truth.shape != found.shape:
        raise ValueError(f"masks have different shapes, {truth.shape} and {found.shape}")
    counted = truth < classes
    pairs = truth[counted].astype(int) * classes + found[counted]
    return np.bincount(pairs, minlength=classes**2).reshape(classes, classes)


def class_iou(counts: np.ndarray) -> np.ndarray:
    """Return the IoU (..., classes) of each class, from a `confusion_matrix` (..., classes, classes).

    It is NaN for classes without pixels.
    """
    both = np.diagonal(counts, axis1=-2, axis2=-1)
    either = counts.sum(axis=-1) + counts.sum(axis=-2) - both
    return np.divide(both, either, out=np.full(both.shape, np.nan), where=either > 0)


def windows_of(ids: np.ndarray) -> dict[int, Window]:
    """Return the window of each rock in an image of rock ids."""
    windows = find_objects(ids - NO_ROCK)  # indices start at 1; None for ids without pixels
    return {rock: (window[0], window[1]) for rock, window in enumerate(windows, 1 + NO_ROCK) if window}


def without_small_components(mask: np.ndarray, connectivity: int = 4) -> np.ndarray:
    """Return a mask (h, w) without the parts that are much smaller than its largest part.

    Parts are connected by edges, and with a connectivity of 8 also by corners.
    """
    import cv2

    _, parts, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=connectivity)
    areas = statistics[:, cv2.CC_STAT_AREA] * (np.arange(len(statistics)) > 0)  # number 0 is the background
    kept = areas >= SMALL_PART * max(1, areas.max())
    return np.asarray(kept[parts])
