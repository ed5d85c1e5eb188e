"""Stereo rig: two lenses and the pose between them, the rectified left grid of range maps, and epipolar geometry.

Epipolar geometry: Hartley and Zisserman, Multiple View Geometry, chapters 9 to 12.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.photo import CameraSide


@dataclass(frozen=True)
class StereoRig:
    """Left and right lens, and the pose of the right camera in the left camera frame.

    A single camera is the left camera; `right` and `left_from_right` then repeat it.
    """

    left: Lens
    right: Lens
    left_from_right: Pose

    @classmethod
    def single(cls, lens: Lens) -> StereoRig:
        """Create a rig with a single camera."""
        return cls(lens, lens, Pose.identity())

    @property
    def is_stereo(self) -> bool:
        """Whether the rig has two cameras."""
        return bool(np.any(self.left_from_right.translation))

    @property
    def sides(self) -> tuple[CameraSide, ...]:
        """Names of the cameras."""
        return ("L", "R") if self.is_stereo else ("L",)

    def lens(self, camera: str) -> Lens:
        return self.left if camera == "L" else self.right

    def left_from(self, camera: str) -> Pose:
        """Return the pose of camera L or R in the left camera frame."""
        return Pose.identity() if camera == "L" else self.left_from_right


@dataclass(frozen=True)
class RectifiedGrid:
    """Rectified left camera: a pinhole without distortion, rotated about the left camera's centre."""

    lens: Lens
    left_from_rectified: Pose


def rectified_left(rig: StereoRig) -> RectifiedGrid:
    """Return the grid of NASA's range maps: `cv2.stereoRectify` with alpha = 1 and default flags.

    The grid of a single camera is the lens without distortion.
    """
    if not rig.is_stereo:
        return RectifiedGrid(replace(rig.left, distortion=(0.0, 0.0, 0.0, 0.0, 0.0)), Pose.identity())
    import cv2

    right_from_left = rig.left_from_right.inverse()
    size = (rig.left.width, rig.left.height)
    rotation, _, projection, *_ = cv2.stereoRectify(
        rig.left.opencv_matrix(),
        np.array(rig.left.distortion),
        rig.right.opencv_matrix(),
        np.array(rig.right.distortion),
        size,
        right_from_left.rotation,
        right_from_left.translation[:, None],
        alpha=1,
    )
    return RectifiedGrid(
        Lens.from_opencv(projection[:, :3], np.zeros(4), size), Pose(np.asarray(rotation, float).T, np.zeros(3))
    )


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
