"""Depth of a rectified pair by semi-global matching."""

from __future__ import annotations

import math

import numpy as np

from polarsim.detect.stereo.rectify import Rectification

_STEP = 16  # OpenCV's disparities: their number is a multiple of it, their unit a sixteenth of a pixel
_BLOCK = 5  # px, side of the compared windows
_UNIQUE_PERCENT, _LEFT_RIGHT_PX, _SPECKLE_PX, _SPECKLE_STEP = 10, 1, 100, 2  # OpenCV's own examples


def match(left: np.ndarray, right: np.ndarray, rig: Rectification, nearest_m: float, farthest_m: float) -> np.ndarray:
    """(h, w) depth along z in the rectified left camera's frame, metres, float32; NaN where nothing is matched.

    Semi-global block matching (Hirschmueller, IEEE TPAMI 30 (2008) 328; OpenCV's `StereoSGBM`) between the disparities
    of the nearest and the farthest depth.

    Parameters
    ----------
    left, right : (h, w) uint8
        Pictures as large as `Rectification` expects, not rectified yet.
    """
    import cv2

    sides = [
        cv2.remap(picture, x, y, cv2.INTER_LINEAR)
        for picture, (x, y) in ((left, rig.left_maps), (right, rig.right_maps))
    ]
    least = math.floor(float(rig.disparity(farthest_m)))
    count = _STEP * math.ceil((float(rig.disparity(nearest_m)) - least) / _STEP)
    margin = least + count  # OpenCV leaves out as many columns: give it some that are not needed
    first, second = (cv2.copyMakeBorder(side, 0, 0, margin, 0, cv2.BORDER_REPLICATE) for side in sides)
    matcher = cv2.StereoSGBM.create(
        minDisparity=least,
        numDisparities=count,
        blockSize=_BLOCK,
        P1=8 * _BLOCK**2,
        P2=32 * _BLOCK**2,
        disp12MaxDiff=_LEFT_RIGHT_PX,
        uniquenessRatio=_UNIQUE_PERCENT,
        speckleWindowSize=_SPECKLE_PX,
        speckleRange=_SPECKLE_STEP,
        # All eight directions: of the usual five none comes from below, which puts ground that recedes up the picture
        # 0.3 to 0.5 px too far.
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    disparity = matcher.compute(first, second)[:, margin:].astype(np.float32) / _STEP
    depth = np.full(disparity.shape, np.nan, np.float32)
    matched = disparity > max(least - 1, 0)
    matched &= disparity <= np.arange(disparity.shape[1])  # else it lies beyond the right picture's edge
    depth[matched] = rig.lens.fx * rig.baseline / disparity[matched]
    return depth
