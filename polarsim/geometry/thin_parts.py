"""Parts of a mask too thin to be seen as belonging to it."""

from __future__ import annotations

import numpy as np


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
