"""Small windows of a shaded view found again in its photo, to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

_BLUR_PX = 1.0  # sd: photon noise and the edges of triangles are smaller than what is matched
_CLIPPED = 0.95  # of the white level: brighter pixels tell no shape
_MOST_CLIPPED = 0.2  # share of such pixels in a window
_RICHEST = 0.5  # share of the windows that is tried, those with most structure in both directions


@dataclass(frozen=True)
class Window:
    """Sizes of windows, pixels of the shaded view."""

    half: int  # a window reaches so far to each side
    search: int  # and is looked for so far away
    step: int  # between the middles of neighbouring windows
    likeness: float  # least correlation with the photo


@dataclass(frozen=True)
class Found:
    """Windows that were found: middles (n, 2) in the shaded view, and those in the photo; pixels of the shaded view."""

    pixel: np.ndarray
    seen: np.ndarray


def find(shaded: np.ndarray, photo: np.ndarray, usable: np.ndarray, window: Window) -> Found:
    """Look for windows of the shaded view in a photo.

    Parameters
    ----------
    shaded : (h, w) float32
        Radiance in any unit.
    photo : (h, w) float32
        Grey values of the same view, shrunk to the shaded view's size, black level included.
    usable : (h, w) bool
        Pixels that windows may be centred on.
    """
    import cv2

    ours = cv2.GaussianBlur(np.sqrt(shaded), (0, 0), _BLUR_PX)  # root: noise of photons is alike everywhere
    theirs = cv2.GaussianBlur(np.sqrt(np.maximum(photo - BLACK_LEVEL, 0)), (0, 0), _BLUR_PX)
    half, reach = window.half, window.half + window.search
    size = 2 * half + 1
    clipped = cv2.blur((photo > _CLIPPED * WHITE_LEVEL).astype(np.float32), (size, size))
    structure = cv2.cornerMinEigenVal(ours, size)
    y, x = (part.ravel() for part in np.mgrid[tuple(slice(reach + 2, n - reach - 2, window.step) for n in ours.shape)])
    free = usable[y, x] & (clipped[y, x] < _MOST_CLIPPED) & (structure[y, x] > 0)
    y, x = y[free], x[free]
    if not len(x):
        return Found(np.zeros((0, 2)), np.zeros((0, 2)))
    rich = structure[y, x] >= np.quantile(structure[y, x], 1 - _RICHEST)
    middles, moves = [], []
    for row, column in zip(y[rich], x[rich], strict=True):
        wanted = ours[row - half : row + half + 1, column - half : column + half + 1]
        area = theirs[row - reach : row + reach + 1, column - reach : column + reach + 1]
        move = _best_move(cv2.matchTemplate(area, wanted, cv2.TM_CCOEFF_NORMED), window.likeness)
        if move is not None:
            middles.append((column + 0.5, row + 0.5))
            moves.append(move)
    pixel = np.array(middles, float).reshape(-1, 2)
    return Found(pixel, pixel + np.array(moves, float).reshape(-1, 2))


def _best_move(likeness: np.ndarray, least: float) -> tuple[float, float] | None:
    """Where a correlation (n, n) has its peak, x and y from its middle, by parabolas; None for none inside."""
    row, column = np.unravel_index(int(likeness.argmax()), likeness.shape)
    last = len(likeness) - 1
    if likeness[row, column] < least or not (0 < row < last and 0 < column < last):
        return None
    middle = last / 2
    return (
        float(column - middle + _vertex(*likeness[row, column - 1 : column + 2])),
        float(row - middle + _vertex(*likeness[row - 1 : row + 2, column])),
    )


def _vertex(before: float, peak: float, after: float) -> float:
    """Where the parabola through three neighbouring values has its peak, from the middle one."""
    bend = before - 2 * peak + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0
