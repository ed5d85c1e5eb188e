"""Write a drive as an MCAP file of ROS 2 messages, without ROS: states, sensors, pictures, detections, ground truth.

Topics are in docs/rover.md. Messages are generated one by one in the order of their stamps, so memory does not grow
with the drive. Stamps are times of the drive's clock, so equal drives give equal bytes. Messages are dictionaries in
units of ROS: metres, radians, seconds, newtons.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.errors import FormatError, with_path
from polarsim.formats import bags, png, ros, tables
from polarsim.formats.files import writing
from polarsim.formats.ros import Message, Stamped, header, pose, stamp_ns
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.rover.cameras.layout import DETECTION_COLUMNS, POSE_COLUMNS, TRUTH_COLUMNS, picture_folder
from polarsim.rover.drive.trace import CONTACTS, Trace, read_trace
from polarsim.rover.export.options import BagOptions
from polarsim.rover.export.sensor_messages import (
    estimates,
    first_per_period,
    joint_state,
    odometry_message,
    readings,
    true_imu,
)
from polarsim.rover.localisation.sensors import SENSOR_COLUMNS
from polarsim.rover.vehicle.camera_names import FOLLOWING
from polarsim.rover.vehicle.mounts import mount_of, pose_of_quaternion
from polarsim.rover.vehicle.table import WHEELS, CameraPart, Vehicle
from polarsim.run_files.localisation import ESTIMATES, LOCALISATION, SENSORS

STATE_HZ = 50.0  # messages of states per second; those of sensors have the rate of the readings
HEIGHT_CELL_M = 0.06  # minimum cell of /terrain/height, since the cells of the drive would need too much space
UP = np.array([0.0, 0.0, 1.0])
CONTACT_CODES = {name: code for code, name in enumerate(CONTACTS)}  # as in polarsim_msgs/WheelState
JOINTS = tuple(f"{code}_{joint}" for code in WHEELS for joint in ("lift", "steer", "spin"))


def write_bag(folder: Path, out: Path, vehicle: Vehicle, options: BagOptions) -> dict[str, int]:
    """Write a drive's folder as a bag and return the number of messages by topic."""
    trace = read_trace(folder)
    streams = [
        _still(trace, vehicle), _states(trace, vehicle), _heights(trace, options), true_imu(trace),
        readings(tables.read_parquet(folder / LOCALISATION / SENSORS, SENSOR_COLUMNS)),
        *estimates(folder / LOCALISATION / ESTIMATES, options),
    ]  # fmt: skip
    for camera in vehicle.cameras:
        pictures = picture_folder(folder, camera.name, options.sun, options.model, options.exposure_ms)
        if pictures.is_dir():
            streams.append(_pictures(camera, pictures, options))
    with writing(out) as temporary:
        return bags.write_mcap_bag(temporary, streams)


def _still(trace: Trace, vehicle: Vehicle) -> Iterator[Stamped]:
    """Yield static frames: the world and the cameras on the body."""
    time_ns = stamp_ns(float(trace.table["time_s"].iloc[0]))
    frames = [ros.transform(time_ns, "map", "odom", Pose.identity())]
    for camera in vehicle.cameras:
        if camera.name not in FOLLOWING:
            mount = mount_of(camera).base_from_camera
            frames.append(ros.transform(time_ns, camera.link, f"{camera.name}_optical", mount))
    yield time_ns, "/tf_static", "tf2_msgs/msg/TFMessage", {"transforms": frames}


def _states(trace: Trace, vehicle: Vehicle) -> Iterator[Stamped]:
    table = trace.table
    times = table["time_s"].to_numpy()
    order = [f"{code}_{name}" for code in WHEELS for name in ("lift_m", "steer_rad", "spin_rad")]
    rates = {
        name: table[f"{name}_s"].to_numpy() if name.endswith("spin_rad") else np.gradient(table[name].to_numpy(), times)
        for name in order
    }
    for index in first_per_period(times, STATE_HZ):
        row = {str(name): value for name, value in table.iloc[int(index)].items()}
        time_ns, base = stamp_ns(row["time_s"]), _pose(row)
        yield time_ns, "/tf", "tf2_msgs/msg/TFMessage", {"transforms": _moving(time_ns, base, row, vehicle)}
        velocity = np.array([row[name] for name in ("vx_m_s", "vy_m_s", "vz_m_s")])
        angular_velocity = np.array([row[name] for name in ("wx_rad_s", "wy_rad_s", "wz_rad_s")])
        odometry = odometry_message(time_ns, base, velocity, angular_velocity)
        yield time_ns, "/odom", "nav_msgs/msg/Odometry", odometry
        joints = joint_state(time_ns, JOINTS, [row[n] for n in order], [rates[n][index] for n in order])
        yield time_ns, "/joint_states", "sensor_msgs/msg/JointState", joints
        yield time_ns, "/wheels/state", "polarsim_msgs/msg/WheelStates", wheel_states(time_ns, row)


def _moving(time_ns: int, base: Pose, row: dict[str, Any], vehicle: Vehicle) -> list[Message]:
    """Return the transforms of the body and of the three links of each wheel."""
    frames = [ros.transform(time_ns, "odom", "base_link", base)]
    for wheel in vehicle.wheels:
        code = wheel.code
        lift, steer, spin = (row[f"{code}_{name}"] for name in ("lift_m", "steer_rad", "spin_rad"))
        for parent, child, moved in (
            ("base_link", f"{code}_arm", Pose(np.eye(3), np.array(wheel.position_m) + lift * UP)),
            (f"{code}_arm", f"{code}_upright", Pose.from_rotvec(np.array([0, 0, steer]), np.zeros(3))),
            (f"{code}_upright", f"{code}_wheel", Pose.from_rotvec(np.array([0, spin, 0]), np.zeros(3))),
        ):
            frames.append(ros.transform(time_ns, parent, child, moved))
    return frames


def _heights(trace: Trace, options: BagOptions) -> Iterator[Stamped]:
    """Yield the heights of the ground, with a step of several cells."""
    if not options.height_hz:
        return
    world, tracks = trace.world, trace.tracks
    step = max(1, round(HEIGHT_CELL_M / world.cell))
    selected = set(first_per_period(tracks.time, options.height_hz).tolist())
    level = world.level.copy()
    for frame, time_s in enumerate(tracks.time):
        tracks.apply(frame, level)
        if frame in selected:
            time_ns = stamp_ns(float(time_s))
            thinned = grid_map(time_ns, level[::step, ::step], step * world.cell, world.x0, world.y0)
            yield time_ns, "/terrain/height", "grid_map_msgs/msg/GridMap", thinned


def _pictures(camera: CameraPart, pictures: Path, options: BagOptions) -> Iterator[Stamped]:
    """Yield the images of a camera, and the ground truth and detections in them."""
    view, frame, lens = pictures.parent, f"{camera.name}_optical", None
    boxes = {
        "truth": _by_frame(view / f"{options.sun}_truth.parquet", TRUTH_COLUMNS),
        "detections": _by_frame(pictures / "detections.parquet", DETECTION_COLUMNS),
    }
    for row in _records(tables.read_parquet(view / "poses.parquet", POSE_COLUMNS)):
        number, picture = int(row["frame"]), pictures / f"{int(row['frame']):05d}.png"
        if not picture.is_file():
            continue
        time_ns, content = stamp_ns(float(row["time_s"])), picture.read_bytes()
        lens = lens or _picture_lens(camera, content, picture)
        if camera.name in FOLLOWING:  # follows the rover and has no link
            moved = ros.transform(time_ns, "map", frame, _pose(row))
            yield time_ns, "/tf", "tf2_msgs/msg/TFMessage", {"transforms": [moved]}
        info = ros.camera_info(time_ns, frame, lens)
        yield time_ns, f"/{camera.name}/camera_info", "sensor_msgs/msg/CameraInfo", info
        if options.images:
            image = ros.image(time_ns, frame, content)
            yield time_ns, f"/{camera.name}/image/compressed", "sensor_msgs/msg/CompressedImage", image
        for topic, rows in boxes.items():
            if rows is not None:
                message = ros.detections(time_ns, frame, rows.get(number, []))
                yield time_ns, f"/{camera.name}/{topic}", "vision_msgs/msg/Detection2DArray", message


def _picture_lens(camera: CameraPart, content: bytes, path: Path) -> Lens:
    """Return the lens of pictures, which may be smaller than the camera's size."""
    with with_path(path):
        size = png.parse_header(content)
        lens = mount_of(camera, size.width / camera.width_px).lens
        if (lens.width, lens.height) != (size.width, size.height):
            raise FormatError(
                f"{size.width} x {size.height} px, camera {camera.name} has {camera.width_px} x {camera.height_px} px"
            )
    return lens


def _pose(row: dict[str, Any]) -> Pose:
    position = np.array([row[name] for name in ("x_m", "y_m", "z_m")])
    return pose_of_quaternion(position, np.array([row[name] for name in ("qw", "qx", "qy", "qz")]))


def _by_frame(path: Path, columns: tuple[str, ...]) -> dict[int, list[dict[str, Any]]] | None:
    """Return the rows of a table by frame; None if the file does not exist."""
    if not path.is_file():
        return None
    return {int(str(frame)): _records(rows) for frame, rows in tables.read_parquet(path, columns).groupby("frame")}


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


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
