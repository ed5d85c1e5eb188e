"""Small windows found again to a fraction of a pixel, in the photo of a shaded view or in that of the right camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays import Caster
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

_BLUR_PX = 1.0  # sd: photon noise and the edges of triangles are smaller than what is matched
_CLIPPED = 0.95  # of the white level: brighter pixels tell no shape
_MOST_CLIPPED = 0.2  # share of such pixels in a window
_FLAT = 1e-6  # range of a window that shows nothing
_LEAST_BEND = 1e-3  # of a correlation's peak: along a ridge it has none, and tells nothing
_LEAST_UNLIKENESS = 0.01  # what is left of 1 for the best correlation: no photo is the shaded view
SHOWN_SHARE = 0.9  # of a window that both cameras must see
CONTRAST_DN = 40  # between the brightest and the darkest pixel of a window, for it to be looked for: more than noise
NEARER = 0.998  # of the way to a point: what stands before that hides it


@dataclass(frozen=True)
class Window:
    """Sizes of windows, pixels of the shaded view."""

    half: int  # a window reaches so far to each side
    search: int  # and is looked for so far away
    step: int  # between the centres of neighbouring windows
    likeness: float  # least correlation with the photo
    noise: float  # standard deviation of a window's position over sqrt((1 - correlation) / bend of the correlation)


@dataclass(frozen=True)
class MatchedWindows:
    """Windows that were found, in pixels of the shaded view.

    A window on an edge tells its position across the edge and hardly along it. That shows in how the correlation bends
    at its peak.
    """

    pixel: np.ndarray  # (n, 2) centres in the shaded view
    seen: np.ndarray  # (n, 2) and in the photo
    whitening: np.ndarray  # (n, 2, 2) turns an offset, px, into two of standard deviation 1
    tried: int  # windows that were looked for


def find(shaded: np.ndarray, photo: np.ndarray, usable: np.ndarray, window: Window) -> MatchedWindows:
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

    shaded, photo = np.asarray(shaded, np.float32), np.asarray(photo, np.float32)
    ours = cv2.GaussianBlur(shaded, (0, 0), _BLUR_PX)  # no roots: in them penumbras look shorter
    theirs = cv2.GaussianBlur(np.maximum(photo - BLACK_LEVEL, 0), (0, 0), _BLUR_PX)
    half, reach = window.half, window.half + window.search
    size = 2 * half + 1
    clipped = cv2.blur((photo > _CLIPPED * WHITE_LEVEL).astype(np.float32), (size, size))
    y, x = (part.ravel() for part in np.mgrid[tuple(slice(reach + 2, n - reach - 2, window.step) for n in ours.shape)])
    around = np.ones((size, size), np.uint8)
    spread = cv2.dilate(ours, around) - cv2.erode(ours, around)
    free = usable[y, x] & (clipped[y, x] < _MOST_CLIPPED) & (spread[y, x] > _FLAT)
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
    """Peaks of correlations, given (n, 3, 3) about their largest values: offsets (n, 2) from the centre, whitenings.

    Those of the parabola through the centre and its neighbours; never further than a pixel along its axes.
    """
    centre = likeness[:, 1, 1]
    slope = np.stack([likeness[:, 1, 2] - likeness[:, 1, 0], likeness[:, 2, 1] - likeness[:, 0, 1]], axis=1) / 2
    bend = np.empty((len(likeness), 2, 2))
    bend[:, 0, 0] = 2 * centre - likeness[:, 1, 2] - likeness[:, 1, 0]
    bend[:, 1, 1] = 2 * centre - likeness[:, 2, 1] - likeness[:, 0, 1]
    mixed = likeness[:, 0, 2] + likeness[:, 2, 0] - likeness[:, 0, 0] - likeness[:, 2, 2]
    bend[:, 0, 1] = bend[:, 1, 0] = mixed / 4
    bends, axes = np.linalg.eigh(bend)
    bends = np.maximum(bends, _LEAST_BEND)
    along = np.clip(np.einsum("nki,nk->ni", axes, slope) / bends, -1, 1)
    sharpness = np.sqrt(bends / np.maximum(1 - centre, _LEAST_UNLIKENESS)[:, None]) / noise
    return np.einsum("nki,ni->nk", axes, along), np.einsum("nki,ni,nli->nkl", axes, sharpness, axes)


@dataclass(frozen=True)
class BothSeen:
    """What the left camera's pixels show, and where the right camera has it."""

    points_left: np.ndarray  # (h, w, 3) left frame, metres; NaN where nothing is met
    in_right: np.ndarray  # (h, w, 2) float32 pixels of the right photo; NaN where it does not show the point


@dataclass(frozen=True)
class Ties:
    """Windows that were found in both photos, in pixels of these."""

    points_left: np.ndarray  # (n, 3) what their centres show, left frame, metres
    left: np.ndarray  # (n, 2)
    expected: np.ndarray  # (n, 2) where the right photo should show them
    right: np.ndarray  # (n, 2) and where it does
    whitening: np.ndarray  # (n, 2, 2) turns an offset in the right photo, px, into two of standard deviation 1
    tried: int  # windows with some contrast that both photos should show


def look_with_both(rays: Caster, sandbox_from_left: Pose, rig: StereoRig) -> BothSeen:
    """Cast a ray through every pixel of the left photo, and look from the right camera at what it meets."""
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
    return BothSeen(all_points.reshape(*lens.shape, 3), in_right.reshape(*lens.shape, 2))


def find_ties(seen: BothSeen, left: np.ndarray, right: np.ndarray, window: Window) -> Ties:
    """Look for windows of the left photo in the right one, laid on it by the scene's shape.

    Parameters
    ----------
    left, right : (h, w) float32
        Grey values, black level included, of the sizes that `seen` was made for.
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
    found = find(np.maximum(left - BLACK_LEVEL, 0).astype(np.float32), laid, usable, window)
    column, row = found.pixel.astype(int).T
    expected = seen.in_right[row, column].astype(float)
    peak = _between_pixels(seen.in_right, found.seen)
    moved = np.where(np.isfinite(peak), peak, expected + found.seen - found.pixel)  # beside what both see: as it is
    return Ties(
        seen.points_left[row, column],
        found.pixel,
        expected,
        moved,
        found.whitening,
        found.tried,
    )


def _between_pixels(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(n, k) values of an image (h, w, k) at pixels (n, 2), bilinear between four that are inside of it."""
    at = np.clip(pixels - HALF_PIXEL, 0, np.array(image.shape[1::-1]) - 1.001)
    (x, y), (a, b) = at.astype(int).T, (at % 1).T[:, :, None]
    upper = image[y, x] * (1 - a) + image[y, x + 1] * a
    lower = image[y + 1, x] * (1 - a) + image[y + 1, x + 1] * a
    return np.asarray(upper * (1 - b) + lower * b)
