"""Resizing of images, and interpolation between the nodes of a grid."""

from __future__ import annotations

import numpy as np


def resize(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return an image (h, w[, c]) with another width and height: averaged over areas if smaller, else interpolated."""
    import cv2

    if image.shape[1::-1] == size:
        return image
    smaller = max(size) < max(image.shape[:2])  # averaging suppresses aliasing of the grain of a larger image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR))


def resize_longer_side(image: np.ndarray, pixels: int) -> np.ndarray:
    """Return an image (h, w) with a given longer side and the same aspect ratio."""
    height, width = image.shape
    scale = pixels / max(height, width)
    return resize(image, (max(1, round(width * scale)), max(1, round(height * scale))))


def bilinear(values: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Interpolate values (rows, columns[, k]) between nodes, float64; outside the grid, those of the edge.

    `column`, `row`: positions of the same shape in units of nodes; the first node is at 0.
    """
    column, row = (np.clip(at, 0, size - 1) for at, size in zip((column, row), values.shape[1::-1], strict=True))
    left = np.minimum(column.astype(int), values.shape[1] - 2)
    low = np.minimum(row.astype(int), values.shape[0] - 2)
    u, v = (part.reshape(part.shape + (1,) * (values.ndim - 2)) for part in (column - left, row - low))
    lower = values[low, left] * (1 - u) + values[low, left + 1] * u
    upper = values[low + 1, left] * (1 - u) + values[low + 1, left + 1] * u
    return np.asarray(lower * (1 - v) + upper * v)
