"""Estimated poses of a recorded drive: the rover's localisation reads the recorded sensors and pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import tone
from polarsim.detect.stereo.rectify import Rectification, rectify
from polarsim.formats import png, tables
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.geometry.trajectories import POSE_COLUMNS
from polarsim.rover.cameras.layout import frame_files
from polarsim.rover.drive.state import recorded_states
from polarsim.rover.drive.trace import Trace, read_trace
from polarsim.rover.localisation.localiser import Localiser
from polarsim.rover.localisation.stereo_motion import StereoMotion
from polarsim.rover.vehicle.table import Vehicle, read_vehicle
from polarsim.run_files.localisation import (
    CALIBRATION,
    ESTIMATES,
    ESTIMATOR_COLUMNS,
    LOCALISATION,
    SensorCalibration,
    read_sensor_calibration,
)
from polarsim.schemas.rover import FUSED, ODOMETRY

Pairs = dict[float, tuple[Path, Path]]  # files of stereo pairs by time, s
_LOG_EVERY = 5  # readings


def write_estimates_of_drive(*, drive: Path, vehicle: Path, picture_sets: Sequence[str], seed: int) -> None:
    """Write the estimates of the poses of a recorded drive to its folder."""
    write_estimates(drive, read_trace(drive), read_vehicle(vehicle), picture_sets, seed)


def write_estimates(folder: Path, trace: Trace, vehicle: Vehicle, picture_sets: Sequence[str], seed: int) -> None:
    """Write the estimates of wheels and IMU, and of these with the stereo pair in each set of pictures."""
    calibration = read_sensor_calibration(folder / LOCALISATION / CALIBRATION)
    gravity = float(trace.drive["options"]["soil"]["gravity_m_s2"])
    estimated: list[tuple[str, Localiser, Pairs]] = [("", Localiser(vehicle, seed, gravity), {})]
    if calibration.stereo:
        rig, base_from_camera = stereo_rig(calibration, calibration.stereo)
        for name in picture_sets:
            stereo = StereoMotion(rig)
            localiser = Localiser(vehicle, seed, gravity, stereo=stereo, base_from_camera=base_from_camera)
            estimated.append((name, localiser, dict(_pairs(folder, calibration.stereo, name))))
    parts = []
    for name, localiser, pairs in estimated:
        table = replay(trace, localiser, pairs)[list(POSE_COLUMNS)]
        parts.append(table.assign(estimator=FUSED if name else ODOMETRY, pictures=name))
    columns = [*ESTIMATOR_COLUMNS, *POSE_COLUMNS]
    tables.write_parquet(folder / LOCALISATION / ESTIMATES, pd.concat(parts, ignore_index=True)[columns])


def replay(trace: Trace, localiser: Localiser, pairs: Pairs) -> pd.DataFrame:
    """Return the estimates of a localiser that reads a recorded drive."""
    due = iter(sorted(pairs))
    time_s = next(due, np.inf)
    for number, state in enumerate(recorded_states(trace)):
        localiser.read(state)
        if state.time >= time_s - 1e-9:
            left, right = tone.to_8_bits(np.stack([png.read_png(path) for path in pairs[time_s]]))
            localiser.add_pair(left, right)
            time_s = next(due, np.inf)
        if number % _LOG_EVERY == 0:
            localiser.log()
    return localiser.estimate()


def stereo_rig(calibration: SensorCalibration, names: tuple[str, str]) -> tuple[Rectification, Pose]:
    """Return the rectification of a stereo pair, and `base_from_camera` of its rectified left camera."""
    left, right = (calibration.cameras[name] for name in names)
    left_from_right = left.base_from_camera.inverse() @ right.base_from_camera
    rectified = rectify(StereoRig(left.lens, right.lens, left_from_right), 1.0)
    return rectified, left.base_from_camera @ rectified.left_from_rectified


def _pairs(folder: Path, names: tuple[str, str], pictures: str) -> Iterator[tuple[float, tuple[Path, Path]]]:
    """Yield the time and the files of each stereo pair in a set of pictures."""
    frames = tables.read_parquet(folder / names[0] / "poses.parquet", ("frame", "time_s"))
    left, right = (frame_files(folder / name / pictures, frames["frame"]) for name in names)
    yield from zip(frames["time_s"], zip(left, right, strict=True), strict=True)
