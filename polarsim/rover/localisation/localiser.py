"""The rover's estimate of its own pose during a drive, from its sensors."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.geometry.poses import Pose
from polarsim.rover.drive.state import RoverState
from polarsim.rover.localisation.fusion import ATTITUDE, POSITION, PoseFilter
from polarsim.rover.localisation.motion import Motion
from polarsim.rover.localisation.sensors import (
    ACCELERATION_COLUMNS,
    GYRO_COLUMNS,
    RATE_HZ,
    SENSOR_COLUMNS,
    SPIN_COLUMNS,
    STEER_COLUMNS,
    Sensors,
)
from polarsim.rover.localisation.wheel_odometry import WheelOdometry
from polarsim.rover.vehicle.mounts import pose_of_quaternion
from polarsim.rover.vehicle.table import Vehicle
from polarsim.schemas.rover import AUTONOMY_ESTIMATE

ESTIMATE_COLUMNS = AUTONOMY_ESTIMATE.columns
_LEVEL_READINGS = round(RATE_HZ)  # readings of a mean acceleration
_SPIN, _STEER, _GYRO, _ACCELERATION = (
    slice(SENSOR_COLUMNS.index(names[0]), SENSOR_COLUMNS.index(names[0]) + len(names))
    for names in (SPIN_COLUMNS, STEER_COLUMNS, GYRO_COLUMNS, ACCELERATION_COLUMNS)
)


class StereoOdometry(Protocol):
    """Source of motions from stereo pairs."""

    def add(self, left: np.ndarray, right: np.ndarray, predicted: Pose | None = None) -> Motion | None:
        """Return the motion since the last pair of pictures (h, w) uint8, None if it was not found.

        `predicted`: expected `before_from_now`; None for the first pair.
        """


class Localiser:
    """Filter over the readings of a drive; the pose at time 0 is given."""

    def __init__(
        self, vehicle: Vehicle, seed: int, gravity_m_s2: float, *,
        stereo: StereoOdometry | None = None, base_from_camera: Pose | None = None,
    ) -> None:  # fmt: skip
        """
        Parameters
        ----------
        seed
            Of the noise of the sensors.
        stereo, base_from_camera
            Source of motions and pose of its rectified left camera in base_link; None: wheels and IMU only.
        """
        self._sensors, self._wheels = Sensors(seed, gravity_m_s2), WheelOdometry(vehicle)
        self._gravity = gravity_m_s2
        self.stereo, self._base_from_camera = stereo, base_from_camera
        self._filter: PoseFilter | None = None
        self._pairs = 0
        self.lost = 0  # pairs without a motion
        self._readings: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []
        self._restart()

    @property
    def filter(self) -> PoseFilter:
        assert self._filter is not None, "no state was read"
        return self._filter

    @property
    def pose(self) -> Pose:
        """Estimated pose of base_link in the world."""
        return self.filter.pose

    @property
    def plane_pose(self) -> tuple[float, float, float]:
        """Estimated x, y, m, and heading from x towards y, rad."""
        (x, y, _), forward = self.filter.position.tolist(), self.filter.rotation[:, 0]
        return x, y, float(np.arctan2(forward[1], forward[0]))

    def read(self, state: RoverState) -> None:
        """Read the sensors at a state and advance the estimate to it."""
        reading = self._sensors.read(state)
        self._readings.append(reading)
        if self._filter is None:
            self._filter = PoseFilter(pose_of_quaternion(state.position, state.rotation), self._gravity)
            return
        self._advance(float(reading[0] - self._readings[-2][0]), reading)

    def add_pair(self, left: np.ndarray, right: np.ndarray) -> None:
        """Correct the estimate by a stereo pair of pictures (h, w) uint8 at the time of the last reading."""
        assert self.stereo is not None
        assert self._base_from_camera is not None
        predicted = self.filter.expected_motion(self._base_from_camera) if self._pairs else None
        motion = self.stereo.add(left, right, predicted)
        if motion is not None:
            self.filter.correct_by_motion(motion, self._base_from_camera)
        elif self._pairs:
            self.lost += 1
        self.filter.store_pose()
        self._pairs += 1

    def log(self) -> None:
        """Store the current estimate."""
        estimate = self.filter
        x, y, z, w = Rotation.from_matrix(estimate.rotation).as_quat(canonical=True)
        sd = np.sqrt(np.diag(estimate.covariance))
        time = self._readings[-1][0]
        self._rows.append(np.concatenate([[time], estimate.position, [w, x, y, z], sd[POSITION], sd[ATTITUDE]]))

    def estimate(self) -> pd.DataFrame:
        """Return the logged estimates, `ESTIMATE_COLUMNS`."""
        return pd.DataFrame(np.reshape(self._rows, (-1, len(ESTIMATE_COLUMNS))), columns=list(ESTIMATE_COLUMNS))

    def readings(self) -> pd.DataFrame:
        """Return all readings, `SENSOR_COLUMNS`."""
        return pd.DataFrame(np.reshape(self._readings, (-1, len(SENSOR_COLUMNS))), columns=list(SENSOR_COLUMNS))

    def _restart(self) -> None:
        """Start a new mean acceleration."""
        self._force, self._attitude, self._rate = np.zeros(3), np.zeros((3, 3)), np.zeros(3)
        self._seconds, self._count, self._still = 0.0, 0, True
        self._first_velocity: np.ndarray | None = None

    def _advance(self, seconds: float, reading: np.ndarray) -> None:
        estimate, spin = self.filter, reading[_SPIN]
        wheels = self._wheels.motion(spin, reading[_STEER])[:2]
        attitude = estimate.propagate(seconds, reading[_GYRO], wheels)
        velocity = attitude[:, :2] @ wheels
        if self._first_velocity is None:
            self._first_velocity = velocity
        self._force += attitude @ (reading[_ACCELERATION] - estimate.acceleration_bias) * seconds
        self._attitude += attitude * seconds
        self._rate += reading[_GYRO] * seconds
        self._still = self._still and not spin.any()
        self._seconds, self._count = self._seconds + seconds, self._count + 1
        if self._count < _LEVEL_READINGS:
            return
        change = (velocity - self._first_velocity) / self._seconds
        excess = self._force / self._seconds - change - [0.0, 0.0, self._gravity]
        estimate.correct_tilt(excess, self._attitude / self._seconds, at_rest=self._still)
        if self._still:
            estimate.correct_gyro_bias(self._rate / self._seconds, self._seconds)
        self._restart()
