"""Parts of pictures: where each rock lies, and what people do not see as belonging to a mask, crumbs and thin parts."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import find_objects

from polarsim.photo import NO_ROCK

Window = tuple[slice, slice]  # rows and columns of a picture
SMALL_PART = 0.15  # of a mask's largest connected part: smaller ones are crumbs that nobody would outline or box


def windows_of(ids: np.ndarray) -> dict[int, Window]:
    """Where each rock lies in a picture of rock ids."""
    windows = find_objects(ids - NO_ROCK)  # counts from 1 on; None for ids that no pixel has
    return {rock: (window[0], window[1]) for rock, window in enumerate(windows, 1 + NO_ROCK) if window}


def without_crumbs(mask: np.ndarray, connectivity: int = 4) -> np.ndarray:
    """A mask (h, w) less the parts that are much smaller than its largest one; parts hang together by edges.

    With a connectivity of 8 corners hold too.
    """
    import cv2

    _, parts, figures, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=connectivity)
    areas = figures[:, cv2.CC_STAT_AREA] * (np.arange(len(figures)) > 0)  # number 0 is what lies around
    kept = areas >= SMALL_PART * max(1, areas.max())
    return np.asarray(kept[parts])


def without_thin_parts(mask: np.ndarray, size: int) -> np.ndarray:
    """(h, w) bool: a mask opened by squares of `size` samples, with the tips that this cuts off; never empty."""
    import cv2

    if size < 2:
        return mask
    whole = np.zeros((mask.shape[0] + 2 * size, mask.shape[1] + 2 * size), np.uint8)
    whole[size:-size, size:-size] = mask
    opened = cv2.morphologyEx(whole, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    grown = cv2.dilate(opened, np.ones((2 * size + 1, 2 * size + 1), np.uint8)) & whole
    found = grown[size:-size, size:-size] > 0
    return found if found.any() else mask
