"""Local contrast of images, which does not change with brightness and slow trends."""

from __future__ import annotations

import numpy as np

_BILATERAL_SIDE, _BILATERAL_CELLS = 13, 4.0  # window of the bilateral filter and its standard deviation
_TEXTURE_CELLS = 3.0  # standard deviation of the window of the local standard deviation
_LARGEST = 3.0  # steps: larger values count as this value in the local standard deviation
_CLIP = 2.0  # maximum texture, local standard deviations


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


def texture(values: np.ndarray, step: float, floor: float) -> np.ndarray:
    """Return the texture of values (rows, columns) between edges, by its local standard deviation; 0 where unknown.

    The mean of each cell by a bilateral filter is subtracted (Ansar, Castano and Matthies, 3DPVT 2004, 389): edges
    higher than `step` remain in the mean. The pattern next to an edge is therefore that of the surface on its own side.
    Patterns much below `floor` become small.
    """
    import cv2

    known = np.isfinite(values)
    if not known.any():
        return np.zeros(values.shape, np.float32)
    complete = np.where(known, values, np.median(values[known])).astype(np.float32)
    mean = cv2.bilateralFilter(complete, _BILATERAL_SIDE, step, _BILATERAL_CELLS)
    fine = np.where(known, complete - mean, 0).astype(np.float32)
    variance = blurred(np.minimum(fine**2, np.float32(_LARGEST * step) ** 2), _TEXTURE_CELLS)
    scaled = fine / np.sqrt(variance + np.float32(floor) ** 2)
    return np.asarray(np.clip(scaled, -_CLIP, _CLIP), np.float32)
