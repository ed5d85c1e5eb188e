"""Sub-pixel matching of small windows: between shaded views and photos, and between left and right photos."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.images import bilinear
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays import Caster
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

_BLUR_PX = 1.0  # sd: larger than photon noise and the edges of triangles
_CLIPPED = 0.95  # of the white level: brighter pixels have no texture
_MAX_CLIPPED = 0.2  # maximum share of such pixels in a window
_MIN_RANGE = 1e-6  # range of a window without texture
_MIN_CURVATURE = 1e-3  # minimum second derivative at a correlation's peak; along a ridge the peak is undefined
_MIN_UNLIKENESS = 0.01  # minimum of 1 - correlation: no photo equals the shaded view
SHOWN_SHARE = 0.9  # minimum share of a window that is visible to both cameras
CONTRAST_DN = 40  # minimum difference between the brightest and the darkest pixel of a window; above noise
NEARER = 0.998  # of the distance to a point: nearer surfaces occlude the point


@dataclass(frozen=True)
class MatchingOptions:
    """Sizes of windows, pixels of the shaded view."""

    half: int  # half size of a window
    search: int  # maximum displacement
    step: int  # distance between the centres of neighbouring windows
    likeness: float  # minimum correlation with the photo
    noise: float  # standard deviation of a window's position over sqrt((1 - correlation) / second derivative)


@dataclass(frozen=True)
class MatchedWindows:
    """Matched windows, in pixels of the shaded view.

    The position of a window on an edge is accurate across the edge only, as the second derivative of the correlation
    shows.
    """

    pixel: np.ndarray  # (n, 2) centres in the shaded view
    seen: np.ndarray  # (n, 2) centres in the photo
    whitening: np.ndarray  # (n, 2, 2) converts an offset, px, to two components of standard deviation 1
    tried: int  # number of searched windows


def match_windows(shaded: np.ndarray, photo: np.ndarray, usable: np.ndarray, window: MatchingOptions) -> MatchedWindows:
    """Match windows of the shaded view with a photo.

    `shaded` (h, w): radiance in any unit.
    `photo` (h, w): grey values of the same view, shrunk to the size of the shaded view, black level included.
    `usable` (h, w): pixels that may be centres of windows.
    """
    import cv2

    shaded, photo = np.asarray(shaded, np.float32), np.asarray(photo, np.float32)
    ours = cv2.GaussianBlur(shaded, (0, 0), _BLUR_PX)  # linear radiance: square roots would narrow penumbras
    theirs = cv2.GaussianBlur(np.maximum(photo - BLACK_LEVEL, 0), (0, 0), _BLUR_PX)
    half, reach = window.half, window.half + window.search
    size = 2 * half + 1
    clipped = cv2.blur((photo > _CLIPPED * WHITE_LEVEL).astype(np.float32), (size, size))
    y, x = (part.ravel() for part in np.mgrid[tuple(slice(reach + 2, n - reach - 2, window.step) for n in ours.shape)])
    around = np.ones((size, size), np.uint8)
    spread = cv2.dilate(ours, around) - cv2.erode(ours, around)
    free = usable[y, x] & (clipped[y, x] < _MAX_CLIPPED) & (spread[y, x] > _MIN_RANGE)
    centres, corners, peaks = [], [], []
    for row, column in zip(y[free], x[free], strict=True):
        wanted = ours[row - half : row + half + 1, column - half : column + half + 1]
        area = theirs[row - reach : row + reach + 1, column - reach : column + reach + 1]
        likeness = cv2.matchTemplate(area, wanted, cv2.TM_CCOEFF_NORMED)
        down, across = divmod(int(likeness.argmax()), likeness.shape[1])
        if likeness[down, across] < window.likeness or not _inside(down, across, likeness.shape):
            continue
        centres.append((column + HALF_PIXEL, row + HALF_PIXEL))
        corners.append((across - window.search, down - window.search))
        peaks.append(likeness[down - 1 : down + 2, across - 1 : across + 2].astype(float))
    pixel = np.array(centres).reshape(-1, 2)
    move, whitening = _peaks_of(np.array(peaks).reshape(-1, 3, 3), window.noise)
    return MatchedWindows(pixel, pixel + np.array(corners, float).reshape(-1, 2) + move, whitening, int(free.sum()))


def _inside(row: int, column: int, shape: tuple[int, ...]) -> bool:
    return 0 < row < shape[0] - 1 and 0 < column < shape[1] - 1


def _peaks_of(likeness: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return peaks of correlations, given (n, 3, 3) around their maxima: offsets (n, 2) from the centre, whitenings.

    They are peaks of the parabola through the centre and its neighbours, at most a pixel away along its axes.
    """
    centre = likeness[:, 1, 1]
    slope = np.stack([likeness[:, 1, 2] - likeness[:, 1, 0], likeness[:, 2, 1] - likeness[:, 0, 1]], axis=1) / 2
    bend = np.empty((len(likeness), 2, 2))
    bend[:, 0, 0] = 2 * centre - likeness[:, 1, 2] - likeness[:, 1, 0]
    bend[:, 1, 1] = 2 * centre - likeness[:, 2, 1] - likeness[:, 0, 1]
    mixed = likeness[:, 0, 2] + likeness[:, 2, 0] - likeness[:, 0, 0] - likeness[:, 2, 2]
    bend[:, 0, 1] = bend[:, 1, 0] = mixed / 4
    bends, axes = np.linalg.eigh(bend)
    bends = np.maximum(bends, _MIN_CURVATURE)
    along = np.clip(np.einsum("nki,nk->ni", axes, slope) / bends, -1, 1)
    sharpness = np.sqrt(bends / np.maximum(1 - centre, _MIN_UNLIKENESS)[:, None]) / noise
    return np.einsum("nki,ni->nk", axes, along), np.einsum("nki,ni,nli->nkl", axes, sharpness, axes)


@dataclass(frozen=True)
class StereoHits:
    """Points at the left camera's pixels, and their projection to the right camera."""

    points_left: np.ndarray  # (h, w, 3) left frame, metres; NaN without a hit
    in_right: np.ndarray  # (h, w, 2) float32 pixels of the right photo; NaN for points that it does not show


@dataclass(frozen=True)
class StereoMatches:
    """Windows that were matched in both photos, in pixels of these photos."""

    points_left: np.ndarray  # (n, 3) points at their centres, left frame, metres
    left: np.ndarray  # (n, 2)
    expected: np.ndarray  # (n, 2) projections to the right photo
    right: np.ndarray  # (n, 2) measured positions in the right photo
    whitening: np.ndarray  # (n, 2, 2) converts an offset in the right photo, px, to components of standard deviation 1
    tried: int  # windows with enough contrast that both photos should show


def cast_stereo(rays: Caster, sandbox_from_left: Pose, rig: StereoRig) -> StereoHits:
    """Cast a ray through every pixel of the left photo, and project the hits to the right camera."""
    lens = rig.left
    directions = sandbox_from_left.rotate(lens.pixel_directions()).reshape(-1, 3).astype(np.float32)
    distance, _ = rays.nearest(np.broadcast_to(sandbox_from_left.translation, directions.shape), directions)
    hit = np.flatnonzero(np.isfinite(distance))
    points = sandbox_from_left.translation + distance[hit, None] * directions[hit]
    eye = (sandbox_from_left @ rig.left_from_right).translation
    points_left = sandbox_from_left.inverse().apply(points)
    pixels = rig.right.project(rig.left_from_right.inverse().apply(points_left))
    inside = ((pixels > 0) & (pixels < [rig.right.width, rig.right.height])).all(axis=1)
    shown = np.flatnonzero(inside)
    shown = shown[~rays.occluded(np.broadcast_to(eye, (len(shown), 3)), points[shown] - eye, NEARER)]
    all_points = np.full((lens.height * lens.width, 3), np.nan)
    in_right = np.full((lens.height * lens.width, 2), np.nan, np.float32)
    all_points[hit], in_right[hit[shown]] = points_left, pixels[shown]
    return StereoHits(all_points.reshape(*lens.shape, 3), in_right.reshape(*lens.shape, 2))


def match_stereo_windows(
    seen: StereoHits, left: np.ndarray, right: np.ndarray, window: MatchingOptions
) -> StereoMatches:
    """Match windows of the left photo with the right photo, warped by the shape of the scene.

    `left`, `right` (h, w): grey values, black level included, of the sizes of `seen`.
    """
    import cv2

    shown = np.isfinite(seen.in_right[..., 0])
    in_opencv = seen.in_right - HALF_PIXEL
    x, y = (np.where(shown, in_opencv[..., k], -1).astype(np.float32) for k in (0, 1))
    laid = cv2.remap(right.astype(np.float32), x, y, cv2.INTER_LINEAR, borderValue=BLACK_LEVEL)
    size = 2 * window.half + 1
    around = np.ones((size, size), np.uint8)
    smooth = cv2.GaussianBlur(left.astype(np.float32), (0, 0), 1.0)
    usable = cv2.dilate(smooth, around) - cv2.erode(smooth, around) > CONTRAST_DN
    usable &= shown & (cv2.blur(shown.astype(np.float32), (size, size)) > SHOWN_SHARE)
    windows = match_windows(np.maximum(left - BLACK_LEVEL, 0).astype(np.float32), laid, usable, window)
    column, row = windows.pixel.astype(int).T
    expected = seen.in_right[row, column].astype(float)
    peak = between_pixels(seen.in_right, windows.seen)
    moved = np.where(np.isfinite(peak), peak, expected + windows.seen - windows.pixel)  # unchanged outside common parts
    return StereoMatches(
        seen.points_left[row, column],
        windows.pixel,
        expected,
        moved,
        windows.whitening,
        windows.tried,
    )


def between_pixels(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return values (n[, k]) of an image (h, w[, k]) at pixels (n, 2), bilinear between four pixels inside."""
    return bilinear(image, *(pixels - HALF_PIXEL).T)
