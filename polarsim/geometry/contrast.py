"""Local contrast of images, which does not change with brightness and slow trends."""

from __future__ import annotations

import numpy as np


def blurred(values: np.ndarray, sigma: float) -> np.ndarray:
    """Return values (rows, columns) float32, smoothed by a Gaussian of `sigma` cells."""
    import cv2

    return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_REFLECT))


def local_contrast(values: np.ndarray, radius_cells: float, floor: float) -> np.ndarray:
    """Return values (rows, columns) less their local mean, by their local standard deviation; 0 where unknown.

    Mean and deviation are those of known values in a Gaussian window of `radius_cells`. The result does not change with
    offset and slow trends. Patterns much below `floor` become small. Cells with less than half of the window known are
    0.
    """
    known = np.isfinite(values)
    total = blurred(known.astype(np.float32), radius_cells)
    enough = known & (total > 0.5)
    safe = np.maximum(total, 0.05)
    mean = blurred(np.where(known, values, 0).astype(np.float32), radius_cells) / safe
    centred = np.where(enough, values - mean, 0).astype(np.float32)
    variance = blurred(centred**2, radius_cells) / safe
    return np.where(enough, centred / np.sqrt(variance + np.float32(floor) ** 2), 0).astype(np.float32)
