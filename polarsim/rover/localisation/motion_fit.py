"""Motion of a stereo camera from corners in two pairs, by robust least squares.

The unknowns are the motion and the inverse depth of each corner (Civera, Davison & Montiel, IEEE T-RO 24 (2008) 932).
A corner at an exact position in the first left picture has four residuals: disparity in the first pair, column, row and
disparity in the second pair. Inverse depths are eliminated by the Schur complement. Corners have Tukey weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.detect.stereo.rectify import Rectification
from polarsim.geometry.poses import Pose
from polarsim.geometry.vectors import cross_matrices

_ROUNDS, _CONVERGED = 12, 1e-7  # maximum number of iterations; largest step of the last one, rad and m
# Factor of the covariance: patches of adjacent corners overlap. The 95th percentile of normalised errors is then 1.1 to
# 2.1 instead of 2.1 (chi square of 6 degrees of freedom, per degree).
_CORRELATION = 2.0
_MIN_SD_PX = 0.05  # minimum standard deviation of positions
_TUKEY = 4.0  # standard deviations of a corner's residual at which its weight is 0
_NORMAL_MEDIAN = 1.538  # median of the norm of three standard normal values


@dataclass(frozen=True)
class Fit:
    """Motion with the covariance (6, 6) of a small rotation, rad, and a translation, m, after it."""

    now_from_old: Pose
    covariance: np.ndarray
    weight: np.ndarray  # (n,) 0 to 1


def fit_motion(
    rays: np.ndarray,
    disparity: np.ndarray,
    position: np.ndarray,
    now_disparity: np.ndarray,
    rig: Rectification,
    start: Pose,
) -> Fit | None:
    """Fit the motion that moves corners with rays (n, 3), z = 1, to positions (n, 2) and disparities (n,), px.

    `disparity` is that of the first pair. None if the corners do not determine the motion.
    """
    matrix = rig.lens.opencv_matrix()
    focal, centre, scale = matrix[0, 0], matrix[:2, 2], rig.lens.fx * rig.baseline
    pose, inverse_depth = start, disparity / scale
    for number in range(_ROUNDS):
        turned = rays @ pose.rotation.T
        moved = turned + inverse_depth[:, None] * pose.translation
        if (moved[:, 2] < 1e-3).any():
            return None
        x, y = (moved[:, :2] / moved[:, 2:]).T
        residual = np.column_stack([
            disparity - scale * inverse_depth,
            position[:, 0] - centre[0] - focal * x,
            position[:, 1] - centre[1] - focal * y,
            now_disparity - scale * inverse_depth / moved[:, 2],
        ])  # fmt: skip
        # Derivatives of the three predictions by the moved ray, then by rotation, translation and inverse depth.
        by_ray = np.zeros((len(rays), 3, 3))
        by_ray[:, 0, 0] = by_ray[:, 1, 1] = focal / moved[:, 2]
        by_ray[:, 0, 2], by_ray[:, 1, 2] = -focal * x / moved[:, 2], -focal * y / moved[:, 2]
        by_ray[:, 2, 2] = -scale * inverse_depth / moved[:, 2] ** 2
        by_motion = np.zeros((len(rays), 4, 6))
        by_motion[:, 1:, :3] = by_ray @ -cross_matrices(turned)
        by_motion[:, 1:, 3:] = by_ray * inverse_depth[:, None, None]
        by_depth = np.empty((len(rays), 4))
        by_depth[:, 0] = scale
        by_depth[:, 1:] = by_ray @ pose.translation
        by_depth[:, 3] += scale / moved[:, 2]
        curvature = np.sum(by_depth**2, axis=1)
        along = np.sum(by_depth * residual, axis=1) / curvature
        rest = residual - by_depth * along[:, None]  # residual for the best inverse depth
        norm = np.linalg.norm(rest, axis=1)
        deviation = max(float(np.median(norm)) / _NORMAL_MEDIAN, _MIN_SD_PX)
        weight = np.clip(1 - (norm / (_TUKEY * deviation)) ** 2, 0, None) ** 2
        free = (
            by_motion
            - by_depth[..., None] * (np.einsum("nk,nkj->nj", by_depth, by_motion) / curvature[:, None])[:, None]
        )
        information = np.einsum("n,nki,nkj->ij", weight, free, free)
        if np.count_nonzero(weight) < 6 or np.linalg.cond(information) > 1e12:
            return None
        step = np.linalg.solve(information, np.einsum("n,nki,nk->i", weight, free, residual))
        inverse_depth = inverse_depth + along - np.einsum("nk,nkj,j->n", by_depth, by_motion, step) / curvature
        inverse_depth = np.maximum(inverse_depth, 1e-4)
        rotation = Rotation.from_rotvec(step[:3]).as_matrix()
        pose = Pose(rotation @ pose.rotation, pose.translation + step[3:])
        if number > 1 and np.abs(step).max() < _CONVERGED:
            break
    return Fit(pose, _CORRELATION * deviation**2 * np.linalg.inv(information), weight)
