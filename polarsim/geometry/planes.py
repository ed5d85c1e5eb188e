"""Robust planes z = a x + b y + c."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.poses import Pose


@dataclass(frozen=True)
class PlanAxis:
    """Axis of a level grid in coordinates of a file: exact on level ground.

    On inclined ground, distances from the centre of the cloud are measured along the ground.
    """

    name: str  # x, y or z
    start: float  # coordinate of the border of the first cell
    step: float  # side of a cell; negative if the coordinate decreases


def robust_plane(points: np.ndarray, scale: float, rounds: int = 10) -> np.ndarray:
    """Return (3,) a, b, c through points (n, 3) with Cauchy weights of a scale in metres; robust to gross outliers."""
    columns = np.column_stack([points[:, :2], np.ones(len(points))])
    start = np.linalg.lstsq(columns, points[:, 2], rcond=None)[0]
    return _reweighted(points, start, [scale] * rounds, _cauchy)


def tracked_plane(points: np.ndarray, start: np.ndarray, scales: list[float]) -> np.ndarray:
    """Return (3,) a, b, c of the plane near `start` (3,): a Tukey-weighted fit per scale, metres, from wide to narrow.

    Points farther than the scale have no weight, so that walls and floors are excluded as it shrinks.
    """
    return _reweighted(points, start, scales, _tukey)


def level_from(plane: np.ndarray) -> Pose:
    """Return the smallest rotation that makes the plane level, with a translation to z = 0 at x = y = 0."""
    plane = np.asarray(plane, float)
    normal = np.array([-plane[0], -plane[1], 1.0])
    normal /= np.linalg.norm(normal)
    axis = np.cross(normal, [0, 0, 1])
    sine = np.linalg.norm(axis)
    rotvec = axis / sine * np.arcsin(sine) if sine > 0 else axis
    rotation = Pose.from_rotvec(rotvec, np.zeros(3)).rotation
    return Pose(rotation, -rotation @ np.array([0, 0, plane[2]]))


def _reweighted(points: np.ndarray, plane: np.ndarray, scales: list[float], weigh: object) -> np.ndarray:
    columns = np.column_stack([points[:, :2], np.ones(len(points))])
    for scale in scales:
        weight = weigh((points[:, 2] - columns @ plane) / scale)  # type: ignore[operator]
        normal = columns.T @ (columns * weight[:, None]) + 1e-9 * np.eye(3)
        plane = np.linalg.solve(normal, columns.T @ (weight * points[:, 2]))
    return np.asarray(plane)


def _cauchy(residual: np.ndarray) -> np.ndarray:
    return np.asarray(1 / (1 + residual**2))


def _tukey(residual: np.ndarray) -> np.ndarray:
    return np.asarray(np.clip(1 - residual**2, 0, None) ** 2)
