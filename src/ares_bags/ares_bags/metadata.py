# SPDX-License-Identifier: Apache-2.0
"""Read and write `metadata.yaml` and the `rosbag2` record of a bag: version 9, as in Jazzy."""

import os
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from ares_bags.schema import Topic, dump_yaml, load_yaml

METADATA_FILE = "metadata.yaml"
RECORD_NAME = "rosbag2"
RECORD_KEY = "serialized_metadata"
VERSION = 9
_OUTER_KEY = "rosbag2_bagfile_information"

#: Starting time that rosbag2 writes for a bag without messages.
NO_TIME_NS = 2**63 - 1


def bag_information(
    file_name: str,
    counts: Iterable[tuple[Topic, int]],
    span_ns: tuple[int, int] | None,
    custom_data: Mapping[str, str],
) -> dict[str, Any]:
    """Return rosbag2's BagMetadata for a bag of one file.

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
        # the storage compresses chunks itself; rosbag2 counts that as no compression
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
    """Return the content of the MCAP metadata record `rosbag2`."""
    return {RECORD_KEY: dump_yaml(dict(information))}


def information_of(record: Mapping[str, str]) -> dict[str, Any]:
    """Return the bag metadata in a `rosbag2` record; empty if there are none.

    Raises:
        ValueError: it is not YAML, or not a mapping.
    """
    return _mapping(record.get(RECORD_KEY, ""))


def read_metadata_file(path: Path) -> dict[str, Any]:
    """Return the bag metadata in a `metadata.yaml`.

    Raises:
        OSError: it cannot be read.
        ValueError: it is not the metadata of a bag; the text names the file.
    """
    try:
        information = _mapping(path.read_text(encoding="utf-8")).get(_OUTER_KEY)
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from error
    if not isinstance(information, dict):
        raise ValueError(f"{path.name} has no {_OUTER_KEY}")
    return information


def _mapping(text: str) -> dict[str, Any]:
    value = load_yaml(text)
    if value is not None and not isinstance(value, dict):
        raise ValueError("not a YAML mapping")
    return value or {}


def custom_data_of(information: Mapping[str, Any]) -> dict[str, str]:
    """Return the custom data in bag metadata; empty if there are none."""
    custom = information.get("custom_data")
    if not isinstance(custom, dict):
        return {}
    return {str(key): str(value) for key, value in custom.items()}


def custom_data_conflict(copies: Sequence[tuple[str, Mapping[str, str]]]) -> str:
    """Describe the first contradiction between copies of a bag's custom data; "" if there is none.

    Args:
        copies: location and content of each copy. A later copy may have more keys; an empty one
            is ignored.
    """
    for (where, custom), (other, later) in pairwise(entry for entry in copies if entry[1]):
        for key, value in custom.items():
            if later.get(key) != value:
                found = repr(later[key]) if key in later else "missing"
                return f"{key} is {value!r} in {where} and {found} in {other}"
    return ""


def recorded_counts(copies: Sequence[Mapping[str, Any]]) -> dict[str, int] | None:
    """Return the number of messages by topic according to the copies of a bag's metadata.

    None if no copy counts messages, or if copies contradict each other. A copy from the beginning
    of a recording counts none.
    """
    found = []
    for information in copies:
        try:
            counts = {
                str(entry["topic_metadata"]["name"]): int(entry["message_count"])
                for entry in information["topics_with_message_count"]
            }
            if counts and sum(counts.values()) == int(information["message_count"]):
                found.append(counts)
        except (KeyError, TypeError, ValueError, OverflowError):
            continue
    return found[0] if found and all(counts == found[0] for counts in found) else None


def write_metadata_file(folder: Path, information: Mapping[str, Any]) -> None:
    """Write a bag's `metadata.yaml` atomically.

    Raises:
        OSError: it could not be written.
    """
    temporary = folder / (METADATA_FILE + ".part")
    try:
        text = dump_yaml({_OUTER_KEY: dict(information)})
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(folder / METADATA_FILE)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
