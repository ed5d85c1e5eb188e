"""Stereo visual odometry under a low Sun: motion of the camera from pair to pair, by keyframes.

Corners of a keyframe are tracked into later pairs, as on NASA's Mars rovers (Cheng, Maimone & Matthies, IEEE Robotics
and Automation Magazine 13 (2006) 54), until the rover has moved on or too few remain. Poses relative to a keyframe have
independent errors, so the drift grows with the number of keyframes and a rover at rest does not drift.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from polarsim.detect.stereo.rectify import Rectification
from polarsim.geometry.poses import Pose
from polarsim.geometry.vectors import cross_matrices
from polarsim.rover.localisation.ground_features import Ground, GroundTracker, equal_contrast, lit_ground, moved_plane
from polarsim.rover.localisation.motion import Motion
from polarsim.rover.localisation.motion_fit import Fit, fit_motion

_NEAREST_M, _FARTHEST_M = 1.5, 10.0  # range of depths of corners
_KEPT_M, _KEPT_SHARE = 0.5, 0.5  # of a keyframe: maximum motion, and minimum share of corners that are inliers
_MIN_INLIERS = 15  # minimum number of inliers
_TRACK_SHARE, _MATCH_SHARE = 0.35, 0.15  # minimum share of inliers: tracks, and matches, whose tracks are then fitted
_VISIBLE_SHARE = 0.15  # minimum share of inliers among corners that the motion moves into the picture
_TRACK_PX, _MATCH_PX = 2.0, 3.0  # maximum reprojection errors of inliers: tracks, and matches with rough depth
_ITERATIONS = 1000  # of RANSAC at most; fewer with many inliers
_NEAR_PX = 4.0  # maximum distance of tracks from the position that RANSAC predicts


class StereoMotion:
    """Motion between consecutive stereo pairs, see `Motion`."""

    def __init__(self, rig: Rectification) -> None:
        self.rig = rig
        self._tracker = GroundTracker(rig, _NEAREST_M, _FARTHEST_M)
        self._last = Pose.identity()  # last motion
        self._start(None)

    def add(self, left: np.ndarray, right: np.ndarray, predicted: Pose | None = None) -> Motion | None:
        """Return the motion since the last pair; None for the first pair and if it was not found.

        Parameters
        ----------
        left, right
            Pictures (h, w) uint8 before rectification, by the same tone curve; it may differ from pair to pair.
        predicted
            Expected `before_from_now`, for example from wheels. The result does not depend on it if it is found.
        """
        left, right = self._rectify(left, right)
        lit = lit_ground(left)
        left, right = equal_contrast(left), equal_contrast(right)
        motion = None if self._keyframe is None else self._against(self._keyframe, left, right, lit, predicted)
        if motion is None or self._expired(motion):
            self._start(self._tracker.find(left, right, lit))
        return motion

    def _rectify(self, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        import cv2

        first, second = self.rig.left_maps, self.rig.right_maps
        return cv2.remap(left, *first, cv2.INTER_LINEAR), cv2.remap(right, *second, cv2.INTER_LINEAR)

    def _start(self, ground: Ground | None) -> None:
        """Make the current pair the keyframe."""
        self._keyframe, self._keyframe_from_before, self._covariance = ground, Pose.identity(), np.zeros((6, 6))

    def _expired(self, motion: Motion) -> bool:
        assert self._keyframe is not None
        moved = float(np.linalg.norm(self._keyframe_from_before.translation))
        return moved > _KEPT_M or motion.inliers < _KEPT_SHARE * len(self._keyframe.corners)

    def _against(
        self, keyframe: Ground, left: np.ndarray, right: np.ndarray, lit: np.ndarray, predicted: Pose | None
    ) -> Motion | None:
        """Return the motion by the corners of a keyframe."""
        for guess in self._guesses(keyframe, left, lit, predicted):
            rough = self._consensus(*self._tracks(keyframe, left, lit, guess), _TRACK_PX, _TRACK_SHARE)
            fit = None if rough is None else self._fit(keyframe, left, right, lit, rough)
            if fit is not None:
                break
        else:
            return None
        keyframe_from_now, covariance = fit.now_from_old.inverse(), _of_inverse(fit)
        before_from_now = self._keyframe_from_before.inverse() @ keyframe_from_now
        both = _of_difference(before_from_now, self._keyframe_from_before, covariance, self._covariance)
        self._keyframe_from_before, self._covariance, self._last = keyframe_from_now, covariance, before_from_now
        return Motion(before_from_now, both, int((fit.weight > 0).sum()))

    def _guesses(self, keyframe: Ground, left: np.ndarray, lit: np.ndarray, predicted: Pose | None) -> Iterator[Pose]:
        """Yield guesses of `now_from_keyframe`: predicted, like the last motion, at rest, and from matched features."""
        for step in (predicted, self._last, Pose.identity()):
            if step is not None:
                yield (self._keyframe_from_before @ step).inverse()
        matched = self._consensus(*self._tracker.match(keyframe, left, lit), _MATCH_PX, _MATCH_SHARE)
        if matched is not None:
            yield matched

    def _tracks(
        self, keyframe: Ground, left: np.ndarray, lit: np.ndarray, guess: Pose
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return points (n, 3) of the keyframe, m, and their positions (n, 2) in a picture, tracked near a guess."""
        position, good = self._tracker.follow(keyframe, left, lit, guess)
        points = self._tracker.directions(keyframe.corners[good]) / keyframe.inverse_depth[good, None]
        return points, position[good]

    def _consensus(self, points: np.ndarray, position: np.ndarray, within_px: float, share: float) -> Pose | None:
        """Return the pose of points (n, 3) with a share of positions (n, 2) within a distance, by RANSAC."""
        import cv2

        if len(points) < _MIN_INLIERS:
            return None
        cv2.setRNGSeed(0)
        fits, rotation, translation, inliers = cv2.solvePnPRansac(
            points,
            position,
            self._tracker.matrix,
            None,
            iterationsCount=_ITERATIONS,
            reprojectionError=within_px,
            flags=cv2.SOLVEPNP_AP3P,
        )
        if not fits or inliers is None or len(inliers) < max(_MIN_INLIERS, share * len(points)):
            return None
        return Pose.from_rotvec(rotation.ravel(), translation.ravel())

    def _fit(self, keyframe: Ground, left: np.ndarray, right: np.ndarray, lit: np.ndarray, rough: Pose) -> Fit | None:
        """Return the motion by corners tracked near a rough motion, with disparities in the second pair."""
        tracker = self._tracker
        position, good = tracker.follow(keyframe, left, lit, rough)
        expected, disparity = tracker.project(keyframe, rough)
        visible = tracker.inside(expected).sum()
        chosen = np.flatnonzero(good & (np.linalg.norm(position - expected, axis=1) < _NEAR_PX))
        least = max(_MIN_INLIERS, _VISIBLE_SHARE * visible)
        if len(chosen) < least:
            return None
        plane = moved_plane(keyframe.plane, rough)
        now, matched = tracker.disparities(left, right, position[chosen], disparity[chosen], plane)
        chosen, now = chosen[matched], now[matched]
        if len(chosen) < least:
            return None
        rays, before = (
            tracker.directions(keyframe.corners[chosen]),
            self.rig.disparity(1 / keyframe.inverse_depth[chosen]),
        )
        fit = fit_motion(rays, before, position[chosen], now, self.rig, rough)
        return fit if fit is not None and (fit.weight > 0).sum() >= least else None


def visual_odometry(pairs: Sequence[tuple[np.ndarray, np.ndarray]], rig: Rectification) -> tuple[list[Pose], int]:
    """Return `first_from_left` of the rectified left camera of each pair, and the number of motions not found.

    A motion that is not found is replaced by the last motion.
    """
    stereo, poses, lost, step = StereoMotion(rig), [Pose.identity()], 0, Pose.identity()
    for number, (left, right) in enumerate(pairs):
        motion = stereo.add(left, right)
        if number > 0:
            lost += motion is None
            step = motion.before_from_now if motion is not None else step
            poses.append(poses[-1] @ step)
    return poses, lost


def _of_inverse(fit: Fit) -> np.ndarray:
    """Return the covariance, as in `Motion`, of the inverse of a fitted motion."""
    rotation, translation = fit.now_from_old.rotation, fit.now_from_old.translation
    change = np.zeros((6, 6))
    change[:3, :3], change[3:, 3:] = -np.eye(3), -rotation.T
    change[3:, :3] = -rotation.T @ cross_matrices(translation[None])[0]
    return change @ fit.covariance @ change.T


def _of_difference(
    before_from_now: Pose, keyframe_from_before: Pose, now: np.ndarray, before: np.ndarray
) -> np.ndarray:
    """Return the covariance of `before_from_now` from the covariances (6, 6) of both poses in the keyframe."""
    of_now, of_before = np.eye(6), np.zeros((6, 6))
    of_now[3:, 3:] = keyframe_from_before.rotation.T
    of_before[:3, :3] = -before_from_now.rotation.T
    of_before[3:, :3] = cross_matrices(before_from_now.translation[None])[0]
    of_before[3:, 3:] = -keyframe_from_before.rotation.T
    return of_now @ now @ of_now.T + of_before @ before @ of_before.T
