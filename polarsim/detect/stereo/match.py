"""Depth of a rectified pair by semi-global matching."""

from __future__ import annotations

import math

import numpy as np

from polarsim.detect.stereo.rectify import Rectification

_STEP = 16  # OpenCV: the number of disparities is a multiple of 16, their unit is 1/16 px
_BLOCK = 5  # side of the compared windows, px
_UNIQUE_PERCENT, _LEFT_RIGHT_PX, _SPECKLE_PX, _SPECKLE_STEP = 10, 1, 100, 2  # as in the OpenCV examples


def match_stereo(
    left: np.ndarray, right: np.ndarray, rig: Rectification, nearest_m: float, farthest_m: float
) -> np.ndarray:
    """Return depth (h, w) float32 along z in the frame of the rectified left camera, metres; NaN without a match.

    Semi-global block matching (Hirschmueller, IEEE TPAMI 30 (2008) 328; `StereoSGBM` of OpenCV) of unrectified images
    (h, w) uint8 between the disparities of the minimum and the maximum depth.
    """
    import cv2

    sides = [
        cv2.remap(picture, x, y, cv2.INTER_LINEAR)
        for picture, (x, y) in ((left, rig.left_maps), (right, rig.right_maps))
    ]
    min_disparity = math.floor(float(rig.disparity(farthest_m)))
    count = _STEP * math.ceil((float(rig.disparity(nearest_m)) - min_disparity) / _STEP)
    margin = min_disparity + count  # padding, since OpenCV skips this number of columns
    first, second = (cv2.copyMakeBorder(side, 0, 0, margin, 0, cv2.BORDER_REPLICATE) for side in sides)
    matcher = cv2.StereoSGBM.create(
        minDisparity=min_disparity,
        numDisparities=count,
        blockSize=_BLOCK,
        P1=8 * _BLOCK**2,
        P2=32 * _BLOCK**2,
        disp12MaxDiff=_LEFT_RIGHT_PX,
        uniquenessRatio=_UNIQUE_PERCENT,
        speckleWindowSize=_SPECKLE_PX,
        speckleRange=_SPECKLE_STEP,
        # Eight directions. The default five directions do not include paths from below, which biases the disparity of
        # receding ground by 0.3 to 0.5 px.
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    disparity = matcher.compute(first, second)[:, margin:].astype(np.float32) / _STEP
    depth = np.full(disparity.shape, np.nan, np.float32)
    matched = disparity > max(min_disparity - 1, 0)
    matched &= disparity <= np.arange(disparity.shape[1])  # inside the right image
    depth[matched] = rig.lens.fx * rig.baseline / disparity[matched]
    return depth
