"""Baseline of visual odometry: match features between consecutive stereo pairs and estimate the motion.

ORB features with mutual matches, depth by semi-global matching, motion by PnP with RANSAC and refinement, all by OpenCV
(after Nister, Naroditsky & Bergen, CVPR 2004). There is no map and no loop closure, so errors accumulate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from polarsim.detect.stereo.match import match_stereo
from polarsim.detect.stereo.rectify import Rectification
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.poses import Pose

_FEATURES = 1500
_REPROJECTION_PX, _ITERATIONS, _SEED = 1.0, 300, 0
_LEAST = 12  # minimum number of inliers of a motion
Pair = tuple[np.ndarray, np.ndarray]


def visual_odometry(
    pairs: Sequence[Pair], rig: Rectification, nearest_m: float, farthest_m: float
) -> tuple[list[Pose], int]:
    """Return `first_from_left` of the left camera of each pair, and the number of motions that were not found.

    A motion that was not found is replaced by the last motion.
    """
    import cv2

    poses, lost, move = [Pose.identity()], 0, Pose.identity()
    orb, matcher = cv2.ORB.create(nfeatures=_FEATURES), cv2.BFMatcher.create(cv2.NORM_HAMMING, True)
    before = None
    for left, right in pairs:
        keypoints, descriptors = orb.detectAndCompute(left, None)
        if before is not None:
            estimate = _move(before, keypoints, descriptors, matcher, rig)
            lost += estimate is None
            move = move if estimate is None else estimate
            poses.append(poses[-1] @ move)
        before = (keypoints, descriptors, match_stereo(left, right, rig, nearest_m, farthest_m))
    return poses, lost


def _move(
    before: tuple[Any, Any, np.ndarray], keypoints: Sequence[Any], descriptors: Any, matcher: Any, rig: Rectification
) -> Pose | None:
    """Return `before_from_now`, or None if it was not found."""
    import cv2

    old_points, old_descriptors, depth = before
    if descriptors is None or old_descriptors is None:
        return None
    matched = matcher.match(old_descriptors, descriptors)
    old = np.array([old_points[pair.queryIdx].pt for pair in matched]).reshape(-1, 2)
    new = np.array([keypoints[pair.trainIdx].pt for pair in matched]).reshape(-1, 2)
    column, row = np.rint(old).astype(int).T
    distance = depth[row.clip(0, depth.shape[0] - 1), column.clip(0, depth.shape[1] - 1)]
    known = np.isfinite(distance)
    if known.sum() < _LEAST:
        return None
    points = rig.lens.directions(old[known] + HALF_PIXEL) * distance[known, None]
    cv2.setRNGSeed(_SEED)
    fits, rotation, translation, inliers = cv2.solvePnPRansac(
        points, new[known], rig.lens.opencv_matrix(), None,
        iterationsCount=_ITERATIONS, reprojectionError=_REPROJECTION_PX,
    )  # fmt: skip
    if not fits or inliers is None or len(inliers) < _LEAST:
        return None
    chosen = inliers.ravel()
    rotation, translation = cv2.solvePnPRefineLM(
        points[chosen], new[known][chosen], rig.lens.opencv_matrix(), None, rotation, translation
    )
    return Pose.from_rotvec(rotation.ravel(), translation.ravel()).inverse()
