"""Topics of a drive's pictures: for each camera, the images, detections and ground truth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.errors import FormatError, with_path
from polarsim.formats import png, ros, tables
from polarsim.formats.ros import Stamped, stamp_ns
from polarsim.geometry.lens import Lens
from polarsim.rover.cameras.layout import DETECTION_COLUMNS, POSE_COLUMNS, TRUTH_COLUMNS, picture_set
from polarsim.rover.export.options import BagOptions
from polarsim.rover.vehicle.mounts import FOLLOWING, mount_of, pose_of_quaternion
from polarsim.rover.vehicle.table import CameraPart, Vehicle

ARRAY = "vision_msgs/msg/Detection2DArray"


class PictureTopics:
    """Streams of all cameras with pictures in the set that the options select."""

    def __init__(self, folder: Path, vehicle: Vehicle, options: BagOptions) -> None:
        self._folder, self._vehicle, self._options = folder, vehicle, options
        self._set = picture_set(options.sun, options.model, options.exposure_ms)

    def streams(self) -> list[Iterator[Stamped]]:
        """Return a stream per camera, in the order of the vehicle's table."""
        return [self._stream(camera) for camera in self._vehicle.cameras if self._pictures(camera.name).is_dir()]

    def files(self) -> list[Path]:
        """Return all files that the streams read."""
        files: list[Path] = []
        for camera in self._vehicle.cameras:
            view = self._folder / camera.name
            pictures = sorted(self._pictures(camera.name).glob("*.*"))
            files += (
                [*pictures, view / f"{self._options.sun}_truth.parquet", view / "poses.parquet"] if pictures else []
            )
        return [path for path in files if path.is_file()]

    def _pictures(self, view: str) -> Path:
        return self._folder / view / self._set

    def _stream(self, camera: CameraPart) -> Iterator[Stamped]:
        view, options = self._folder / camera.name, self._options
        frame = f"{camera.name}_optical"
        truth = _by_frame(view / f"{options.sun}_truth.parquet", TRUTH_COLUMNS)
        detections = _by_frame(view / self._set / "detections.parquet", DETECTION_COLUMNS)
        lens: Lens | None = None
        for pose in _records(tables.read_parquet(view / "poses.parquet", POSE_COLUMNS)):
            number, picture = int(pose["frame"]), self._pictures(camera.name) / f"{int(pose['frame']):05d}.png"
            if not picture.is_file():
                continue
            time_ns = stamp_ns(float(pose["time_s"]))
            content = picture.read_bytes()
            lens = lens or picture_lens(camera, content, picture)
            if camera.name in FOLLOWING:
                yield time_ns, "/tf", "tf2_msgs/msg/TFMessage", {"transforms": [_following(time_ns, frame, pose)]}
            info = ros.camera_info(time_ns, frame, lens)
            yield time_ns, f"/{camera.name}/camera_info", "sensor_msgs/msg/CameraInfo", info
            if options.images:
                image = ros.image(time_ns, frame, content)
                yield time_ns, f"/{camera.name}/image/compressed", "sensor_msgs/msg/CompressedImage", image
            for topic, rows in (("truth", truth), ("detections", detections)):
                if rows is not None:
                    message = ros.detections(time_ns, frame, rows.get(number, []))
                    yield time_ns, f"/{camera.name}/{topic}", ARRAY, message


def picture_lens(camera: CameraPart, content: bytes, path: Path) -> Lens:
    """Return the lens of pictures, which may be smaller than the camera's size."""
    with with_path(path):
        header = png.parse_header(content)
    lens = mount_of(camera, header.width / camera.width_px).lens
    if (lens.width, lens.height) != (header.width, header.height):
        raise FormatError(
            f"{header.width} x {header.height} px, camera {camera.name} has {camera.width_px} x {camera.height_px} px",
            path=path,
        )
    return lens


def _following(time_ns: int, frame: str, row: dict[str, Any]) -> ros.Message:
    """Return the transform of a camera that follows the rover and has no link."""
    position = np.array([row[name] for name in ("x_m", "y_m", "z_m")])
    quaternion = np.array([row[name] for name in ("qw", "qx", "qy", "qz")])
    return ros.transform(time_ns, "map", frame, pose_of_quaternion(position, quaternion))


def _by_frame(path: Path, columns: tuple[str, ...]) -> dict[int, list[dict[str, Any]]] | None:
    """Return the rows of a table by frame; None if the file does not exist."""
    if not path.is_file():
        return None
    table: pd.DataFrame = tables.read_parquet(path, columns)
    return {int(str(frame)): _records(rows) for frame, rows in table.groupby("frame")}


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]
