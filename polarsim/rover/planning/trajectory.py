"""Errors of an estimated trajectory, as defined by evo (Grupp 2017) and Sturm et al. (IROS 2012).

The absolute error is computed after a rigid alignment, the relative error from pose to pose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.errors import RoverError
from polarsim.geometry.poses import Pose, angle_between


def absolute_error(estimated: np.ndarray, true: np.ndarray) -> float:
    """Return the root mean square distance between positions (n, 3), m, after a rigid alignment of the estimate.

    The alignment is a least-squares fit without scale (Umeyama, IEEE PAMI 13 (1991) 376).
    """
    estimated, true = np.asarray(estimated, float), np.asarray(true, float)
    if estimated.shape != true.shape or len(true) < 3:
        raise RoverError(
            f"trajectories of {len(estimated)} and {len(true)} poses, expected equal numbers of at least three"
        )
    rotation, translation = _alignment(estimated, true)
    aligned = estimated @ rotation.T + translation
    return float(np.sqrt((np.linalg.norm(aligned - true, axis=1) ** 2).mean()))


def relative_error(estimated: Sequence[Pose], true: Sequence[Pose]) -> tuple[float, float]:
    """Return the root mean square errors of single steps: translation, m, and angle, rad."""
    if len(estimated) != len(true) or len(true) < 2:
        raise RoverError(
            f"trajectories of {len(estimated)} and {len(true)} poses, expected equal numbers of at least two"
        )
    translations, rotations = [], []
    for k in range(len(true) - 1):
        step = true[k].inverse() @ true[k + 1]
        estimated_step = estimated[k].inverse() @ estimated[k + 1]
        translations.append(float(np.linalg.norm((step.inverse() @ estimated_step).translation)))
        rotations.append(angle_between(step, estimated_step))
    return float(np.sqrt(np.mean(np.square(translations)))), float(np.sqrt(np.mean(np.square(rotations))))


def _alignment(estimated: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation and translation of the alignment.

    Unlike `fit_pose`, this function does not warn about positions on a line: drives are nearly straight, and any
    rotation about the line gives the same error.
    """
    first, second = estimated.mean(axis=0), true.mean(axis=0)
    u, _, v = np.linalg.svd((true - second).T @ (estimated - first))
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(v))])
    rotation = u @ sign @ v
    return rotation, second - rotation @ first
