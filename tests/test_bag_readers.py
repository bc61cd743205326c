# SPDX-License-Identifier: Apache-2.0
"""The reference flight, read by foreign readers."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

BAG = Path(__file__).parent.parent / "bags" / "reference"


@pytest.fixture(scope="module")
def decoded():
    """Return all messages by topic, as (log time, message), through mcap-ros2-support."""
    messages = {}
    with next(BAG.glob("*.mcap")).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((record.log_time, message))
    return messages


def same(ours, theirs):
    if hasattr(ours, "__slots__"):
        return all(same(getattr(ours, name), getattr(theirs, name)) for name in ours.__slots__)
    return np.array_equal(ours, theirs, equal_nan=True)


def test_rosbags_and_mcap_read_the_same_values(decoded):
    with AnyReader([BAG], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        counts = dict.fromkeys(decoded, 0)
        for connection, log_time, raw in reader.messages():
            when, message = decoded[connection.topic][counts[connection.topic]]
            counts[connection.topic] += 1
            assert when == log_time
            assert same(message, reader.deserialize(raw, connection.msgtype))
    assert counts == {topic: len(messages) for topic, messages in decoded.items()}


def test_every_navigation_state_has_its_answer(decoded):
    states, commands = decoded["/ares/nav_state"], decoded["/ares/thrust_command"]
    assert len(states) > 600
    assert [state.sequence for _, state in states] == list(range(len(states)))
    assert all(
        same(state.stamp, command.nav_stamp)
        for (_, state), (_, command) in zip(states, commands, strict=True)
    )


def test_every_channel_carries_type_hash_and_qos():
    with next(BAG.glob("*.mcap")).open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        for channel in reader.get_summary().channels.values():
            assert channel.message_encoding == "cdr"
            assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
            assert "reliability: reliable" in channel.metadata["offered_qos_profiles"]
