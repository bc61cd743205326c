# SPDX-License-Identifier: Apache-2.0
"""A bag in the format of rosbag2 Jazzy, checked with two other readers."""

import math
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Qos as RosbagsQos
from rosbags.interfaces import QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from ares_bags.errors import BagError
from ares_bags.metadata import METADATA_FILE, recorded_counts
from ares_bags.reader import open_bag
from ares_bags.repair import repair
from ares_bags.schema import FOREVER_NS, type_hash
from ares_bags.verify import verify
from ares_bags.writer import BagWriter
from ares_trials.testing.bags import (
    CUSTOM_DATA,
    DIAGNOSTICS,
    EVENT,
    NAV,
    START_NS,
    messages,
    topics,
    write_bag,
)

COUNT = 100


def plain(value: Any) -> Any:
    """Convert a message of either library to plain lists and numbers; NaN becomes None."""
    if isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float):
        return None if math.isnan(value) else value
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)) or type(value).__name__ == "array":
        return [plain(item) for item in value]
    if is_dataclass(value):
        names = [
            field.name for field in fields(value) if field.name.islower() and field.name[0] != "_"
        ]
    else:
        names = type(value).__slots__
    return {name: plain(getattr(value, name)) for name in names}


def test_two_other_libraries_read_equal_values(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "flight", COUNT)
    with AnyReader([bag]) as reader:
        by_rosbags = [
            (connection.topic, time, plain(reader.deserialize(data, connection.msgtype)))
            for connection, time, data in reader.messages()
        ]
    with (bag / "flight_0.mcap").open("rb") as stream:
        mcap_reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        by_mcap = [
            (channel.topic, message.log_time, plain(decoded))
            for _, channel, message, decoded in mcap_reader.iter_decoded_messages()
        ]
    assert len(by_mcap) == COUNT + COUNT // 10 + math.ceil(COUNT / 7)
    assert sorted(by_rosbags, key=repr) == sorted(by_mcap, key=repr)
    first = next(entry for entry in by_mcap if entry[0] == NAV)
    assert first[1] == START_NS
    assert first[2]["position"] == [6.5e6, -0.0, 0.0]


def test_rosbags_sees_type_hash_qos_times_and_custom_data(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "flight", COUNT)
    forever = QosTime(*divmod(FOREVER_NS, 10**9))
    assert forever == QosTime(9223372036, 854775807)

    def profile(durability: QosDurability) -> RosbagsQos:
        return RosbagsQos(
            QosHistory.UNKNOWN,
            0,
            QosReliability.RELIABLE,
            durability,
            forever,
            forever,
            QosLiveliness.AUTOMATIC,
            forever,
            False,
        )

    volatile, kept = profile(QosDurability.VOLATILE), profile(QosDurability.TRANSIENT_LOCAL)
    with Reader(bag) as reader:
        by_topic = {connection.topic: connection for connection in reader.connections}
        assert by_topic[NAV].digest == type_hash("ares_msgs/msg/NavState")
        assert by_topic[NAV].ext.offered_qos_profiles == [volatile]
        assert by_topic[EVENT].ext.offered_qos_profiles == [kept]
        assert by_topic[DIAGNOSTICS].ext.offered_qos_profiles == [volatile, kept]
        assert reader.message_count == sum(1 for _ in reader.messages())
        assert reader.ros_distro == "jazzy"
        assert reader.compression_mode is None or reader.compression_mode == ""
        assert (reader.start_time, reader.end_time - 1) == (START_NS, START_NS + 99 * 10**8)
        assert reader.storage.metadata.custom == CUSTOM_DATA
    with Reader(bag / "flight_0.mcap") as reader:
        assert {connection.topic for connection in reader.connections} == set(by_topic)


def shape(value: Any) -> Any:
    """Return keys and types of a YAML document, without its values."""
    if isinstance(value, dict):
        return {key: shape(item) for key, item in value.items()}
    if isinstance(value, list):
        return [shape(value[0])] if value else []
    return type(value).__name__


def test_metadata_has_the_shape_of_another_writer_of_version_9(tmp_path: Path) -> None:
    ours = write_bag(tmp_path / "ours", 10)
    other = tmp_path / "other"
    topic = topics()[0]
    with Writer(other, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.set_custom_data("mission", "x")
        connection = writer.add_connection(
            topic.name,
            topic.type_name,
            msgdef=topic.definition,
            rihs01=topic.type_hash,
            offered_qos_profiles=[
                RosbagsQos(
                    QosHistory.UNKNOWN,
                    0,
                    QosReliability.RELIABLE,
                    QosDurability.VOLATILE,
                    QosTime(1, 2),
                    QosTime(1, 2),
                    QosLiveliness.AUTOMATIC,
                    QosTime(1, 2),
                    False,
                )
            ],
        )
        writer.write(connection, 1, next(data for name, _, data in messages(1) if name == NAV))
    documents = [yaml.safe_load((bag / METADATA_FILE).read_text()) for bag in (ours, other)]
    assert {"mission", "law", "seed"} == set(
        documents[0]["rosbag2_bagfile_information"].pop("custom_data")
    )
    documents[1]["rosbag2_bagfile_information"].pop("custom_data")
    assert shape(documents[0]) == shape(documents[1])
    assert documents[0]["rosbag2_bagfile_information"]["version"] == 9


def test_file_has_profile_channel_metadata_and_serialized_metadata(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "flight", COUNT)
    with (bag / "flight_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert len(summary.chunk_indexes) > 3
        for channel in summary.channels.values():
            assert channel.message_encoding == "cdr"
            assert channel.metadata.keys() == {"offered_qos_profiles", "topic_type_hash"}
            assert summary.schemas[channel.schema_id].encoding == "ros2msg"
            assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["deadline"] == {
                "sec": 9223372036,
                "nsec": 854775807,
            }
        records = [record for record in reader.iter_metadata() if record.name == "rosbag2"]
    information = yaml.safe_load((bag / METADATA_FILE).read_text())["rosbag2_bagfile_information"]
    # the first one is there from the start; readers take the last
    assert [yaml.safe_load(record.metadata["serialized_metadata"]) for record in records][
        -1
    ] == information
    assert information["files"][0]["path"] == "flight_0.mcap"


def test_a_bag_without_messages(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "none", CUSTOM_DATA) as writer:
        writer.add_topic(topics()[0])
    bag = open_bag(tmp_path / "none")
    assert (bag.message_count, bag.topics[NAV].count) == (0, 0)
    assert list(bag.messages("nav_state")) == []
    with Reader(tmp_path / "none") as reader:
        assert reader.message_count == 0


def test_messages_out_of_order_and_counts(tmp_path: Path) -> None:
    times = [5, 3, 9, 0]
    with BagWriter(tmp_path / "mixed") as writer:
        writer.add_topic(topics()[0])
        data = messages(1)[0][2]
        for time in times:
            writer.write(NAV, time, data, publish_time_ns=time + 1)
        assert writer.counts == {NAV: 4}
        with pytest.raises(ValueError, match="log time is -1 ns"):
            writer.write(NAV, -1, data)
    bag = open_bag(tmp_path / "mixed")
    assert [time for _, time, _ in bag.raw_messages()] == sorted(times)
    assert (bag.start_ns, bag.end_ns) == (0, 9)


def test_flushed_messages_are_on_disk_before_the_end(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "flight", flush_interval_s=1e9, flush_bytes=1000)
    for topic in topics():
        writer.add_topic(topic)
    sizes = []
    for topic, time, data in messages(100):
        writer.write(topic, time, data)
        sizes.append(writer.file.stat().st_size)
    assert sizes[0] > 0, "the custom data is there from the start"
    assert len(set(sizes)) > 10, "every 1000 bytes a chunk"
    writer.close()
    before = writer.file.stat().st_size
    writer.close()
    assert writer.file.stat().st_size == before
    with pytest.raises(BagError, match="is closed"):
        writer.write(NAV, 1, b"")


def test_the_room_that_is_held_is_no_damage(tmp_path: Path) -> None:
    """Compare a killed recorder's file with and without its reserved space."""
    writer = BagWriter(tmp_path / "flight", flush_interval_s=1e9)
    for topic in topics():
        writer.add_topic(topic)
    for message in messages(100):
        writer.write(*message)
    writer.flush()
    found = []
    for name, cut in (("killed", None), ("cut", writer._output.tell())):
        (tmp_path / name).mkdir()
        file = tmp_path / name / "flight_0.mcap"
        file.write_bytes(writer.file.read_bytes()[:cut])
        checked = verify(tmp_path / name)
        saved = repair(tmp_path / name, tmp_path / f"{name}_saved").saved
        found.append((checked.findings, saved))
    assert (tmp_path / "killed/flight_0.mcap").stat().st_size > writer._output.tell()
    assert found[0] == found[1]
    assert found[0][1] == sum(writer.counts.values())
    writer.close()


def test_time_flushes_too(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "flight", flush_interval_s=0.0) as writer:
        writer.add_topic(topics()[0])
        before = writer.file.stat().st_size
        writer.write(NAV, 1, messages(1)[0][2])
        assert writer.file.stat().st_size > before


def test_places_where_no_bag_can_be(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "file").touch()
    for path, text in (
        (tmp_path / "there", "exists already; expected a new name"),
        (tmp_path / "file", "exists already; expected a new name"),
        (tmp_path / "file" / "bag", "cannot be created: (Not a directory|File exists)"),
        (Path("/proc/bag"), "cannot be created: "),
    ):
        with pytest.raises(BagError, match=text) as caught:
            BagWriter(path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)


@pytest.mark.parametrize("count", [float("inf"), float("nan"), "many", None])
def test_counts_that_are_none_are_no_counts(count: object) -> None:
    entry = {"topic_metadata": {"name": "/chatter"}, "message_count": count}
    information = {"message_count": 1, "topics_with_message_count": [entry]}
    assert recorded_counts([information]) is None
