"""Files of sensors and estimated poses in the folder of a drive, and the calibration of the sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import read_json, write_json
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose

LOCALISATION = "localisation"  # folder of these files
CALIBRATION, SENSORS, ESTIMATES = "calibration.json", "sensors.parquet", "estimates.parquet"
ESTIMATE = "estimate.parquet"  # of an autonomous drive: the pose by which the rover drove
IMU_COLUMNS = ("gx_rad_s", "gy_rad_s", "gz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")  # of the readings
ESTIMATOR_COLUMNS = ("estimator", "pictures")  # of the estimates, with the columns of a trajectory


@dataclass(frozen=True)
class CalibratedCamera:
    """Camera fixed to the rover."""

    base_from_camera: Pose
    lens: Lens  # of the pictures of the drive


@dataclass(frozen=True)
class Imu:
    """Noise densities of an IMU at the origin of base_link, with its axes."""

    unit: str  # name of the product
    rate_hz: float
    gyroscope_noise: float  # rad/s/sqrt(Hz)
    gyroscope_walk: float  # rad/s2/sqrt(Hz)
    accelerometer_noise: float  # m/s2/sqrt(Hz)
    accelerometer_walk: float  # m/s3/sqrt(Hz)


@dataclass(frozen=True)
class EncodedWheel:
    """Wheel with encoders of spin and steering."""

    position_m: tuple[float, float, float]  # centre in base_link with the suspension at rest
    radius_m: float


@dataclass(frozen=True)
class SensorCalibration:
    """Sensors of a drive; `stereo` names the left and the right camera of the stereo pair, if there is one."""

    cameras: Mapping[str, CalibratedCamera]
    imu: Imu
    wheels: Mapping[str, EncodedWheel]
    stereo: tuple[str, str] | None

    def write(self, path: Path) -> None:
        cameras = {
            name: {"base_from_camera": camera.base_from_camera.matrix.tolist(), "lens": asdict(camera.lens)}
            for name, camera in self.cameras.items()
        }
        wheels = {name: asdict(wheel) for name, wheel in self.wheels.items()}
        write_json(path, {"cameras": cameras, "imu": asdict(self.imu), "wheels": wheels, "stereo": self.stereo})


def read_sensor_calibration(path: Path) -> SensorCalibration:
    """Read the calibration of a drive."""
    content = read_json(path)
    try:
        cameras = {
            name: CalibratedCamera(Pose.from_matrix(np.array(entry["base_from_camera"])), _lens(entry["lens"]))
            for name, entry in content["cameras"].items()
        }
        wheels = {
            name: EncodedWheel(tuple(entry["position_m"]), entry["radius_m"])
            for name, entry in content["wheels"].items()
        }
        stereo = (content["stereo"][0], content["stereo"][1]) if content["stereo"] else None
        return SensorCalibration(cameras, Imu(**content["imu"]), wheels, stereo)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise FormatError("is no calibration of a drive; run the drive again", path=path) from error


def stereo_pair(cameras: Mapping[str, CalibratedCamera]) -> tuple[str, str] | None:
    """Return the first two cameras side by side with equal lenses and directions, left and right; None without."""
    for left, first in cameras.items():
        for right, second in cameras.items():
            left_from_right = first.base_from_camera.inverse() @ second.base_from_camera
            beside = np.array([left_from_right.translation[0], 0.0, 0.0])
            parallel = np.allclose(left_from_right.matrix, Pose(np.eye(3), beside).matrix, atol=1e-9)
            if beside[0] > 0 and parallel and first.lens == second.lens:
                return left, right
    return None


def _lens(entry: Mapping[str, Any]) -> Lens:
    return Lens(**{**entry, "distortion": tuple(entry["distortion"])})
