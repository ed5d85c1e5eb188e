"""Epipolar geometry of a calibrated stereo pair (Hartley and Zisserman, Multiple View Geometry, chapters 9 to 12)."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.stereo import StereoRig


def epipolar_distances(rig: StereoRig, left_px: np.ndarray, right_px: np.ndarray) -> np.ndarray:
    """Return the Sampson distance (n,), pixels, of pairs of pixels (n, 2) of the left and the right image.

    0 for the two images of one point under the calibration of the rig.
    """
    left, right = rig.left.directions(left_px), rig.right.directions(right_px)
    right_from_left = rig.left_from_right.inverse()
    x, y, z = right_from_left.translation
    essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ right_from_left.rotation
    line_right, line_left = left @ essential.T, right @ essential
    residual = np.sum(right * line_right, axis=1)
    slope = np.sqrt(np.sum(line_right[:, :2] ** 2, axis=1) + np.sum(line_left[:, :2] ** 2, axis=1))
    return np.abs(residual) / slope * (rig.left.fx + rig.right.fx) / 2


def triangulated_depth(rig: StereoRig, left_px: np.ndarray, right_px: np.ndarray) -> np.ndarray:
    """Return the depth (n,) in the left camera, metres, at which the rays of pairs of pixels (n, 2) are nearest.

    The depth is negative for diverging rays (exchanged images or a wrong match), and infinite for parallel rays.
    """
    left = rig.left.directions(left_px)
    right = rig.left_from_right.rotate(rig.right.directions(right_px))
    baseline = rig.left_from_right.translation
    a, b, c = (np.sum(left * left, 1), np.sum(left * right, 1), np.sum(right * right, 1))
    d, e = left @ baseline, right @ baseline
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (c * d - b * e) / (a * c - b * b)  # left has z = 1, so that the factor of the ray is the depth
    return np.where(np.isnan(depth), np.inf, depth)
