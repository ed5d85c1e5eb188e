"""Trajectories (poses at times) and the errors of an estimated trajectory.

Definitions are those of evo (Grupp 2017), with which the tests compare. evo itself is a tool of development only: its
licence is GPL-3.0, and it depends on plotting packages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation, Slerp
from trimesh.registration import procrustes

from polarsim.errors import FormatError
from polarsim.geometry.poses import Pose

if TYPE_CHECKING:
    import pandas as pd

POSE_COLUMNS = ("time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")  # of a table with a pose per row
STEP_M = 1.0  # path between the two poses of a relative error
_SLACK_S = 1e-6  # rounding of times


@dataclass(frozen=True)
class Trajectory:
    """Poses of a frame in the world at increasing times."""

    times: np.ndarray  # (n,) s
    positions: np.ndarray  # (n, 3) m
    rotations: Rotation  # n, world from the frame

    @classmethod
    def from_table(cls, table: pd.DataFrame) -> Trajectory:
        """Return the trajectory in `POSE_COLUMNS` of a table."""
        if len(table) < 2:
            raise FormatError(f"{len(table)} poses, a trajectory has at least two")
        values = table[list(POSE_COLUMNS)].to_numpy(float)
        if not np.isfinite(values).all() or (np.diff(values[:, 0]) <= 0).any():
            raise FormatError("a trajectory needs finite poses at increasing times")
        return cls(values[:, 0], values[:, 1:4], Rotation.from_quat(values[:, [5, 6, 7, 4]]))

    @classmethod
    def from_poses(cls, times: np.ndarray, poses: Sequence[Pose]) -> Trajectory:
        positions = np.array([pose.translation for pose in poses])
        return cls(np.asarray(times, float), positions, Rotation.from_matrix([pose.rotation for pose in poses]))

    def at(self, times: np.ndarray) -> Trajectory:
        """Return the interpolated poses at times (m,) s between the first and the last."""
        times = np.asarray(times, float)
        if times.min() < self.times[0] - _SLACK_S or times.max() > self.times[-1] + _SLACK_S:
            raise FormatError(
                f"times from {times.min():g} to {times.max():g} s are outside of the trajectory, "
                f"{self.times[0]:g} to {self.times[-1]:g} s"
            )
        inside = times.clip(self.times[0], self.times[-1])
        positions = np.column_stack([np.interp(inside, self.times, column) for column in self.positions.T])
        return Trajectory(times, positions, self._slerp(inside))

    @cached_property
    def _slerp(self) -> Slerp:
        return Slerp(self.times, self.rotations)

    def moved(self, move: Pose) -> Trajectory:
        """Return the trajectory in another world frame; `move` is `other_from_world`."""
        return Trajectory(self.times, move.apply(self.positions), Rotation.from_matrix(move.rotation) * self.rotations)

    def pose(self, index: int) -> Pose:
        return Pose(self.rotations[index].as_matrix(), self.positions[index])

    @property
    def path(self) -> np.ndarray:
        """Length of the path up to each pose (n,), m."""
        return np.concatenate([[0.0], np.linalg.norm(np.diff(self.positions, axis=0), axis=1).cumsum()])


@dataclass(frozen=True)
class TrajectoryErrors:
    """Errors of an estimated trajectory in metres and radians; the first three after alignment of the first poses."""

    path: float  # length of the true path
    end: float  # distance of the last positions
    mean: float  # distance of positions, as in the leaderboard of SPICE-HL3
    rms: float  # root mean square distance of positions
    rms_aligned: float  # see `absolute_error`
    relative: float  # see `motion_errors`, for steps of `STEP_M` along the true path; NaN for shorter paths
    relative_angle: float


def trajectory_errors(estimated: Trajectory, true: Trajectory) -> TrajectoryErrors:
    """Return the errors of an estimate at its times; the true trajectory is interpolated."""
    true = true.at(estimated.times)
    from_start = estimated.moved(true.pose(0) @ estimated.pose(0).inverse())
    distance = np.linalg.norm(from_start.positions - true.positions, axis=1)
    moved, turned = motion_errors(estimated, true, steps_along(true, STEP_M))
    return TrajectoryErrors(
        path=float(true.path[-1]),
        end=float(distance[-1]),
        mean=float(distance.mean()),
        rms=float(np.sqrt(np.mean(distance**2))),
        rms_aligned=absolute_error(estimated.positions, true.positions),
        relative=moved,
        relative_angle=turned,
    )


def absolute_error(estimated: np.ndarray, true: np.ndarray) -> float:
    """Return the root mean square distance of positions (n, 3), m, n >= 3, after a rigid alignment of the estimate.

    The alignment is a least-squares fit without scale (Umeyama, IEEE PAMI 13 (1991) 376); any rotation about a straight
    line gives the same error.
    """
    return float(np.sqrt(procrustes(estimated, true, reflection=False, scale=False)[2]))


def motion_errors(estimated: Trajectory, true: Trajectory, pairs: np.ndarray) -> tuple[float, float]:
    """Return the root mean square errors of the motions between pairs of poses: translation, m, and angle, rad.

    `pairs` (k, 2): indices of the first and the second pose of each motion. NaN without pairs.
    """
    if not len(pairs):
        return np.nan, np.nan
    (moved, turned), (true_moved, true_turned) = (_motions(part, pairs) for part in (estimated, true))
    angle = (true_turned.inv() * turned).magnitude()
    distance = np.linalg.norm(moved - true_moved, axis=1)  # a rotation of both does not change it
    return float(np.sqrt(np.mean(distance**2))), float(np.sqrt(np.mean(angle**2)))


def consecutive(count: int) -> np.ndarray:
    """Return the pairs (count - 1, 2) of consecutive poses."""
    return np.column_stack([np.arange(count - 1), np.arange(1, count)])


def steps_along(trajectory: Trajectory, step_m: float) -> np.ndarray:
    """Return pairs (k, 2) of poses, one after another, each at least `step_m` of path apart."""
    ends, path = [0], trajectory.path
    for index in range(1, len(path)):
        if path[index] - path[ends[-1]] >= step_m:
            ends.append(index)
    return np.column_stack([ends[:-1], ends[1:]])


def _motions(trajectory: Trajectory, pairs: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Return translations (k, 3) and rotations of `first_from_second` of pairs of poses."""
    first, second = pairs.T
    back = trajectory.rotations[first].inv()
    return back.apply(trajectory.positions[second] - trajectory.positions[first]), back * trajectory.rotations[second]
