"""Visual odometry, a baseline: features of one pair of pictures found again in the next, and the move that fits them.

ORB features matched to and fro, their depth by semi-global matching, the move by PnP with RANSAC and refinement, all
OpenCV's (after Nister, Naroditsky & Bergen, CVPR 2004). No map, no closing of loops: errors add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from polarsim.detect.stereo.match import match
from polarsim.detect.stereo.rectify import Rectification
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.poses import Pose

_FEATURES = 1500
_REPROJECTION_PX, _ITERATIONS, _SEED = 1.0, 300, 0
_LEAST = 12  # matches that fit: fewer are no move
Pair = tuple[np.ndarray, np.ndarray]


def odometry(pairs: Sequence[Pair], rig: Rectification, nearest_m: float, farthest_m: float) -> tuple[list[Pose], int]:
    """`first_from_left` of every pair's left camera, and how many moves were not found (taken as the move before)."""
    import cv2

    poses, lost, move = [Pose.identity()], 0, Pose.identity()
    orb, matcher = cv2.ORB.create(nfeatures=_FEATURES), cv2.BFMatcher.create(cv2.NORM_HAMMING, True)
    before = None
    for left, right in pairs:
        keypoints, descriptors = orb.detectAndCompute(left, None)
        if before is not None:
            found = _move(before, keypoints, descriptors, matcher, rig)
            lost += found is None
            move = move if found is None else found
            poses.append(poses[-1] @ move)
        before = (keypoints, descriptors, match(left, right, rig, nearest_m, farthest_m))
    return poses, lost


def _move(
    before: tuple[Any, Any, np.ndarray], keypoints: Sequence[Any], descriptors: Any, matcher: Any, rig: Rectification
) -> Pose | None:
    """`before_from_now`."""
    import cv2

    old_points, old_descriptors, depth = before
    if descriptors is None or old_descriptors is None:
        return None
    matched = matcher.match(old_descriptors, descriptors)
    old = np.array([old_points[one.queryIdx].pt for one in matched]).reshape(-1, 2)
    new = np.array([keypoints[one.trainIdx].pt for one in matched]).reshape(-1, 2)
    column, row = np.rint(old).astype(int).T
    far = depth[row.clip(0, depth.shape[0] - 1), column.clip(0, depth.shape[1] - 1)]
    known = np.isfinite(far)
    if known.sum() < _LEAST:
        return None
    points = rig.lens.directions(old[known] + HALF_PIXEL) * far[known, None]
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
