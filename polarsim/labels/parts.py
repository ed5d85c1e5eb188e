"""Parts of a mask that people do not see as belonging to it: crumbs, and what is too thin."""

from __future__ import annotations

import numpy as np

SMALL_PART = 0.15  # of a mask's largest connected part: smaller ones are crumbs that nobody would outline or box


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
    whole = np.pad(mask.astype(np.uint8), size)
    opened = cv2.morphologyEx(whole, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    grown = cv2.dilate(opened, np.ones((2 * size + 1, 2 * size + 1), np.uint8)) & whole
    found = grown[size:-size, size:-size] > 0
    return found if found.any() else mask
