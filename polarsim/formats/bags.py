"""Bags: MCAP files of ROS 2 messages, written without ROS, and the `metadata.yaml` that makes a folder a rosbag2.

Messages are made one at a time, in the order of their stamps, so memory does not grow with the bag.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

import yaml

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats.readers import reader
from polarsim.formats.ros import Stamped, definition

METADATA = "metadata.yaml"
_FOREVER = "{sec: 9223372036, nsec: 854775807}"
# What rosbag2 writes for a topic whose last message late listeners get too (durability 1: transient local).
_LATCHED = (
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    f"  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n  liveliness: 1\n  liveliness_lease_duration: {_FOREVER}\n"
    "  avoid_ros_namespace_conventions: false"
)


def write(path: Path, streams: Iterable[Iterator[Stamped]], compression: str = "zstd") -> dict[str, int]:
    """Write messages of several streams, each in the order of its stamps; how many each topic has.

    Raises
    ------
    PolarsimError
        A library is missing.
    """
    try:
        from mcap.writer import CompressionType, Writer
        from mcap_ros2._dynamic import serialize_dynamic  # noqa: F401  # `_encoder` needs it
    except ImportError as error:
        raise PolarsimError("bags need mcap and mcap-ros2-support: pip install 'polarsim[publish]'") from error
    counts: dict[str, int] = {}
    schemas: dict[str, Any] = {}
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType[compression.upper()])
        writer.start(profile="ros2", library="polarsim")
        channels: dict[str, int] = {}
        # Of one time in the order of the streams: messages themselves are never compared.
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
    """A schema's number in the bag, and what turns its messages into bytes."""
    from mcap_ros2._dynamic import serialize_dynamic

    text = definition(kind)
    return writer.register_schema(kind, "ros2msg", text.encode()), serialize_dynamic(kind, text)[kind]


@reader("bag", largest_mb=1e6)
def metadata(bag: Path, name: str) -> str:
    """What `metadata.yaml` beside a bag says, version 8, by the bag's own summary.

    Parameters
    ----------
    name
        The bag's file name in its folder.

    Raises
    ------
    FormatError
        No readable bag with a summary.
    """
    from mcap.reader import make_reader

    with bag.open("rb") as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        raise FormatError("a bag without a summary", path=bag)
    told = summary.statistics
    start, length = told.message_start_time, told.message_end_time - told.message_start_time
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
            "message_count": told.channel_message_counts.get(number, 0),
        }
        for number, channel in sorted(summary.channels.items(), key=lambda pair: pair[1].topic)
    ]
    content = {
        "version": 8,
        "storage_identifier": "mcap",
        **times,
        "message_count": told.message_count,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [name],
        "files": [{"path": name, **times, "message_count": told.message_count}],
        "custom_data": {},
        "ros_distro": "humble",
    }
    return yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
