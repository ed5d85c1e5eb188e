"""ROS 2's message definitions as text, so that bags are written and read where no ROS is installed.

Those of ROS 2 Humble's common packages are rosbags' own; here stand those of vision_msgs 4, grid_map 2 and our own
`polarsim_msgs`, without their comments. The order of fields is the order of bytes.
"""

from __future__ import annotations

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

OTHERS = {
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
    # Slip as a share of the rim's speed; sinkage, metres, below the ground as it now is round the wheel and below the
    # ground before the drive; load, N; torque of the motor, N m; what the wheel stands on.
    "polarsim_msgs/msg/WheelState": (
        "uint8 NONE=0\nuint8 SOIL=1\nuint8 ROCK=2\nuint8 BOTH=3\nstring name\nfloat64 slip\nfloat64 sinkage\n"
        "float64 sinkage_first\nfloat64 load\nfloat64 torque\nuint8 contact"
    ),
    "polarsim_msgs/msg/WheelStates": "std_msgs/Header header\npolarsim_msgs/WheelState[] wheels",
}


def definition(name: str) -> str:
    """The text of a message, such as `nav_msgs/msg/Odometry`, and of all messages in it, as bags carry it."""
    return _store().generate_msgdef(name, ros_version=2)[0]


@cache
def _store() -> Typestore:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(
        {kind: fields for name, text in OTHERS.items() for kind, fields in get_types_from_msg(text, name).items()}
    )
    return store
