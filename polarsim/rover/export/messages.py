"""ROS 2 messages of a drive as dictionaries, without ROS.

Units are those of ROS: metres, radians, seconds, newtons. Pixel coordinates are shifted by half a pixel, since ROS puts
the origin at the centre of the first pixel and polarsim at its corner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from polarsim.formats.ros import Message, header, pose, ros_quaternion, vector
from polarsim.geometry.poses import Pose
from polarsim.rover.drive.trace import CONTACTS
from polarsim.rover.vehicle.table import WHEELS

CONTACT_CODES = {name: code for code, name in enumerate(CONTACTS)}  # as in polarsim_msgs/WheelState
JOINTS = tuple(f"{code}_{joint}" for code in WHEELS for joint in ("lift", "steer", "spin"))
_UNMEASURED = (-1.0, *[0.0] * 8)  # covariance of an orientation that an IMU does not measure (REP 145)


def odometry_message(
    time_ns: int, world_from_base: Pose, velocity: np.ndarray, angular_velocity: np.ndarray
) -> Message:
    """Return nav_msgs/Odometry: the true pose in `odom`.

    `velocity` (3,) is in the world frame, `angular_velocity` (3,) in the base frame.
    """
    return {
        "header": header(time_ns, "odom"),
        "child_frame_id": "base_link",
        "pose": {"pose": pose(world_from_base), "covariance": [0.0] * 36},
        "twist": {
            "twist": {"linear": vector(world_from_base.rotation.T @ velocity), "angular": vector(angular_velocity)},
            "covariance": [0.0] * 36,
        },
    }


def joint_state(time_ns: int, position: Sequence[float], velocity: Sequence[float]) -> Message:
    """Return sensor_msgs/JointState of `JOINTS`; torques are in `wheel_states`."""
    return {
        "header": header(time_ns, ""),
        "name": list(JOINTS),
        "position": [float(value) for value in position],
        "velocity": [float(value) for value in velocity],
        "effort": [],
    }


def imu(
    time_ns: int,
    acceleration: np.ndarray,
    angular_velocity: np.ndarray,
    sd: tuple[float, float],
    rotation: np.ndarray | None,
) -> Message:
    """Return sensor_msgs/Imu.

    `sd`: standard deviation of acceleration, m/s2, and rate, rad/s. `rotation` (3, 3) of base_link; None if unmeasured.
    """
    return {
        "header": header(time_ns, "base_link"),
        "orientation": ros_quaternion(np.eye(3) if rotation is None else rotation),
        "orientation_covariance": list(_UNMEASURED) if rotation is None else [0.0] * 9,
        "angular_velocity": vector(angular_velocity),
        "angular_velocity_covariance": (np.eye(3) * sd[1] ** 2).ravel().tolist(),
        "linear_acceleration": vector(acceleration),
        "linear_acceleration_covariance": (np.eye(3) * sd[0] ** 2).ravel().tolist(),
    }


def wheel_states(time_ns: int, row: Mapping[str, Any]) -> Message:
    """Return polarsim_msgs/WheelStates for a row of the trace."""
    names = {"slip": "slip", "sinkage": "sinkage_m", "sinkage_first": "sinkage_first_m", "load": "load_n"}
    names |= {"torque": "torque_n_m"}
    wheels = [
        {
            "name": code,
            **{field: float(row[f"{code}_{column}"]) for field, column in names.items()},
            "contact": CONTACT_CODES[row[f"{code}_contact"]],
        }
        for code in WHEELS
    ]
    return {"header": header(time_ns, "base_link"), "wheels": wheels}


def grid_map(time_ns: int, level: np.ndarray, cell: float, x0: float, y0: float) -> Message:
    """Return grid_map_msgs/GridMap with a layer `elevation`.

    Parameters
    ----------
    level : (rows, columns) float
        Metres, rows along +y, columns along +x, nodes `cell` apart from (x0, y0) on. In the message the first row has
        the maximum x, the first column the maximum y, and columns are contiguous.
    """
    rows, columns = level.shape
    centre = Pose(np.eye(3), np.array([x0 + cell * (columns - 1) / 2, y0 + cell * (rows - 1) / 2, 0.0]))
    layout = {
        "dim": [
            {"label": "column_index", "size": rows, "stride": rows * columns},
            {"label": "row_index", "size": columns, "stride": columns},
        ],
        "data_offset": 0,
    }
    return {
        "header": header(time_ns, "map"),
        "info": {"resolution": cell, "length_x": cell * columns, "length_y": cell * rows, "pose": pose(centre)},
        "layers": ["elevation"],
        "basic_layers": ["elevation"],
        "data": [{"layout": layout, "data": level[::-1, ::-1].astype(np.float32).ravel().tolist()}],
        "outer_start_index": 0,
        "inner_start_index": 0,
    }
