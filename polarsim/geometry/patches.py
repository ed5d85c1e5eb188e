"""Small windows of a shaded view found again in its photo, to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

_BLUR_PX = 1.0  # sd: photon noise and the edges of triangles are smaller than what is matched
_CLIPPED = 0.95  # of the white level: brighter pixels tell no shape
_MOST_CLIPPED = 0.2  # share of such pixels in a window
_FLAT = 1e-6  # range of a window that shows nothing
_LEAST_BEND = 1e-3  # of a correlation's peak: along a ridge it has none, and tells nothing
_LEAST_UNLIKENESS = 0.01  # what is left of 1 for the best correlation: no photo is the shaded view


@dataclass(frozen=True)
class Window:
    """Sizes of windows, pixels of the shaded view."""

    half: int  # a window reaches so far to each side
    search: int  # and is looked for so far away
    step: int  # between the middles of neighbouring windows
    likeness: float  # least correlation with the photo
    noise: float  # standard deviation of a window's place over sqrt((1 - correlation) / bend of the correlation)


@dataclass(frozen=True)
class Found:
    """Windows that were found, in pixels of the shaded view.

    A window on an edge tells its place across the edge and hardly along it. That shows in how the correlation bends at
    its peak.
    """

    pixel: np.ndarray  # (n, 2) middles in the shaded view
    seen: np.ndarray  # (n, 2) and in the photo
    whitening: np.ndarray  # (n, 2, 2) turns an offset, px, into two of standard deviation 1
    tried: int  # windows that were looked for


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

    ours = cv2.GaussianBlur(shaded, (0, 0), _BLUR_PX)  # no roots: in them penumbras look shorter
    theirs = cv2.GaussianBlur(np.maximum(photo - BLACK_LEVEL, 0), (0, 0), _BLUR_PX)
    half, reach = window.half, window.half + window.search
    size = 2 * half + 1
    clipped = cv2.blur((photo > _CLIPPED * WHITE_LEVEL).astype(np.float32), (size, size))
    y, x = (part.ravel() for part in np.mgrid[tuple(slice(reach + 2, n - reach - 2, window.step) for n in ours.shape)])
    around = np.ones((size, size), np.uint8)
    spread = cv2.dilate(ours, around) - cv2.erode(ours, around)
    free = usable[y, x] & (clipped[y, x] < _MOST_CLIPPED) & (spread[y, x] > _FLAT)
    middles, corners, peaks = [], [], []
    for row, column in zip(y[free], x[free], strict=True):
        wanted = ours[row - half : row + half + 1, column - half : column + half + 1]
        area = theirs[row - reach : row + reach + 1, column - reach : column + reach + 1]
        likeness = cv2.matchTemplate(area, wanted, cv2.TM_CCOEFF_NORMED)
        down, across = divmod(int(likeness.argmax()), likeness.shape[1])
        if likeness[down, across] < window.likeness or not _inside(down, across, likeness.shape):
            continue
        middles.append((column + HALF_PIXEL, row + HALF_PIXEL))
        corners.append((across - window.search, down - window.search))
        peaks.append(likeness[down - 1 : down + 2, across - 1 : across + 2].astype(float))
    pixel = np.array(middles).reshape(-1, 2)
    move, whitening = _peaks_of(np.array(peaks).reshape(-1, 3, 3), window.noise)
    return Found(pixel, pixel + np.array(corners, float).reshape(-1, 2) + move, whitening, int(free.sum()))


def _inside(row: int, column: int, shape: tuple[int, ...]) -> bool:
    return 0 < row < shape[0] - 1 and 0 < column < shape[1] - 1


def _peaks_of(likeness: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Peaks of correlations, given (n, 3, 3) about their largest values: places (n, 2) from the middle, whitenings.

    Those of the parabola through the middle and its neighbours; never further than a pixel along its axes.
    """
    middle = likeness[:, 1, 1]
    slope = np.stack([likeness[:, 1, 2] - likeness[:, 1, 0], likeness[:, 2, 1] - likeness[:, 0, 1]], axis=1) / 2
    bend = np.empty((len(likeness), 2, 2))
    bend[:, 0, 0] = 2 * middle - likeness[:, 1, 2] - likeness[:, 1, 0]
    bend[:, 1, 1] = 2 * middle - likeness[:, 2, 1] - likeness[:, 0, 1]
    mixed = likeness[:, 0, 2] + likeness[:, 2, 0] - likeness[:, 0, 0] - likeness[:, 2, 2]
    bend[:, 0, 1] = bend[:, 1, 0] = mixed / 4
    bends, axes = np.linalg.eigh(bend)
    bends = np.maximum(bends, _LEAST_BEND)
    along = np.clip(np.einsum("nki,nk->ni", axes, slope) / bends, -1, 1)
    sharpness = np.sqrt(bends / np.maximum(1 - middle, _LEAST_UNLIKENESS)[:, None]) / noise
    return np.einsum("nki,ni->nk", axes, along), np.einsum("nki,ni,nli->nkl", axes, sharpness, axes)
