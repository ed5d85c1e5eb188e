"""How far an estimated trajectory is off the true one, by the definitions of evo (Grupp 2017) and of Sturm et al. (IROS
2012): absolute error after a rigid alignment, relative error from pose to pose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.errors import RoverError
from polarsim.geometry.poses import Pose, angle_between


def absolute_error(estimated: np.ndarray, true: np.ndarray, *, align: bool = True) -> float:
    """Root mean square of the distances between positions (n, 3), metres; the estimate first rotated and moved onto
    the truth by least squares (Umeyama, IEEE PAMI 13 (1991) 376; no scale).

    Raises
    ------
    RoverError
        Fewer than three poses, or two numbers of them.
    """
    estimated, true = np.asarray(estimated, float), np.asarray(true, float)
    if estimated.shape != true.shape or len(true) < 3:
        raise RoverError(
            f"trajectories of {len(estimated)} and {len(true)} poses, expected three or more, as many each"
        )
    if align:
        rotation, translation = _alignment(estimated, true)
        estimated = estimated @ rotation.T + translation
    return float(np.sqrt((np.linalg.norm(estimated - true, axis=1) ** 2).mean()))


def relative_error(estimated: Sequence[Pose], true: Sequence[Pose]) -> tuple[float, float]:
    """Root mean squares of the translation, metres, and the angle, rad, of what one step adds to the error.

    Raises
    ------
    RoverError
        Fewer than two poses, or two numbers of them.
    """
    if len(estimated) != len(true) or len(true) < 2:
        raise RoverError(f"trajectories of {len(estimated)} and {len(true)} poses, expected two or more, as many each")
    moved, turned = [], []
    for k in range(len(true) - 1):
        step = true[k].inverse() @ true[k + 1]
        guess = estimated[k].inverse() @ estimated[k + 1]
        moved.append(float(np.linalg.norm((step.inverse() @ guess).translation)))
        turned.append(angle_between(step, guess))
    return float(np.sqrt(np.mean(np.square(moved)))), float(np.sqrt(np.mean(np.square(turned))))


def _alignment(estimated: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `fit_pose`, which warns of positions on a line: drives are nearly straight, any rotation about it serves."""
    first, second = estimated.mean(axis=0), true.mean(axis=0)
    u, _, v = np.linalg.svd((true - second).T @ (estimated - first))
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(v))])
    rotation = u @ sign @ v
    return rotation, second - rotation @ first
