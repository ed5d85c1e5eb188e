"""Error-state extended Kalman filter of the rover's pose, with stereo motions by stochastic cloning.

The gyroscope turns the attitude, the wheels move the position along it. Wheels are no measurement of a velocity state
but the input of the propagation, since the soil, not inertia, decides how far a slow rover moves in a hundredth of a
second. Their error is a state: slip (a share of the distance), drift to the left and climb (angles between the
commanded and the real direction), each a Gauss-Markov process. Measurements are gravity, a standing rover, and motions
of the stereo camera relative to its pose at the last pair, which is part of the state (Roumeliotis & Burdick, ICRA
2002; Mourikis, Roumeliotis & Burdick, IEEE Trans. Robotics 23 (2007) 717). Attitude errors are rotation vectors in the
world frame, so that the filter's gain does not depend on the heading.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from polarsim.geometry.poses import Pose, orthogonal_rotation
from polarsim.geometry.vectors import cross_matrices
from polarsim.rover.localisation.motion import Motion
from polarsim.rover.localisation.sensors import (
    ACCELERATION_BIAS,
    ACCELERATION_WALK,
    GYRO_BIAS,
    GYRO_NOISE,
    GYRO_WALK,
)

# Errors: rotation (world), position (world), biases of gyroscope and accelerometer, wheels, and pose at the last pair.
ATTITUDE, POSITION, GYRO, ACCELERATION, WHEELS = (slice(first, first + 3) for first in range(0, 15, 3))
OLD_ATTITUDE, OLD_POSITION = slice(15, 18), slice(18, 21)
_STATES = 21
_POSE, _OLD_POSE = slice(0, 6), slice(15, 21)

# Errors of the wheels: standard deviation and correlation time of slip, drift and climb, and a random walk of the
# position, m per square root of metre driven. In a simulated drive of 62 m over craters the slip is 5.7 % of the way;
# without this mean, slip and drift over 2 m vary by 1.0 and 1.5 %.
WHEEL_SD, WHEEL_S = np.array([0.06, 0.015, 0.01]), np.array([100.0, 20.0, 100.0])
STEP_NOISE = 0.013
GRAVITY_SD = 0.01  # m/s2, of the mean acceleration of a second that wheels and gyroscope do not explain
REST_GRAVITY_SD = 0.002  # m/s2, of a standing rover
_START_SD = 1e-4  # rad and m: the start is given
# Limits of the squared normalised difference of a motion, and of its rotation.
_GATE, _ROTATION_GATE = float(chi2.ppf(0.999, 6)), float(chi2.ppf(0.999, 3))
_SLIDE_M = 0.4  # maximum distance between pairs that wheels miss, for example when a wheel drops from a rock


class PoseFilter:
    """Pose of base_link in the world and its covariance; `rejected`: number of motions that contradict the rest."""

    def __init__(self, start: Pose, gravity_m_s2: float) -> None:
        self.rotation, self.position = start.rotation.copy(), start.translation.astype(float)
        self.gyro_bias, self.acceleration_bias, self.wheel_error = np.zeros(3), np.zeros(3), np.zeros(3)
        sd = np.concatenate([np.full(6, _START_SD), np.full(3, GYRO_BIAS), np.full(3, ACCELERATION_BIAS), WHEEL_SD])
        self.covariance = np.zeros((_STATES, _STATES))
        self.covariance[:15, :15] = np.diag(sd**2)
        self.rejected = 0
        self._gravity = gravity_m_s2
        self._old: Pose | None = None

    @property
    def pose(self) -> Pose:
        return Pose(self.rotation, self.position)

    def normalised_error(self, true: Pose) -> float:
        """Return the squared error of the pose normalised by its covariance; its mean is 6 if the filter is right."""
        rotation = Rotation.from_matrix(true.rotation @ self.rotation.T).as_rotvec()
        error = np.concatenate([rotation, true.translation - self.position])
        return float(error @ np.linalg.solve(self.covariance[_POSE, _POSE], error))

    def propagate(self, seconds: float, gyro: np.ndarray, wheels: np.ndarray) -> np.ndarray:
        """Advance by a reading of the gyroscope (3,), rad/s, and the velocity vx, vy (2,) of the wheels, m/s.

        Return the mean attitude (3, 3) during the reading.
        """
        turn = (gyro - self.gyro_bias) * seconds
        midway = self.rotation @ _exp(turn / 2)
        vx, vy = float(wheels[0]), float(wheels[1])
        of_error = np.array([[vx, -vy, 0.0], [vy, vx, 0.0], [0.0, 0.0, vx]])
        step = midway @ (of_error[:, 0] + of_error @ self.wheel_error) * seconds
        self.rotation = midway @ _exp(turn / 2)
        self.position = self.position + step
        kept = np.exp(-seconds / WHEEL_S)
        self.wheel_error = self.wheel_error * kept
        change = np.eye(_STATES)
        change[ATTITUDE, GYRO] = -midway * seconds
        change[POSITION, ATTITUDE] = -cross_matrices(step[None])[0]
        change[POSITION, WHEELS] = midway @ of_error * seconds
        change[WHEELS, WHEELS] = np.diag(kept)
        noise = np.zeros(_STATES)
        noise[ATTITUDE] = GYRO_NOISE**2 * seconds
        noise[POSITION] = STEP_NOISE**2 * math.hypot(vx, vy) * seconds
        noise[GYRO] = GYRO_WALK**2 * seconds
        noise[ACCELERATION] = ACCELERATION_WALK**2 * seconds
        noise[WHEELS] = WHEEL_SD**2 * (1 - kept**2)
        self.covariance = change @ self.covariance @ change.T
        self.covariance.flat[:: _STATES + 1] += noise
        return midway

    def correct_tilt(self, excess: np.ndarray, attitude: np.ndarray, *, at_rest: bool) -> None:
        """Correct roll and pitch by gravity.

        Parameters
        ----------
        excess : (3,) float
            Mean specific force in the world, with the estimated attitude and bias, without the change of velocity.
        attitude : (3, 3) float
            Mean attitude during this time.
        """
        jacobian = np.zeros((2, _STATES))
        jacobian[:, ATTITUDE] = self._gravity * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
        jacobian[:, ACCELERATION] = attitude[:2]
        sd = REST_GRAVITY_SD if at_rest else GRAVITY_SD
        self._correct(jacobian, excess[:2], sd**2 * np.eye(2))

    def correct_gyro_bias(self, gyro: np.ndarray, seconds: float) -> None:
        """Correct the bias by the mean rate (3,), rad/s, of the gyroscope of a rover that stood for `seconds`."""
        jacobian = np.zeros((3, _STATES))
        jacobian[:, GYRO] = np.eye(3)
        self._correct(jacobian, gyro - self.gyro_bias, GYRO_NOISE**2 / seconds * np.eye(3))

    def store_pose(self) -> None:
        """Store the current pose as the pose of the last pair."""
        self._old = Pose(self.rotation.copy(), self.position.copy())
        self.covariance[_OLD_POSE, :] = self.covariance[_POSE, :]
        self.covariance[:, _OLD_POSE] = self.covariance[:, _POSE]

    def expected_motion(self, base_from_camera: Pose) -> Pose:
        """Return the motion `before_from_now` of a camera since the last pair."""
        old, new = self._cameras(base_from_camera)
        return old.inverse() @ new

    def _cameras(self, base_from_camera: Pose) -> tuple[Pose, Pose]:
        """Return the poses of a camera in the world at the last pair and now."""
        assert self._old is not None, "no pose is stored"
        return self._old @ base_from_camera, self.pose @ base_from_camera

    def correct_by_motion(self, motion: Motion, base_from_camera: Pose) -> bool:
        """Correct by the motion of a camera since the last pair; return whether it agrees with the other sensors.

        A motion with the rotation of the gyroscope and another translation is right, and the wheels are wrong: they
        spin, slide and drop among rocks. Their uncertainty since the last pair then becomes the difference.
        """
        assert self._old is not None, "no pose is stored"
        old, new = self._cameras(base_from_camera)
        expected = old.inverse() @ new
        turned = Rotation.from_matrix(expected.rotation.T @ motion.before_from_now.rotation).as_rotvec()
        difference = np.concatenate([turned, motion.before_from_now.translation - expected.translation])
        to_old = old.rotation.T
        jacobian = np.zeros((6, _STATES))
        jacobian[:3, ATTITUDE], jacobian[:3, OLD_ATTITUDE] = new.rotation.T, -new.rotation.T
        jacobian[3:, POSITION], jacobian[3:, OLD_POSITION] = to_old, -to_old
        jacobian[3:, ATTITUDE] = -to_old @ cross_matrices((new.translation - self.position)[None])[0]
        jacobian[3:, OLD_ATTITUDE] = to_old @ cross_matrices((new.translation - self._old.translation)[None])[0]
        spread = jacobian @ self.covariance @ jacobian.T + motion.covariance
        if difference @ np.linalg.solve(spread, difference) > _GATE:
            apart = float(difference[3:] @ difference[3:])
            turn = difference[:3] @ np.linalg.solve(spread[:3, :3], difference[:3])
            if turn > _ROTATION_GATE or apart > _SLIDE_M**2:
                self.rejected += 1
                return False
            self.covariance[POSITION, POSITION] += apart * np.eye(3)
        self._correct(jacobian, difference, motion.covariance)
        return True

    def _correct(self, jacobian: np.ndarray, difference: np.ndarray, noise: np.ndarray) -> None:
        """Apply the difference (m,) between a measurement with covariance (m, m) and its prediction."""
        spread = jacobian @ self.covariance @ jacobian.T + noise
        weight = np.linalg.solve(spread, jacobian @ self.covariance).T
        error = weight @ difference
        rest = np.eye(_STATES) - weight @ jacobian
        self.covariance = rest @ self.covariance @ rest.T + weight @ noise @ weight.T
        self.rotation = orthogonal_rotation(_exp(error[ATTITUDE]) @ self.rotation)
        self.position = self.position + error[POSITION]
        self.gyro_bias = self.gyro_bias + error[GYRO]
        self.acceleration_bias = self.acceleration_bias + error[ACCELERATION]
        self.wheel_error = self.wheel_error + error[WHEELS]
        if self._old is not None:
            old = _exp(error[OLD_ATTITUDE]) @ self._old.rotation
            self._old = Pose(orthogonal_rotation(old), self._old.translation + error[OLD_POSITION])


def _exp(turn: np.ndarray) -> np.ndarray:
    """Return the rotation matrix (3, 3) of a rotation vector (3,), rad (Rodrigues); faster than SciPy's class."""
    angle = math.sqrt(float(turn @ turn))
    matrix = cross_matrices(turn[None])[0]
    if angle < 1e-6:
        return np.eye(3) + matrix + matrix @ matrix / 2
    squared = matrix @ matrix
    return np.eye(3) + matrix * (math.sin(angle) / angle) + squared * ((1 - math.cos(angle)) / angle**2)
