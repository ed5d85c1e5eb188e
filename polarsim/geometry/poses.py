"""Rigid poses, named by their mapping: `sandbox_from_left` maps points of the left camera frame to the sandbox frame.

Functions import SciPy on demand, because Snakemake reads the configuration at every start, which needs no SciPy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.errors import FormatError


@dataclass(frozen=True)
class Pose:
    """x_target = rotation @ x_source + translation; metres."""

    rotation: np.ndarray  # (3, 3)
    translation: np.ndarray  # (3,)

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Map points (..., 3)."""
        moved = self.rotate(points)
        moved += self.translation
        return moved

    def rotate(self, directions: np.ndarray) -> np.ndarray:
        """Map directions (..., 3): rotation only."""
        # A single product is faster than a stack of products.
        return (directions.reshape(-1, 3) @ self.rotation.T).reshape(directions.shape)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.apply(other.translation))

    def inverse(self) -> Pose:
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    @property
    def matrix(self) -> np.ndarray:
        """Homogeneous matrix (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.translation
        return matrix

    @classmethod
    def from_matrix(cls, matrix: np.ndarray) -> Pose:
        """Create a pose from a (4, 4) or (3, 4) matrix."""
        matrix = np.asarray(matrix, float)
        if matrix.shape not in ((4, 4), (3, 4)):
            raise FormatError(f"a pose has shape {matrix.shape}, expected 4 x 4")
        return cls(orthogonal_rotation(matrix[:3, :3]), matrix[:3, 3].copy())

    @classmethod
    def from_rotvec(cls, rotvec: np.ndarray, translation: np.ndarray) -> Pose:
        """Create a pose from a rotation vector (3,) in radians and a translation (3,)."""
        from scipy.spatial.transform import Rotation

        return cls(Rotation.from_rotvec(rotvec).as_matrix(), np.asarray(translation, float))

    @classmethod
    def identity(cls) -> Pose:
        return cls(np.eye(3), np.zeros(3))


def orthogonal_rotation(matrix: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) made exactly orthogonal."""
    if not np.isfinite(matrix).all() or np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-4:
        raise FormatError("the rotation matrix is not orthogonal to 1e-4")
    if np.linalg.det(matrix) < 0:
        raise FormatError("the rotation matrix contains a reflection (determinant -1)")
    u, _, vt = np.linalg.svd(matrix)
    return u @ vt


def camera_pose(centre: np.ndarray, yaw: float, pitch: float, roll: float = 0.0) -> Pose:
    """Return `sandbox_from_camera` of a camera at `centre` (3,).

    `yaw`: heading of the optical axis, radians from +X towards +Y.
    `pitch`: downwards, radians.
    `roll`: rotates the right axis towards down, radians.
    """
    forward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)])
    level_right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    level_down = np.cross(forward, level_right)
    right = np.cos(roll) * level_right + np.sin(roll) * level_down
    down = np.cross(forward, right)
    return Pose(np.stack([right, down, forward], axis=1), np.asarray(centre, float))


def yaw_pitch_roll(sandbox_from_camera: Pose) -> tuple[float, float, float]:
    """Return yaw, pitch and roll in radians; the inverse of `camera_pose`."""
    right, _, forward = sandbox_from_camera.rotation.T
    yaw, pitch = np.arctan2(forward[1], forward[0]), -np.arcsin(np.clip(forward[2], -1, 1))
    level_right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    level_down = np.cross(forward, level_right)
    return float(yaw), float(pitch), float(np.arctan2(right @ level_down, right @ level_right))


def fit_pose(source: np.ndarray, target: np.ndarray) -> Pose:
    """Fit `target_from_source` of paired points (n, 3) by least squares (Kabsch, Acta Cryst. A34 (1978) 827)."""
    from scipy.spatial.transform import Rotation

    centre_source, centre_target = source.mean(axis=0), target.mean(axis=0)
    rotation = Rotation.align_vectors(target - centre_target, source - centre_source)[0].as_matrix()
    return Pose(rotation, centre_target - rotation @ centre_source)


def angle_between(first: Pose, second: Pose) -> float:
    """Return the angle of the rotation between two poses, radians."""
    from scipy.spatial.transform import Rotation

    return float(Rotation.from_matrix(first.rotation.T @ second.rotation).magnitude())
