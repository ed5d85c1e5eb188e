"""Stereo rectification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.errors import DetectError
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig


@dataclass(frozen=True)
class Rectification:
    """Rectified left camera (pinhole) and pixel maps of both images."""

    lens: Lens  # lens of the rectified left image
    left_from_rectified: Pose
    baseline: float  # distance of the cameras along x, metres
    left_maps: tuple[np.ndarray, np.ndarray]  # (h, w) float32 x and y for `cv2.remap`, px of the scaled left image
    right_maps: tuple[np.ndarray, np.ndarray]

    def disparity(self, depth: np.ndarray | float) -> np.ndarray:
        """Return the disparity of a point at a depth (metres along z), px."""
        return self.lens.fx * self.baseline / np.asarray(depth)


def rectify(rig: StereoRig, scale: float) -> Rectification:
    """Compute the rectification by Bouguet (`cv2.stereoRectify`, alpha 0) of images scaled by `scale`.

    A right camera that is not to the right of the left camera is an error.
    """
    import cv2

    left, right = rig.left.scaled(scale), rig.right.scaled(scale)
    size = (left.width, left.height)
    right_from_left = rig.left_from_right.inverse()
    left_rotation, right_rotation, left_projection, right_projection, *_ = cv2.stereoRectify(
        left.opencv_matrix(),
        np.array(left.distortion),
        right.opencv_matrix(),
        np.array(right.distortion),
        size,
        right_from_left.rotation,
        right_from_left.translation[:, None],
        flags=cv2.CALIB_ZERO_DISPARITY,
        alpha=0,
    )
    baseline = -float(right_projection[0, 3] / right_projection[0, 0])
    if not baseline > 0:
        raise DetectError(f"the right camera is {-baseline:.3f} m to the left of the left camera; check the rig pose")
    maps = [
        cv2.initUndistortRectifyMap(
            lens.opencv_matrix(), np.array(lens.distortion), rotation, projection[:, :3], size, cv2.CV_32FC1
        )
        for lens, rotation, projection in (
            (left, left_rotation, left_projection),
            (right, right_rotation, right_projection),
        )
    ]
    return Rectification(
        Lens.from_opencv(left_projection[:, :3], np.zeros(4), size),
        Pose(np.asarray(left_rotation, float).T, np.zeros(3)),
        baseline,
        *((np.asarray(x), np.asarray(y)) for x, y in maps),
    )
