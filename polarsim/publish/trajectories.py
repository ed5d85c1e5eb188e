"""The rover's drives as EuRoC and TUM folders, for tests of odometry and SLAM, with baselines.

Stamps are the simulation time plus 1 s, as in the drive's bag. Ground truth is exact, from the simulation; readings of
IMU and wheels have the errors of sensors. Estimates are those of the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from polarsim.errors import FormatError
from polarsim.formats.ros import stamp_ns
from polarsim.formats.tables import read_parquet
from polarsim.geometry.poses import Pose
from polarsim.geometry.trajectories import POSE_COLUMNS, Trajectory, trajectory_errors
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue
from polarsim.run_files.localisation import (
    CALIBRATION,
    ESTIMATES,
    ESTIMATOR_COLUMNS,
    IMU_COLUMNS,
    LOCALISATION,
    SENSORS,
    CalibratedCamera,
    Imu,
    SensorCalibration,
    read_sensor_calibration,
)
from polarsim.run_files.run import TRACE

BASELINES = "baselines.csv"
_VELOCITY = ("vx_m_s", "vy_m_s", "vz_m_s")
_BODY = (*POSE_COLUMNS, *_VELOCITY)


def drive_files(catalogue: Catalogue) -> Iterator[Path]:
    """Yield the images of drives, and traces and readings four times: as text, they are about four times as large."""
    for drive in catalogue.drives:
        yield from (*drive.rglob("*.png"), *[drive / TRACE, drive / LOCALISATION / SENSORS] * 4)


def without_sensors(catalogue: Catalogue) -> str:
    """Return the reason why a drive of the run cannot be published as a sequence; empty if all can."""
    missing = [drive.name for drive in catalogue.drives if not (drive / LOCALISATION / ESTIMATES).is_file()]
    return f"no estimated poses in {', '.join(missing)}: run the target `rover` again" if missing else ""


@dataclass(frozen=True)
class MountedCamera:
    """Camera fixed to the rover, with images in a single light."""

    name: str
    calibrated: CalibratedCamera
    frames: pd.DataFrame  # frame number and `POSE_COLUMNS`, world from camera
    pictures: Path


@dataclass(frozen=True)
class DriveSequence:
    """A drive in a single light: true states and readings of `base_link`, images, and estimated poses."""

    name: str
    table: pd.DataFrame  # true states
    readings: pd.DataFrame
    calibration: SensorCalibration
    views: list[MountedCamera]  # the stereo pair first
    estimates: dict[str, Trajectory]  # world from base_link, by estimator

    @cached_property
    def truth(self) -> Trajectory:
        return Trajectory.from_table(self.table)


def sequences(catalogue: Catalogue) -> Iterator[DriveSequence]:
    """Yield a sequence per drive and light."""
    for folder in catalogue.drives:
        calibration = read_sensor_calibration(folder / LOCALISATION / CALIBRATION)
        columns = ("time_s", *IMU_COLUMNS, *_wheel_columns(calibration))
        table, readings = read_parquet(folder / TRACE, _BODY), read_parquet(folder / LOCALISATION / SENSORS, columns)
        estimates = read_parquet(folder / LOCALISATION / ESTIMATES, (*ESTIMATOR_COLUMNS, *POSE_COLUMNS))
        views = list(_views(folder, calibration))
        for light in sorted({view.pictures.name for view in views}) or [""]:
            chosen = estimates[estimates["pictures"].isin(["", light])].groupby("estimator")
            yield DriveSequence(
                "_".join(filter(None, [folder.name, light])), table, readings, calibration,
                [view for view in views if view.pictures.name == light],
                {str(name): Trajectory.from_table(rows) for name, rows in chosen},
            )  # fmt: skip


def _views(folder: Path, calibration: SensorCalibration) -> Iterator[MountedCamera]:
    pair = calibration.stereo or ()
    for name in (*pair, *sorted(set(calibration.cameras) - set(pair))):
        path = folder / name / "poses.parquet"
        if not path.is_file():
            continue
        frames = read_parquet(path, ("frame", *POSE_COLUMNS))
        for pictures in sorted(path.parent.glob("*_*_*")):
            if pictures.is_dir() and any(pictures.glob("*.png")):
                yield MountedCamera(name, calibration.cameras[name], frames, pictures)


def write_euroc(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `<drive>_<light>/mav0/{cam0,cam1,imu0,wheels0,state_groundtruth_estimate0}` and the estimates.

    `cam0` and `cam1` are the stereo pair, if there is one. `wheels0` is no part of EuRoC.
    """
    found = list(sequences(catalogue))
    for sequence in found:
        folder, table, readings = f"{sequence.name}/mav0", sequence.table, sequence.readings
        stamps, read_at = ([stamp_ns(time) for time in part["time_s"]] for part in (table, readings))
        bundle.text(f"{folder}/imu0/data.csv", _csv(_IMU, read_at, readings[list(IMU_COLUMNS)]))
        bundle.text(f"{folder}/imu0/sensor.yaml", _imu_sensor(sequence.calibration.imu))
        wheels = _wheel_columns(sequence.calibration)
        bundle.text(f"{folder}/wheels0/data.csv", _csv(_wheel_header(wheels), read_at, readings[wheels]))
        bundle.text(f"{folder}/wheels0/sensor.yaml", _wheel_sensor(sequence.calibration))
        truth = table[[*POSE_COLUMNS[1:], *_VELOCITY]].assign(**dict.fromkeys("abcdef", 0.0))  # no biases
        bundle.text(f"{folder}/state_groundtruth_estimate0/data.csv", _csv(_TRUTH, stamps, truth))
        bundle.text(
            f"{folder}/state_groundtruth_estimate0/sensor.yaml",
            _sensor("visual-inertial", Pose.identity(), "exact states of the simulation, synthetic"),
        )
        for number, view in enumerate(sequence.views):
            lines = ["#timestamp [ns],filename\n"]
            for stamp, path in _shots(view):
                bundle.copy(f"{folder}/cam{number}/data/{stamp}.png", path)
                lines.append(f"{stamp},{stamp}.png\n")
            bundle.text(f"{folder}/cam{number}/data.csv", "".join(lines))
            bundle.text(f"{folder}/cam{number}/sensor.yaml", _camera_sensor(view))
        for estimator, trajectory in sequence.estimates.items():
            text = _tum(trajectory, Pose.identity(), f"base_link, estimated by {estimator}")
            bundle.text(f"{sequence.name}/estimates/{estimator}.txt", text)
    _write_baselines(found, bundle)


def write_tum(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `<drive>_<light>/<view>/{rgb/,rgb.txt,groundtruth.txt,<estimator>.txt}` with poses of cameras.

    Without images the poses are those of the rover.
    """
    found = list(sequences(catalogue))
    for sequence in found:
        base = "base_link", Pose.identity()
        frames = [(view.name, view.calibrated.base_from_camera) for view in sequence.views] or [base]
        for frame, base_from_frame in frames:
            folder, of = f"{sequence.name}/{frame}", frame if frame == base[0] else f"{frame}, z forward"
            bundle.text(f"{folder}/groundtruth.txt", _tum(sequence.truth, base_from_frame, of))
            for estimator, trajectory in sequence.estimates.items():
                text = _tum(trajectory, base_from_frame, f"{of}, estimated by {estimator}")
                bundle.text(f"{folder}/{estimator}.txt", text)
        for view in sequence.views:
            folder, lines = f"{sequence.name}/{view.name}", ["# timestamp filename\n"]
            for stamp, path in _shots(view):
                shown = f"{stamp // 10**9}.{stamp % 10**9:09d}"
                bundle.copy(f"{folder}/rgb/{shown}.png", path)
                lines.append(f"{shown} rgb/{shown}.png\n")
            bundle.text(f"{folder}/rgb.txt", "".join(lines))
    _write_baselines(found, bundle)


def _write_baselines(found: Sequence[DriveSequence], bundle: Bundle) -> None:
    """Write the errors of the estimates in the run: a row per sequence and estimator, see `TrajectoryErrors`."""
    rows = []
    for sequence in found:
        for estimator, trajectory in sequence.estimates.items():
            errors = trajectory_errors(trajectory, sequence.truth)
            rows.append(
                {
                    "sequence": sequence.name,
                    "estimator": estimator,
                    "path_m": errors.path,
                    "end_m": errors.end,
                    "end_percent": 100 * errors.end / errors.path,
                    "mean_m": errors.mean,
                    "rms_m": errors.rms,
                    "rms_aligned_m": errors.rms_aligned,
                    "relative_m": errors.relative,
                    "relative_deg": np.degrees(errors.relative_angle),
                }
            )
    if rows:
        bundle.text(BASELINES, pd.DataFrame(rows).to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def _shots(view: MountedCamera) -> Iterator[tuple[int, Path]]:
    for frame, time_s in zip(view.frames["frame"], view.frames["time_s"], strict=True):
        path = view.pictures / f"{int(frame):05d}.png"
        if path.is_file():
            yield stamp_ns(time_s), path


def _tum(trajectory: Trajectory, base_from_frame: Pose, of: str) -> str:
    """Return a trajectory of a frame fixed to base_link as text."""
    positions = trajectory.positions + trajectory.rotations.apply(base_from_frame.translation)
    quaternions = (trajectory.rotations * Rotation.from_matrix(base_from_frame.rotation)).as_quat(canonical=True)
    lines = [f"# world from {of}\n", "# timestamp tx ty tz qx qy qz qw\n"]
    for time_s, row in zip(trajectory.times, np.column_stack([positions, quaternions]).tolist(), strict=True):
        stamp = stamp_ns(time_s)
        lines.append(f"{stamp // 10**9}.{stamp % 10**9:09d} {' '.join(map(repr, row))}\n")
    return "".join(lines)


def _wheel_columns(calibration: SensorCalibration) -> list[str]:
    """Return the columns of speeds and steering angles of all wheels."""
    return [f"{code}_{what}" for what in ("spin_rad_s", "steer_rad") for code in calibration.wheels]


def _wheel_header(columns: list[str]) -> str:
    units = {"spin_rad_s": "spin [rad s^-1]", "steer_rad": "steer [rad]"}
    names = [f"{code}_{units[what]}" for code, _, what in (column.partition("_") for column in columns)]
    return f"#timestamp [ns],{','.join(names)}\n"


def _csv(head: str, stamps: list[int], table: pd.DataFrame) -> str:
    return head + table.astype(float).set_axis(stamps).to_csv(header=False, lineterminator="\n")


def _sensor(kind: str, base_from_sensor: Pose, comment: str, **others: object) -> str:
    data = [float(value) for value in base_from_sensor.matrix.ravel()]
    content = {"sensor_type": kind, "comment": comment, "T_BS": {"cols": 4, "rows": 4, "data": data}}
    return yaml.safe_dump(content | others, sort_keys=False)


def _imu_sensor(imu: Imu) -> str:
    return _sensor(
        "imu",
        Pose.identity(),
        f"simulated {imu.unit}",
        rate_hz=imu.rate_hz,
        gyroscope_noise_density=imu.gyroscope_noise,
        gyroscope_random_walk=imu.gyroscope_walk,
        accelerometer_noise_density=imu.accelerometer_noise,
        accelerometer_random_walk=imu.accelerometer_walk,
    )


def _wheel_sensor(calibration: SensorCalibration) -> str:
    wheels = {
        name: {"position_m": list(wheel.position_m), "radius_m": wheel.radius_m}
        for name, wheel in calibration.wheels.items()
    }
    return _sensor("wheels", Pose.identity(), "encoders: speed of the rim, steering to the left", wheels=wheels)


def _camera_sensor(view: MountedCamera) -> str:
    """Return the sensor file of a camera, with its lens in OpenCV's convention of pixels."""
    lens, times = view.calibrated.lens, view.frames["time_s"].to_numpy()
    matrix = lens.opencv_matrix()
    radial, third = [float(value) for value in lens.distortion[:4]], float(lens.distortion[4])
    if third:
        raise FormatError(f"lens of {view.name}: EuRoC has no third radial term", path=view.pictures)
    return _sensor(
        "camera",
        view.calibrated.base_from_camera,
        f"{view.name}, 12-bit values in 16-bit PNG",
        rate_hz=round(float((len(times) - 1) / (times[-1] - times[0])), 6) if len(times) > 1 else 0.0,
        resolution=[lens.width, lens.height],
        camera_model="pinhole",
        intrinsics=[float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2])],
        distortion_model="radial-tangential",
        distortion_coefficients=radial,
    )


_IMU = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)
_TRUTH = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],"
    "v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],"
    "b_w_RS_S_z [rad s^-1],b_a_RS_S_x [m s^-2],b_a_RS_S_y [m s^-2],b_a_RS_S_z [m s^-2]\n"
)
