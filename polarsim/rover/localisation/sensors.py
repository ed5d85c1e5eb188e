"""Readings of wheel encoders, steering encoders, gyroscope and accelerometer, computed from the true state.

Encoders count steps of an angle, so a wheel speed is the number of steps since the last reading, over the time, and
its sum has no drift. Gyroscope and accelerometer give the mean rate and the mean specific force since the last reading,
as the delta angles and delta velocities of such units. Each axis has white noise and a bias that does a random walk.

The IMU is an Inertial Sense IMX-5. Its manual (docs.inertialsense.com, "IMU Specifications" and "Rugged-3") states
angular random walk 0.16 deg/sqrt(h), gyroscope bias instability 1.5 deg/h, velocity random walk 0.02 m/s/sqrt(h) and
accelerometer bias instability 19 ug. The bias walks at the rate K at which the minimum of the Allan deviation of white
noise N and walk, sqrt(2 N K / sqrt(3)), is the bias instability. The rover averages the readings at rest in a known
attitude before the drive, so the bias at time 0 is the error of this average.

Not modelled: scale, alignment, temperature, the lever arm of the unit and the rotation of the Moon (0.55 deg/h).
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.randomness import generator
from polarsim.rover.drive.state import RoverState
from polarsim.rover.drive.trace import Trace
from polarsim.rover.vehicle.table import WHEELS
from polarsim.run_files.localisation import IMU_COLUMNS

UNIT = "Inertial Sense IMX-5"
RATE_HZ = 100.0  # readings per second, one before each command
STEER_COLUMNS = tuple(f"{code}_steer_rad" for code in WHEELS)
SPIN_COLUMNS = tuple(f"{code}_spin_rad_s" for code in WHEELS)
GYRO_COLUMNS, ACCELERATION_COLUMNS = (
    IMU_COLUMNS[:3],
    IMU_COLUMNS[3:],
)  # rate; specific force: at rest it is opposite to gravity
SENSOR_COLUMNS = ("time_s", *SPIN_COLUMNS, *STEER_COLUMNS, *GYRO_COLUMNS, *ACCELERATION_COLUMNS)

ENCODER_STEPS = 2**16  # per turn, of wheels and steering
REST_S = 60.0  # time at rest before the drive over which the bias is averaged
_HOUR_S = 3600.0
GYRO_NOISE = math.radians(0.16) / math.sqrt(_HOUR_S)  # rad/sqrt(s)
GYRO_INSTABILITY = math.radians(1.5) / _HOUR_S  # rad/s
ACCELERATION_NOISE = 0.02 / math.sqrt(_HOUR_S)  # m/s/sqrt(s)
ACCELERATION_INSTABILITY = 19e-6 * 9.80665  # m/s2

# What the sensors measure: time, quaternion w x y z and velocity of base_link in the world, angles of the wheels.
_TRUE_COLUMNS = (
    "time_s", "qw", "qx", "qy", "qz", "vx_m_s", "vy_m_s", "vz_m_s", *STEER_COLUMNS,
    *(f"{code}_spin_rad" for code in WHEELS),
)  # fmt: skip


def bias_walk(noise: float, instability: float) -> float:
    """Return the rate of the bias's random walk, in units of noise per second (see above)."""
    return instability**2 * math.sqrt(3) / (2 * noise)


GYRO_WALK = bias_walk(GYRO_NOISE, GYRO_INSTABILITY)  # rad/s/sqrt(s)
ACCELERATION_WALK = bias_walk(ACCELERATION_NOISE, ACCELERATION_INSTABILITY)  # m/s2/sqrt(s)
# Standard deviations of the biases at time 0.
GYRO_BIAS, ACCELERATION_BIAS = (noise / math.sqrt(REST_S) for noise in (GYRO_NOISE, ACCELERATION_NOISE))


class Sensors:
    """Sensors of a drive; equal seeds and states give equal readings, one by one or many at a time.

    The first reading is that of a rover at rest.
    """

    def __init__(self, seed: int, gravity_m_s2: float) -> None:
        self._rng = generator(seed, "rover", "sensors")
        self._up = np.array([0.0, 0.0, gravity_m_s2])
        self._bias = self._rng.standard_normal(6) * np.repeat([GYRO_BIAS, ACCELERATION_BIAS], 3)
        self._before: np.ndarray | None = None

    def read(self, state: RoverState) -> np.ndarray:
        """Return (len(SENSOR_COLUMNS),) readings at a state."""
        angles = state.wheel("steer_rad"), state.wheel("spin_rad")
        return self._rows(np.concatenate([[state.time], state.rotation, state.velocity, *angles])[None])[0]

    def table(self, trace: Trace) -> pd.DataFrame:
        """Return the readings at the rows of a trace, `SENSOR_COLUMNS`."""
        return pd.DataFrame(self._rows(trace.table[list(_TRUE_COLUMNS)].to_numpy()), columns=list(SENSOR_COLUMNS))

    def _rows(self, true: np.ndarray) -> np.ndarray:
        """Return (n, len(SENSOR_COLUMNS)) readings at true values (n, len(_TRUE_COLUMNS))."""
        before = true[:1] if self._before is None else self._before
        self._before = true[-1:].copy()
        full = np.concatenate([before, true])
        time, quaternion, velocity, steer, spin = np.split(full, [1, 5, 8, 12], axis=1)
        seconds = np.diff(time, axis=0)
        seconds = np.where(seconds > 0, seconds, 1 / RATE_HZ)
        world_from_base = Rotation.from_quat(quaternion[:, [1, 2, 3, 0]])
        turn = (world_from_base[:-1].inv() * world_from_base[1:]).as_rotvec()
        midway = world_from_base[:-1] * Rotation.from_rotvec(turn / 2)
        force = midway.inv().apply(np.diff(velocity, axis=0) / seconds + self._up)
        exact = np.concatenate([turn / seconds, force], axis=1)
        noise = self._rng.standard_normal((len(true), 12))
        root = np.sqrt(seconds)
        walk = noise[:, 6:] * np.repeat([GYRO_WALK, ACCELERATION_WALK], 3) * root
        bias = np.cumsum(np.concatenate([self._bias[None], walk]), axis=0)[1:]
        self._bias = bias[-1]
        white = noise[:, :6] * np.repeat([GYRO_NOISE, ACCELERATION_NOISE], 3) / root
        step = 2 * math.pi / ENCODER_STEPS
        speed = np.diff(np.floor(spin / step), axis=0) * step / seconds
        return np.concatenate([time[1:], speed, np.rint(steer[1:] / step) * step, exact + bias + white], axis=1)
