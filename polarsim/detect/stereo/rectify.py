"""A rig's pictures rotated and bent so that the same point lies in the same row of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.errors import DetectError
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig


@dataclass(frozen=True)
class Rectification:
    """The left camera as a pinhole whose rows are those of the right one, and where its pixels lie in the pictures."""

    lens: Lens  # of the rectified left picture
    left_from_rectified: Pose
    baseline: float  # metres from the left camera to the right one, along x
    left_maps: tuple[np.ndarray, np.ndarray]  # (h, w) float32 x and y for `cv2.remap`, in the shrunken left picture
    right_maps: tuple[np.ndarray, np.ndarray]

    def disparity(self, depth: np.ndarray | float) -> np.ndarray:
        """Pixels by which a point at a depth (metres along z) lies farther left in the right picture."""
        return self.lens.fx * self.baseline / np.asarray(depth)


def rectify(rig: StereoRig, scale: float) -> Rectification:
    """Bouguet's rectification (`cv2.stereoRectify`, alpha 0) of pictures that are `scale` times as large as photos.

    Raises
    ------
    DetectError
        The right camera does not stand to the right of the left one.
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
        raise DetectError(f"the right camera stands {-baseline:.3f} m to the left of the left one, no rig for stereo")
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
