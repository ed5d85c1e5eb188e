"""Resizing of images."""

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
