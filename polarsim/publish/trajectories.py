"""The rover's drives as EuRoC and TUM folders, for tests of visual odometry and SLAM.

Stamps are the simulation time plus 1 s, as in the drive's bag. Ground truth is exact, from the simulation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from polarsim.formats.ros import stamp_ns
from polarsim.formats.tables import read_parquet
from polarsim.geometry.poses import Pose
from polarsim.geometry.trajectories import POSE_COLUMNS, Trajectory
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue
from polarsim.run_files.run import TRACE

_VELOCITY = ("vx_m_s", "vy_m_s", "vz_m_s")
_IMU_COLUMNS = ("wx_rad_s", "wy_rad_s", "wz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")
_BODY = (*POSE_COLUMNS, *_VELOCITY, *_IMU_COLUMNS)
_RIGID = 1e-6  # maximum change of the pose relative to the rover of a mounted camera; others are chase cameras


def drive_files(catalogue: Catalogue) -> Iterator[Path]:
    """Yield the images of drives, and each trace four times: as text, a trace is about four times as large."""
    for drive in catalogue.drives:
        yield from (*drive.rglob("*.png"), *[drive / TRACE] * 4)


@dataclass(frozen=True)
class DriveStates:
    """States of a drive: pose of `base_link` in the world frame."""

    folder: Path
    table: pd.DataFrame

    @classmethod
    def read(cls, folder: Path) -> DriveStates:
        return cls(folder, read_parquet(folder / TRACE, _BODY))

    @cached_property
    def trajectory(self) -> Trajectory:
        return Trajectory.from_table(self.table)


@dataclass(frozen=True)
class MountedCamera:
    """Camera mounted on the rover, with images in a single light."""

    name: str
    base_from_camera: Pose
    frames: pd.DataFrame  # frame number and `POSE_COLUMNS`, world from camera
    pictures: Path


def sequences(catalogue: Catalogue) -> Iterator[tuple[str, DriveStates, list[MountedCamera]]]:
    """Yield name, drive and cameras: one sequence per drive and light."""
    for folder in catalogue.drives:
        drive = DriveStates.read(folder)
        views = list(_views(drive))
        for light in sorted({view.pictures.name for view in views}):
            yield f"{folder.name}_{light}", drive, [view for view in views if view.pictures.name == light]
        if not views:
            yield folder.name, drive, []


def _views(drive: DriveStates) -> Iterator[MountedCamera]:
    for path in sorted(drive.folder.glob("*/poses.parquet")):
        frames = read_parquet(path, ("frame", *POSE_COLUMNS))
        if not len(frames):
            continue
        poses = [_pose(row) for row in frames.to_dict("records")]
        bases = drive.trajectory.at(frames["time_s"].to_numpy())
        mounts = [bases.pose(index).inverse() @ pose for index, pose in enumerate(poses)]
        if max(np.abs(mount.matrix - mounts[0].matrix).max() for mount in mounts) > _RIGID:
            continue
        for pictures in sorted(path.parent.glob("*_*_*")):
            if pictures.is_dir() and any(pictures.glob("*.png")):
                yield MountedCamera(path.parent.name, mounts[0], frames, pictures)


def write_euroc(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `<drive>_<light>/mav0/{cam0,imu0,state_groundtruth_estimate0}`; cameras are numbered by name."""
    for name, drive, views in sequences(catalogue):
        folder, table = f"{name}/mav0", drive.table
        stamps = [stamp_ns(time) for time in table["time_s"]]
        imu = table[list(_IMU_COLUMNS)]
        bundle.text(f"{folder}/imu0/data.csv", _csv(_IMU, stamps, imu))
        bundle.text(f"{folder}/imu0/sensor.yaml", _sensor("imu", Pose.identity(), "measurements without noise"))
        truth = table[[*POSE_COLUMNS[1:], *_VELOCITY]].assign(**dict.fromkeys("abcdef", 0.0))  # no biases
        bundle.text(f"{folder}/state_groundtruth_estimate0/data.csv", _csv(_TRUTH, stamps, truth))
        bundle.text(
            f"{folder}/state_groundtruth_estimate0/sensor.yaml",
            _sensor("visual-inertial", Pose.identity(), "exact states of the simulation, synthetic"),
        )
        for number, view in enumerate(views):
            lines = ["#timestamp [ns],filename\n"]
            for stamp, path in _shots(view):
                bundle.copy(f"{folder}/cam{number}/data/{stamp}.png", path)
                lines.append(f"{stamp},{stamp}.png\n")
            bundle.text(f"{folder}/cam{number}/data.csv", "".join(lines))
            comment = f"{view.name}, 12-bit values in 16-bit PNG; lens: camera_info in the bag"
            bundle.text(f"{folder}/cam{number}/sensor.yaml", _sensor("camera", view.base_from_camera, comment))


def write_tum(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `<drive>_<light>/<view>/{rgb/,rgb.txt,groundtruth.txt}` with poses of cameras, or of the rover."""
    for name, drive, views in sequences(catalogue):
        if not views:
            bundle.text(f"{name}/base_link/groundtruth.txt", _tum(drive, Pose.identity(), "base_link"))
        for view in views:
            folder = f"{name}/{view.name}"
            bundle.text(f"{folder}/groundtruth.txt", _tum(drive, view.base_from_camera, f"{view.name}, z forward"))
            lines = ["# timestamp filename\n"]
            for stamp, path in _shots(view):
                shown = f"{stamp // 10**9}.{stamp % 10**9:09d}"
                bundle.copy(f"{folder}/rgb/{shown}.png", path)
                lines.append(f"{shown} rgb/{shown}.png\n")
            bundle.text(f"{folder}/rgb.txt", "".join(lines))


def _shots(view: MountedCamera) -> Iterator[tuple[int, Path]]:
    for frame, time_s in zip(view.frames["frame"], view.frames["time_s"], strict=True):
        path = view.pictures / f"{int(frame):05d}.png"
        if path.is_file():
            yield stamp_ns(time_s), path


def _pose(row: Mapping[Any, Any]) -> Pose:
    rotation = Rotation.from_quat([row["qx"], row["qy"], row["qz"], row["qw"]]).as_matrix()
    return Pose(rotation, np.array([row["x_m"], row["y_m"], row["z_m"]]))


def _tum(drive: DriveStates, base_from_camera: Pose, of: str) -> str:
    lines = [f"# world from {of}\n", "# timestamp tx ty tz qx qy qz qw\n"]
    for row in drive.table.to_dict("records"):
        pose = _pose(row) @ base_from_camera
        stamp = stamp_ns(row["time_s"])
        rotation = Rotation.from_matrix(pose.rotation).as_quat(canonical=True)
        values = " ".join(repr(float(value)) for value in (*pose.translation, *rotation))
        lines.append(f"{stamp // 10**9}.{stamp % 10**9:09d} {values}\n")
    return "".join(lines)


def _csv(head: str, stamps: list[int], table: pd.DataFrame) -> str:
    return head + table.astype(float).set_axis(stamps).to_csv(header=False, lineterminator="\n")


def _sensor(kind: str, base_from_sensor: Pose, comment: str) -> str:
    content = {
        "sensor_type": kind,
        "comment": comment,
        "T_BS": {"cols": 4, "rows": 4, "data": [float(value) for value in base_from_sensor.matrix.ravel()]},
    }
    return yaml.safe_dump(content, sort_keys=False)


_IMU = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)
_TRUTH = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],"
    "v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],"
    "b_w_RS_S_z [rad s^-1],b_a_RS_S_x [m s^-2],b_a_RS_S_y [m s^-2],b_a_RS_S_z [m s^-2]\n"
)
