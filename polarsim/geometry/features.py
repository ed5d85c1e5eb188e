"""SIFT features of images and their matches (Lowe, IJCV 60 (2004) 91)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL

_MAX_RATIO = 0.8  # of the distances to the best and to the second best match (Lowe's ratio test)


@dataclass(frozen=True)
class Features:
    """Features of an image: pixels (n, 2), and descriptors (n, 128)."""

    pixels: np.ndarray
    descriptors: np.ndarray


def sift_features(grey: np.ndarray, max_count: int) -> Features:
    """Return at most about `max_count` SIFT features of an image (h, w) uint8."""
    import cv2

    points, descriptors = cv2.SIFT.create(max_count).detectAndCompute(np.ascontiguousarray(grey), None)
    if descriptors is None:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32))
    return Features(np.array([point.pt for point in points]) + HALF_PIXEL, descriptors)


def match_features(one: Features, other: Features) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices (m,), (m,) of features that are each other's best match and pass the ratio test."""
    import cv2

    if min(len(one.pixels), len(other.pixels)) < 2:
        return np.empty(0, int), np.empty(0, int)

    def best(a: Features, b: Features) -> dict[int, int]:
        pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(a.descriptors, b.descriptors, k=2)
        near = ((first, second) for first, second in pairs if first.distance < _MAX_RATIO * second.distance)
        return {first.queryIdx: first.trainIdx for first, _ in near}

    back = best(other, one)
    mutual = [(a, b) for a, b in best(one, other).items() if back.get(b) == a]
    first, second = np.array(mutual, int).reshape(-1, 2).T
    return first, second
