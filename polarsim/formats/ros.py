"""ROS 2 messages as dictionaries and message definitions as text, without ROS.

Units are metres, radians and seconds, as in ROS. The origin of ROS pixel coordinates is the centre of the first pixel,
that of polarsim its corner: half a pixel is subtracted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL, Lens
from polarsim.geometry.poses import Pose

Message = dict[str, Any]
Stamped = tuple[int, str, str, Message]  # time, ns; topic; type; message
START_NS = 1_000_000_000  # time stamp of the start of a drive, because tf2 interprets 0 as `the latest`
# Definitions that are missing in the ROS 2 Humble store of rosbags: vision_msgs 4, grid_map 2 and `polarsim_msgs`,
# without comments. The order of fields is the order of bytes.
EXTRA_DEFINITIONS = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id"
    ),
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
    "grid_map_msgs/msg/GridMapInfo": (
        "float64 resolution\nfloat64 length_x\nfloat64 length_y\ngeometry_msgs/Pose pose"
    ),
    "grid_map_msgs/msg/GridMap": (
        "std_msgs/Header header\ngrid_map_msgs/GridMapInfo info\nstring[] layers\nstring[] basic_layers\n"
        "std_msgs/Float32MultiArray[] data\nuint16 outer_start_index\nuint16 inner_start_index"
    ),
    # Slip as a share of the rim speed; sinkage, metres, below the current ground around the wheel and below the ground
    # before the drive; load, N; motor torque, N m; kind of ground in contact.
    "polarsim_msgs/msg/WheelState": (
        "uint8 NONE=0\nuint8 SOIL=1\nuint8 ROCK=2\nuint8 BOTH=3\nstring name\nfloat64 slip\nfloat64 sinkage\n"
        "float64 sinkage_first\nfloat64 load\nfloat64 torque\nuint8 contact"
    ),
    "polarsim_msgs/msg/WheelStates": "std_msgs/Header header\npolarsim_msgs/WheelState[] wheels",
}


def stamp_ns(time_s: float) -> int:
    """Return the time stamp, ns, of a time since the start of a drive, s."""
    return START_NS + round(float(time_s) * 1e9)


def definition(name: str) -> str:
    """Return the definition of a message, such as `nav_msgs/msg/Odometry`, and of all nested messages, for bags."""
    return _store().generate_msgdef(name, ros_version=2)[0]


@cache
def _store() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(
        {
            kind: fields
            for name, text in EXTRA_DEFINITIONS.items()
            for kind, fields in get_types_from_msg(text, name).items()
        }
    )
    return store


def header(time_ns: int, frame: str) -> Message:
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame}


def transform(time_ns: int, parent: str, child: str, parent_from_child: Pose) -> Message:
    """Return a geometry_msgs/TransformStamped."""
    return {
        "header": header(time_ns, parent),
        "child_frame_id": child,
        "transform": {
            "translation": vector(parent_from_child.translation),
            "rotation": ros_quaternion(parent_from_child.rotation),
        },
    }


def camera_info(time_ns: int, frame: str, lens: Lens) -> Message:
    """Return a sensor_msgs/CameraInfo."""
    matrix = lens.opencv_matrix()
    return {
        "header": header(time_ns, frame),
        "height": lens.height,
        "width": lens.width,
        "distortion_model": "plumb_bob",
        "d": list(lens.distortion),
        "k": matrix.ravel().tolist(),
        "r": np.eye(3).ravel().tolist(),
        "p": np.hstack([matrix, np.zeros((3, 1))]).ravel().tolist(),
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def image(time_ns: int, frame: str, content: bytes) -> Message:
    """Return a sensor_msgs/CompressedImage of a grey PNG file of 16 bits."""
    return {"header": header(time_ns, frame), "format": "mono16; png compressed mono16", "data": content}


def detections(time_ns: int, frame: str, rows: Sequence[Mapping[str, Any]]) -> Message:
    """Return a vision_msgs/Detection2DArray of rows with `kind`, `x0` to `y1` (px) and `confidence`.

    Rows of ground truth have `rock` instead of `confidence`.
    """
    return {
        "header": header(time_ns, frame),
        "detections": [
            {
                "header": header(time_ns, frame),
                "results": [
                    {
                        "hypothesis": {"class_id": str(row["kind"]), "score": float(row.get("confidence", 1.0))},
                        "pose": {"pose": pose(Pose.identity()), "covariance": [0.0] * 36},
                    }
                ],
                "bbox": _box(row),
                "id": str(row["rock"]) if "rock" in row else "",
            }
            for row in rows
        ],
    }


def pose(parent_from_child: Pose) -> Message:
    return {
        "position": vector(parent_from_child.translation),
        "orientation": ros_quaternion(parent_from_child.rotation),
    }


def vector(values: np.ndarray) -> Message:
    return dict(zip("xyz", (float(value) for value in values), strict=True))


def ros_quaternion(rotation: np.ndarray) -> Message:
    from scipy.spatial.transform import Rotation

    values = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return dict(zip("xyzw", (float(value) for value in values), strict=True))


def _box(row: Mapping[str, Any]) -> Message:
    x0, y0, x1, y1 = (float(row[name]) for name in ("x0", "y0", "x1", "y1"))
    centre = {"x": (x0 + x1) / 2 - HALF_PIXEL, "y": (y0 + y1) / 2 - HALF_PIXEL}
    return {"center": {"position": centre, "theta": 0.0}, "size_x": x1 - x0, "size_y": y1 - y0}
