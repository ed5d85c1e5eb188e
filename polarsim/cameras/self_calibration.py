"""Corrections of the stereo calibration and relative poses of positions, from matches between photos.

A calibration has errors of about a pixel. The difference of the two principal points and the angle between the cameras
change all disparities, which bends the measured ground, differently at each position. Epipolar lines of features and
points of the ground that two positions measure determine both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from polarsim.cameras.adjust import REPEATABILITY, changed_rig
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig, epipolar_distances, triangulated_depth

POSE_SD = np.array([0.05] * 3 + [0.3] * 3)  # of a pose from its start, radians and metres: a weak prior
EPIPOLAR_SD_PX = 0.5  # of a matched feature across the epipolar line
DISPARITY_SD_PX, ACROSS_SD = 0.15, 0.002  # of a matched point: along the ray by disparity, and across in metres
INDEPENDENT = 300  # maximum weight of the matches of a position or pair: errors of neighbours are correlated
LOSS_SCALE = 2.0  # standard deviations beyond which residuals are outliers


@dataclass(frozen=True)
class StereoPixels:
    """Pixels (n, 2) of the same points in the left and in the right photo of a position."""

    left: np.ndarray
    right: np.ndarray


@dataclass(frozen=True)
class Crossing:
    """The same points of the ground in the photos of two positions."""

    fixed: StereoPixels
    moving: StereoPixels


def triangulated(rig: StereoRig, pixels: StereoPixels) -> np.ndarray:
    """Return the points (n, 3) in the left frame, metres."""
    return rig.left.directions(pixels.left) * triangulated_depth(rig, pixels.left, pixels.right)[:, None]


def correct_calibration(
    rig: StereoRig,
    features: Sequence[StereoPixels],
    crossings: Mapping[tuple[str, str], Crossing],
    level_from_left: Mapping[str, Pose],
) -> tuple[StereoRig, dict[str, Pose]]:
    """Return the corrected rig and poses; the pose of the first position is fixed.

    The length of the baseline is kept: it scales the scene, which no photo shows, and a shorter baseline reduces all
    differences in metres.

    `features`: matched features of each position. `crossings`: by the names of both positions.
    `level_from_left`: start of the poses; positions without crossings keep their pose.
    """
    free = sorted({name for pair in crossings for name in pair})[1:]
    of_rig = REPEATABILITY.scale(rig.left.width)
    baseline = float(np.linalg.norm(rig.left_from_right.translation))
    scale = np.concatenate([of_rig, *(POSE_SD for _ in free)])

    def unpacked(unknowns: np.ndarray) -> tuple[StereoRig, dict[str, Pose]]:
        change = unknowns * scale
        poses = dict(level_from_left)
        for number, name in enumerate(free):
            part = change[len(of_rig) + 6 * number :][:6]
            poses[name] = poses[name] @ Pose.from_rotvec(part[:3], part[3:])
        return _with_baseline(changed_rig(rig, change[: len(of_rig)]), baseline), poses

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        changed, poses = unpacked(unknowns)
        parts = [unknowns]
        for pixels in features:
            if len(pixels.left):
                off = np.nan_to_num(epipolar_distances(changed, pixels.left, pixels.right) / EPIPOLAR_SD_PX)
                parts.append(_limited(off))
        for (fixed, moving), crossing in crossings.items():
            off = _differences(changed, crossing, poses[fixed], poses[moving])
            parts.append(_limited(off).ravel())
        return np.concatenate(parts)

    solution = least_squares(residuals, np.zeros(len(scale)), max_nfev=50).x
    return unpacked(solution)


def _with_baseline(rig: StereoRig, baseline: float) -> StereoRig:
    """Return a rig with a baseline of another length, metres, in the same direction."""
    translation = rig.left_from_right.translation
    scaled = translation * (baseline / float(np.linalg.norm(translation)))
    return replace(rig, left_from_right=Pose(rig.left_from_right.rotation, scaled))


def _limited(off: np.ndarray) -> np.ndarray:
    """Return residuals (n,) or (n, 3) whose squares are Cauchy's loss, weighted by the independent number."""
    square = off**2 if off.ndim == 1 else (off**2).sum(axis=1)
    loss = LOSS_SCALE**2 * np.log1p(square / LOSS_SCALE**2)
    share = min(1.0, INDEPENDENT / len(off))
    factor = np.sqrt(share * loss / np.maximum(square, 1e-12))
    return off * (factor if off.ndim == 1 else factor[:, None])


def _differences(rig: StereoRig, crossing: Crossing, fixed: Pose, moving: Pose) -> np.ndarray:
    """Return the differences (n, 3) of points measured from two positions, in standard deviations."""
    points, covariances = [], []
    for pose, pixels in ((fixed, crossing.fixed), (moving, crossing.moving)):
        in_left = triangulated(rig, pixels)
        distance = np.linalg.norm(in_left, axis=1)
        baseline = float(np.linalg.norm(rig.left_from_right.translation))
        along = DISPARITY_SD_PX * in_left[:, 2] * distance / (rig.left.fx * baseline)
        ray = pose.rotate(in_left / distance[:, None])
        covariances.append(ACROSS_SD**2 * np.eye(3) + (along**2)[:, None, None] * ray[:, :, None] * ray[:, None, :])
        points.append(pose.apply(in_left))
    lower = np.linalg.cholesky(covariances[0] + covariances[1])
    return np.linalg.solve(lower, (points[0] - points[1])[..., None])[..., 0]
