"""`metadata.yaml` and the `rosbag2` record of a bag, version 9, as rosbag2 Jazzy writes them."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

from ares_bags.schema import Topic, dump_yaml

METADATA_FILE = "metadata.yaml"
RECORD_NAME = "rosbag2"
RECORD_KEY = "serialized_metadata"
VERSION = 9

#: What rosbag2 writes as starting time of a bag without messages.
NO_TIME_NS = 2**63 - 1


def bag_information(
    file_name: str,
    counts: Iterable[tuple[Topic, int]],
    span_ns: tuple[int, int] | None,
    custom_data: Mapping[str, str],
) -> dict[str, Any]:
    """The content of rosbag2's BagMetadata for a bag of one file.

    Args:
        file_name: name of the MCAP file within the bag's folder.
        counts: each topic with its number of messages.
        span_ns: first and last log time in ns; None without messages.
        custom_data: texts by name.
    """
    topics = sorted(counts, key=lambda entry: entry[0].name)
    total = sum(count for _, count in topics)
    first, last = span_ns or (NO_TIME_NS, NO_TIME_NS)
    start = {"nanoseconds_since_epoch": first}
    duration = {"nanoseconds": last - first}
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": duration,
        "starting_time": start,
        "message_count": total,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [profile.as_dict() for profile in topic.qos],
                    "type_description_hash": topic.type_hash,
                },
                "message_count": count,
            }
            for topic, count in topics
        ],
        # compressed chunks are the storage's own business, not rosbag2's
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [
            {
                "path": file_name,
                "starting_time": dict(start),
                "duration": dict(duration),
                "message_count": total,
            }
        ],
        "custom_data": dict(custom_data),
        "ros_distro": os.environ.get("ROS_DISTRO") or "jazzy",
    }


def record_data(information: Mapping[str, Any]) -> dict[str, str]:
    """The content of the MCAP metadata record `rosbag2`."""
    return {RECORD_KEY: dump_yaml(dict(information))}


def custom_data_of(record: Mapping[str, str]) -> dict[str, str]:
    """The custom data of a `rosbag2` record; empty if it has none that can be read."""
    try:
        custom = yaml.safe_load(record.get(RECORD_KEY, ""))["custom_data"]
        return {str(key): str(value) for key, value in custom.items()}
    except (yaml.YAMLError, TypeError, KeyError, AttributeError):
        return {}


def write_metadata_file(folder: Path, information: Mapping[str, Any]) -> None:
    """Write `metadata.yaml` of a bag: whole or not at all.

    Raises:
        OSError: it could not be written.
    """
    temporary = folder / (METADATA_FILE + ".part")
    try:
        text = dump_yaml({"rosbag2_bagfile_information": dict(information)})
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(folder / METADATA_FILE)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
