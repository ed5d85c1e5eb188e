"""Operations on many vectors (n, 3), column by column: NumPy is slow if the last axis has only three elements.

Select rows with `vectors.take(numbers, axis=0)`: four times as fast as `vectors[numbers]`.
"""

from __future__ import annotations

import numpy as np


def dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return scalar products (n,) of vectors (n, 3)."""
    return first[:, 0] * second[:, 0] + first[:, 1] * second[:, 1] + first[:, 2] * second[:, 2]


def length(vectors: np.ndarray) -> np.ndarray:
    """Return lengths (n,) of vectors (n, 3)."""
    return np.asarray(np.sqrt(dot(vectors, vectors)))


def normalise(vectors: np.ndarray) -> np.ndarray:
    """Normalise vectors (n, 3); vectors of length zero are not changed."""
    square = dot(vectors, vectors)
    return scale_vectors(vectors, 1 / np.sqrt(np.where(square > 0, square, square.dtype.type(1))))


def scale_vectors(vectors: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Multiply vectors (n, 3) by factors (n,)."""
    out = np.empty((len(vectors), 3), np.result_type(vectors, factor))
    for axis in range(3):
        np.multiply(vectors[:, axis], factor, out=out[:, axis])
    return out


def cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return cross products (n, 3)."""
    (ax, ay, az), (bx, by, bz) = first.T, second.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """Return matrices (n, 3, 3) of cross products with vectors (n, 3)."""
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2] = -z, y, -x
    matrices[:, 1, 0], matrices[:, 2, 0], matrices[:, 2, 1] = z, -y, x
    return matrices


def points_along(origins: np.ndarray, directions: np.ndarray, distance: np.ndarray | np.floating) -> np.ndarray:
    """Return points (n, 3) at distances (n,) or scalar along directions (n, 3) from origins (3,) or (n, 3)."""
    out = np.empty(directions.shape, np.result_type(origins, directions, distance))
    for axis in range(3):
        out[:, axis] = origins[..., axis] + distance * directions[:, axis]
    return out
