"""ROS 2 bags: MCAP files, written without ROS, and the `metadata.yaml` of a rosbag2 folder.

Messages are created one by one in the order of their time stamps, so that memory does not grow with the bag.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

import yaml

from polarsim.errors import FormatError
from polarsim.formats.readers import reader
from polarsim.formats.ros import Stamped, definition

METADATA = "metadata.yaml"
_FOREVER = "{sec: 9223372036, nsec: 854775807}"
# Quality of service that rosbag2 writes for a latched topic (durability 1: transient local).
_LATCHED = (
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    f"  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n  liveliness: 1\n  liveliness_lease_duration: {_FOREVER}\n"
    "  avoid_ros_namespace_conventions: false"
)


def write_mcap_bag(path: Path, streams: Iterable[Iterator[Stamped]], compression: str = "zstd") -> dict[str, int]:
    """Write the messages of several streams, each sorted by time stamp, and return the number of messages per topic."""
    from mcap.writer import CompressionType, Writer
    from mcap_ros2._dynamic import serialize_dynamic  # noqa: F401  # `_encoder` needs it

    counts: dict[str, int] = {}
    schemas: dict[str, Any] = {}
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType[compression.upper()])
        writer.start(profile="ros2", library="polarsim")
        channels: dict[str, int] = {}
        # Messages with equal time stamps keep the order of the streams; messages are never compared.
        for time_ns, topic, kind, message in heapq.merge(*streams, key=itemgetter(0)):
            if kind not in schemas:
                schemas[kind] = _encoder(writer, kind)
            schema, encode = schemas[kind]
            if topic not in channels:
                metadata = {"offered_qos_profiles": _LATCHED if topic == "/tf_static" else ""}
                channels[topic] = writer.register_channel(topic, "cdr", schema, metadata)
            number = counts.get(topic, 0)
            writer.add_message(channels[topic], time_ns, encode(message), time_ns, number)
            counts[topic] = number + 1
        writer.finish()
    return counts


def _encoder(writer: Any, kind: str) -> tuple[int, Any]:
    """Register a schema in the bag and return the schema id and the function that serialises messages."""
    from mcap_ros2._dynamic import serialize_dynamic

    text = definition(kind)
    return writer.register_schema(kind, "ros2msg", text.encode()), serialize_dynamic(kind, text)[kind]


@reader("bag", largest_mb=1e6)
def bag_metadata(bag: Path, name: str) -> str:
    """Return the content of `metadata.yaml` (version 8) for a bag, computed from the summary section of the bag.

    `name` is the file name of the bag in the folder of `metadata.yaml`.
    """
    from mcap.reader import make_reader

    with bag.open("rb") as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        raise FormatError("the bag has no summary: it may be incomplete", path=bag)
    statistics = summary.statistics
    start, length = statistics.message_start_time, statistics.message_end_time - statistics.message_start_time
    times = {"starting_time": {"nanoseconds_since_epoch": start}, "duration": {"nanoseconds": length}}
    topics = [
        {
            "topic_metadata": {
                "name": channel.topic,
                "type": summary.schemas[channel.schema_id].name,
                "serialization_format": channel.message_encoding,
                "offered_qos_profiles": channel.metadata.get("offered_qos_profiles", ""),
                "type_description_hash": "",
            },
            "message_count": statistics.channel_message_counts.get(number, 0),
        }
        for number, channel in sorted(summary.channels.items(), key=lambda pair: pair[1].topic)
    ]
    content = {
        "version": 8,
        "storage_identifier": "mcap",
        **times,
        "message_count": statistics.message_count,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [name],
        "files": [{"path": name, **times, "message_count": statistics.message_count}],
        "custom_data": {},
        "ros_distro": "humble",
    }
    return yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
