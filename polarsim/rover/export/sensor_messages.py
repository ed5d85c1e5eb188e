"""Messages of sensors and of estimated poses in the bag of a drive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.formats import tables
from polarsim.formats.ros import Message, Stamped, header, pose, ros_quaternion, stamp_ns, vector
from polarsim.geometry.poses import Pose
from polarsim.geometry.trajectories import POSE_COLUMNS, Trajectory
from polarsim.rover.drive.trace import Trace
from polarsim.rover.export.options import BagOptions
from polarsim.rover.localisation.sensors import (
    ACCELERATION_COLUMNS,
    ACCELERATION_NOISE,
    GYRO_COLUMNS,
    GYRO_NOISE,
    RATE_HZ,
    SPIN_COLUMNS,
    STEER_COLUMNS,
)
from polarsim.rover.vehicle.table import WHEELS
from polarsim.run_files.localisation import ESTIMATOR_COLUMNS
from polarsim.run_files.picture_sets import PictureSet

SPINS, STEERS = (tuple(f"{code}_{joint}" for code in WHEELS) for joint in ("spin", "steer"))
_UNMEASURED = (-1.0, *[0.0] * 8)  # covariance of an orientation that an IMU does not measure (REP 145)


def first_per_period(times: np.ndarray, hz: float) -> np.ndarray:
    """Return the index of the first time in each period of a rate; all indices if the rate exceeds that of `times`."""
    period = np.floor(times * hz + 1e-6)
    return np.flatnonzero(np.diff(period, prepend=-np.inf) > 0)


def true_imu(trace: Trace) -> Iterator[Stamped]:
    """Yield the true accelerations, rates and orientation on /imu/truth."""
    table = trace.table
    values = table[["ax_m_s2", "ay_m_s2", "az_m_s2", "wx_rad_s", "wy_rad_s", "wz_rad_s"]].to_numpy()
    quaternions = table[["qx", "qy", "qz", "qw"]].to_numpy()
    times = table["time_s"].to_numpy()
    for index in first_per_period(times, RATE_HZ):
        time_ns, true = stamp_ns(float(times[index])), values[index]
        rotation = Rotation.from_quat(quaternions[index]).as_matrix()
        yield time_ns, "/imu/truth", "sensor_msgs/msg/Imu", imu(time_ns, true[:3], true[3:], (0.0, 0.0), rotation)


def readings(table: pd.DataFrame) -> Iterator[Stamped]:
    """Yield the readings of the IMU and of the wheels' encoders."""
    sd = (ACCELERATION_NOISE * math.sqrt(RATE_HZ), GYRO_NOISE * math.sqrt(RATE_HZ))  # of a reading
    columns = (ACCELERATION_COLUMNS, GYRO_COLUMNS, STEER_COLUMNS, SPIN_COLUMNS)
    acceleration, rate, steer, spin = (table[list(names)].to_numpy() for names in columns)
    for index, time_s in enumerate(table["time_s"]):
        time_ns = stamp_ns(time_s)
        yield time_ns, "/imu", "sensor_msgs/msg/Imu", imu(time_ns, acceleration[index], rate[index], sd, None)
        yield time_ns, "/wheels/speeds", "sensor_msgs/msg/JointState", joint_state(time_ns, SPINS, [], spin[index])
        yield time_ns, "/wheels/steering", "sensor_msgs/msg/JointState", joint_state(time_ns, STEERS, steer[index], [])


def estimates(path: Path, options: BagOptions) -> list[Iterator[Stamped]]:
    """Return the estimated poses on /pose/<estimator>: without pictures, or with those in the bag."""
    table = tables.read_parquet(path, (*ESTIMATOR_COLUMNS, *POSE_COLUMNS))
    pictures = str(PictureSet(options.sun, options.model, options.exposure_ms))
    chosen = table[table["pictures"].isin(["", pictures])]
    return [_poses(str(estimator), rows) for estimator, rows in chosen.groupby("estimator")]


def _poses(estimator: str, rows: pd.DataFrame) -> Iterator[Stamped]:
    trajectory = Trajectory.from_table(rows)
    for index, time_s in enumerate(trajectory.times):
        time_ns = stamp_ns(time_s)
        message = {"header": header(time_ns, "odom"), "pose": pose(trajectory.pose(index))}
        yield time_ns, f"/pose/{estimator}", "geometry_msgs/msg/PoseStamped", message


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


def joint_state(time_ns: int, names: Sequence[str], position: Sequence[float], velocity: Sequence[float]) -> Message:
    """Return sensor_msgs/JointState of joints; no positions or no velocities: not measured."""
    return {
        "header": header(time_ns, ""),
        "name": list(names),
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
