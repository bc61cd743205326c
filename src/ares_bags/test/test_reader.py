# SPDX-License-Identifier: Apache-2.0
"""Reading bags: columns, names, and one line for each fault."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from ares_bags.compare import differences
from ares_bags.errors import BagError
from ares_bags.metadata import METADATA_FILE
from ares_bags.reader import LOG_TIME, open_bag
from ares_bags.schema import Topic
from ares_bags.writer import BagWriter
from ares_node.time import stamp_from_ns
from ares_trials.testing.bags import (
    CUSTOM_DATA,
    DIAGNOSTICS,
    EVENT,
    NAV,
    PERIOD_NS,
    START_NS,
    messages,
    nav_state,
    topics,
    write_bag,
)

COUNT = 50


def test_topics_times_and_custom_data(tmp_path: Path) -> None:
    bag = open_bag(write_bag(tmp_path / "flight", COUNT))
    assert list(bag.topics) == [EVENT, NAV, DIAGNOSTICS]
    assert [topic.count for topic in bag.topics.values()] == [5, COUNT, 8]
    assert bag.topics[NAV].type_name == "ares_msgs/msg/NavState"
    assert bag.topics[NAV].definition == topics()[0].definition
    assert bag.topics[EVENT].qos[0].durability == "transient_local"
    assert (bag.start_ns, bag.end_ns) == (START_NS, START_NS + (COUNT - 1) * PERIOD_NS)
    assert bag.custom_data == CUSTOM_DATA
    assert bag.message_count == COUNT + 13


def test_columns_are_the_numbers_that_were_written(tmp_path: Path) -> None:
    bag = open_bag(write_bag(tmp_path / "flight", COUNT))
    columns = bag.columns("nav_state")
    states = [nav_state(number) for number in range(COUNT)]
    for name in ("position", "velocity", "sensed_delta_v"):
        expected = np.array([getattr(state, name) for state in states])
        assert columns[name].shape == (COUNT, 3)
        np.testing.assert_array_equal(columns[name], expected)
    for name in ("mass", "heating_rate", "arc_start_time"):
        assert columns[name].dtype == np.float64
        np.testing.assert_array_equal(columns[name], [getattr(state, name) for state in states])
    for name in ("sequence", "arc", "jettisoned"):
        assert columns[name].dtype == np.int64
        np.testing.assert_array_equal(columns[name], [getattr(state, name) for state in states])
    np.testing.assert_array_equal(columns[LOG_TIME], START_NS + PERIOD_NS * np.arange(COUNT))
    np.testing.assert_array_equal(columns["stamp"], columns[LOG_TIME])
    # texts and lists of messages have no column
    assert bag.columns("diagnostics").keys() == {LOG_TIME, "header.stamp"}


def test_stamps_before_zero(tmp_path: Path) -> None:
    state = nav_state(0)
    state.stamp = stamp_from_ns(-1_500_000_000)
    with BagWriter(tmp_path / "flight") as writer:
        writer.add_topic(topics()[0])
        writer.write(NAV, 0, serialize_message(state))
    assert open_bag(tmp_path / "flight").columns(NAV)["stamp"].tolist() == [-1_500_000_000]


def test_a_bag_is_its_folder_its_file_or_its_metadata(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "flight", COUNT)
    bags = [open_bag(p) for p in (path, path / "flight_0.mcap", path / METADATA_FILE, str(path))]
    (path / METADATA_FILE).unlink()
    bags.append(open_bag(path))
    for bag in bags:
        assert (bag.message_count, bag.custom_data) == (COUNT + 13, CUSTOM_DATA)


def test_topic_names(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "flight") as writer:
        for name in ("/one/nav_state", "/two/nav_state", "/two/event"):
            writer.add_topic(Topic.installed(name, "ares_msgs/msg/NavState"))
    bag = open_bag(tmp_path / "flight")
    assert bag.name_of("event") == bag.name_of("two/event") == "/two/event"
    for name in ("nav_state", "stat", "", "/one"):
        with pytest.raises(BagError, match=r"has no single topic .* expected of: /one/"):
            bag.columns(name)


def test_equal_times_keep_the_order_of_recording(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "flight", COUNT, flush_every=7)
    assert list(open_bag(path).raw_messages()) == list(messages(COUNT))


def test_differences(tmp_path: Path) -> None:
    one = open_bag(write_bag(tmp_path / "one", COUNT))
    same = open_bag(write_bag(tmp_path / "same", COUNT, flush_every=3))
    assert differences(one, same) == []
    with BagWriter(tmp_path / "other") as writer:
        writer.add_topic(topics()[0])
        for number in range(COUNT - 1):
            state = nav_state(number)
            if number == 3:
                state.velocity[1] += 1e-9
            if number == 5:
                state.heating_rate = 0.0
            writer.write(
                NAV, START_NS + number * PERIOD_NS + (number == 7), serialize_message(state)
            )
    assert differences(one, open_bag(tmp_path / "other"), [NAV]) == [
        f"{NAV} message 3 (t 156.200 s): velocity[1] -1.0 against -0.999999999",
        f"{NAV} message 5 (t 156.400 s): heating_rate nan against 0.0",
        f"{NAV} message 7: log time 156600000000 ns against 156600000001 ns",
        f"{NAV}: 50 messages against 49",
    ]
    assert f"{EVENT}: 5 messages against 0" in differences(one, open_bag(tmp_path / "other"))


def test_what_is_no_bag(tmp_path: Path) -> None:
    whole = write_bag(tmp_path / "whole", 10)
    data = (whole / "whole_0.mcap").read_bytes()
    (tmp_path / "nothing").mkdir()
    two = tmp_path / "two"
    shutil.copytree(whole, two)
    (two / "whole_1.mcap").write_bytes(data)
    cases = {
        "none": "does not exist",
        "nothing": "is not a bag: it holds no .mcap files; expected one",
        "two": "is not a bag: it holds 2 .mcap files; expected one",
    }
    for name, content, text in (
        ("empty", b"", "is empty: empty.mcap has no bytes"),
        ("text", b"hello world, this is no bag", "text.mcap is not an MCAP file"),
        ("short", data[:5], "has no end"),
        ("head", data[:8], "has no end"),
        ("half", data[: len(data) // 2], "has no end (its recorder was killed"),
        ("most", data[:-1], "has no end"),
        ("hollow", data[:8] + data[-8:], "is damaged ("),
        ("footer", data[:200] + data[-45:], "is damaged ("),
    ):
        (tmp_path / f"{name}.mcap").write_bytes(content)
        cases[f"{name}.mcap"] = text
    for name, text in cases.items():
        with pytest.raises(BagError) as caught:
            open_bag(tmp_path / name)
        line = str(caught.value)
        assert text in line, line
        assert str(tmp_path / name) in line
        assert "\n" not in line


def test_a_topic_that_is_not_ros2(tmp_path: Path) -> None:
    from mcap.writer import Writer

    with (tmp_path / "json.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("Thing", "jsonschema", b"{}")
        writer.register_channel("/thing", "json", schema)
        writer.finish()
    with pytest.raises(BagError, match="topic /thing is json/jsonschema; expected cdr/ros2msg"):
        open_bag(tmp_path / "json.mcap")
