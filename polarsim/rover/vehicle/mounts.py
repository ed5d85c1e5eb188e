"""Poses of the rover's cameras, lights and shapes.

`base_link` has x forward, y left, z up; a camera frame has x right, y down, z forward.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.rover.vehicle.camera_names import FOLLOWING
from polarsim.rover.vehicle.table import CameraPart


@dataclass(frozen=True)
class Mount:
    """A camera fixed to the rover, or, if `level`, a camera that follows its position and heading only."""

    name: str
    base_from_camera: Pose
    lens: Lens
    level: bool = False

    def at(self, world_from_base: Pose) -> Camera:
        """Return the camera for a pose of the rover."""
        base = levelled(world_from_base) if self.level else world_from_base
        return Camera(base @ self.base_from_camera, self.lens)


def mount_of(camera: CameraPart, scale: float = 1.0) -> Mount:
    """Return the mount of a camera of the vehicle's table."""
    lens = Lens(
        camera.focal, camera.focal, camera.width_px / 2, camera.height_px / 2,
        width=camera.width_px, height=camera.height_px,
    ).scaled(scale)  # fmt: skip
    pose = base_from_camera(np.array(camera.position_m), camera.yaw_deg, camera.pitch_deg, camera.roll_deg)
    return Mount(camera.name, pose, lens, level=camera.name in FOLLOWING)


def base_from_camera(position: np.ndarray, yaw_deg: float, pitch_deg: float, roll_deg: float) -> Pose:
    """Return the pose of a camera at `position` (3,) in base_link, metres.

    Angles follow ROS (REP 103): yaw from forward to the left, pitch downwards, roll of the right side downwards.
    """
    yaw, pitch, roll = np.radians([yaw_deg, pitch_deg, roll_deg])
    return camera_pose(np.asarray(position, float), float(yaw), float(pitch), float(roll))


def link_from_part(position: Sequence[float], yaw_deg: float, pitch_deg: float, roll_deg: float = 0.0) -> Pose:
    """Return the pose of a shape or light at `position` (3,) in the link, m; rotated about z, the new y, the new x."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("ZYX", [yaw_deg, pitch_deg, roll_deg], degrees=True)
    return Pose(rotation.as_matrix(), np.array(position))


def levelled(world_from_base: Pose) -> Pose:
    """Return the pose with the same position and heading, upright."""
    forward = world_from_base.rotation[:, 0]
    yaw = float(np.arctan2(forward[1], forward[0]))
    return Pose.from_rotvec(np.array([0.0, 0, yaw]), world_from_base.translation)


def pose_of_quaternion(position: np.ndarray, quaternion: np.ndarray) -> Pose:
    """Return the pose of a position (3,) and a quaternion (4,) w, x, y, z, as in a trace."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = quaternion
    return Pose(Rotation.from_quat([x, y, z, w]).as_matrix(), np.asarray(position, float))
