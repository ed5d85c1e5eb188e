"""Readings and calibration of the sensors in a recorded drive, for localisation by polarsim and by other software."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from polarsim.formats import tables
from polarsim.rover.drive.trace import Trace, read_trace
from polarsim.rover.localisation.sensors import (
    ACCELERATION_NOISE,
    ACCELERATION_WALK,
    GYRO_NOISE,
    GYRO_WALK,
    RATE_HZ,
    UNIT,
    Sensors,
)
from polarsim.rover.vehicle.camera_names import FOLLOWING
from polarsim.rover.vehicle.mounts import mount_of
from polarsim.rover.vehicle.table import Vehicle, read_vehicle
from polarsim.run_files.localisation import (
    CALIBRATION,
    LOCALISATION,
    SENSORS,
    CalibratedCamera,
    EncodedWheel,
    Imu,
    SensorCalibration,
    stereo_pair,
)


def write_sensors_of_drive(*, drive: Path, vehicle: Path, views: Sequence[str], scale: float, seed: int) -> None:
    """Write the readings and the calibration of a recorded drive to its folder."""
    write_sensors(drive, read_trace(drive), read_vehicle(vehicle), views, scale, seed)


def write_sensors(folder: Path, trace: Trace, vehicle: Vehicle, views: Sequence[str], scale: float, seed: int) -> None:
    """Write the readings and the calibration of a drive with pictures of `views` at a scale."""
    gravity = float(trace.drive["options"]["soil"]["gravity_m_s2"])
    tables.write_parquet(folder / LOCALISATION / SENSORS, Sensors(seed, gravity).table(trace))
    calibration_of(vehicle, views, scale).write(folder / LOCALISATION / CALIBRATION)


def calibration_of(vehicle: Vehicle, views: Sequence[str], scale: float) -> SensorCalibration:
    """Return the calibration of all sensors; cameras that follow the rover upright are not fixed to it."""
    mounts = {name: mount_of(vehicle.camera(name), scale) for name in views if name not in FOLLOWING}
    cameras = {name: CalibratedCamera(mount.base_from_camera, mount.lens) for name, mount in mounts.items()}
    imu = Imu(UNIT, RATE_HZ, GYRO_NOISE, GYRO_WALK, ACCELERATION_NOISE, ACCELERATION_WALK)
    wheels: dict[str, EncodedWheel] = {
        wheel.code: EncodedWheel(wheel.position_m, wheel.outer_radius_m) for wheel in vehicle.wheels
    }
    return SensorCalibration(cameras, imu, wheels, stereo_pair(cameras))
