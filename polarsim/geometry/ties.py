"""Windows of the left photo found again in the right one, near to where a rig and the scene's shape put them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.patches import Window, find
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays import Caster
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BLACK_LEVEL

SHOWN_SHARE = 0.9  # of a window that both cameras must see
CONTRAST_DN = 40  # between the brightest and the darkest pixel of a window, for it to be looked for: more than noise
NEARER = 0.998  # of the way to a point: what stands before that hides it


@dataclass(frozen=True)
class BothSeen:
    """What the left camera's pixels show, and where the right camera has it."""

    points_left: np.ndarray  # (h, w, 3) left frame, metres; NaN where nothing is met
    in_right: np.ndarray  # (h, w, 2) float32 pixels of the right photo; NaN where it does not show the point


@dataclass(frozen=True)
class Ties:
    """Windows that were found in both photos, in pixels of these."""

    points_left: np.ndarray  # (n, 3) what their middles show, left frame, metres
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
    met = np.flatnonzero(np.isfinite(distance))
    points = sandbox_from_left.translation + distance[met, None] * directions[met]
    eye = (sandbox_from_left @ rig.left_from_right).translation
    points_left = sandbox_from_left.inverse().apply(points)
    pixels = rig.right.project(rig.left_from_right.inverse().apply(points_left))
    inside = ((pixels > 0) & (pixels < [rig.right.width, rig.right.height])).all(axis=1)
    shown = np.flatnonzero(inside)
    shown = shown[~rays.occluded(np.broadcast_to(eye, (len(shown), 3)), points[shown] - eye, NEARER)]
    all_points = np.full((lens.height * lens.width, 3), np.nan)
    in_right = np.full((lens.height * lens.width, 2), np.nan, np.float32)
    all_points[met], in_right[met[shown]] = points_left, pixels[shown]
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
    place = _between_pixels(seen.in_right, found.seen)
    moved = np.where(np.isfinite(place), place, expected + found.seen - found.pixel)  # beside what both see: as it is
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
