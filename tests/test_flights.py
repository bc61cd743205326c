"""The default flight through the whole graph, in both layouts, and its bags."""

import json
import subprocess
import sys

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

LAYOUTS = {"three processes": [], "one process": ["--in-process"], "again": ["--in-process"]}


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """Result and bag of the default flight, by layout."""
    from ares_node.testing import claimed_domain

    folder = tmp_path_factory.mktemp("flights")
    found = {}
    for layout, flags in LAYOUTS.items():
        bag = folder / layout.replace(" ", "_")
        with claimed_domain() as domain:
            run = subprocess.run(
                [
                    *(sys.executable, "-m", "ares_bringup", "fly", "--json", "--bag", str(bag)),
                    *("--domain-id", str(domain), *flags),
                ],
                capture_output=True,
                text=True,
                timeout=120,
                check=False,
            )
        assert run.returncode == 0, run.stderr
        found[layout] = (json.loads(run.stdout), bag)
    return found


def decoded(bag):
    """All messages by topic, as (log time, fields), through mcap-ros2-support."""
    messages = {}
    with next(bag.glob("*.mcap")).open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((record.log_time, fields(message)))
    return messages


def fields(message):
    """A decoded message as nested tuples; nan made equal to itself."""
    if hasattr(message, "__slots__"):
        return tuple((name, fields(getattr(message, name))) for name in message.__slots__)
    if isinstance(message, list | tuple | np.ndarray):
        return tuple(fields(item) for item in message)
    if isinstance(message, float) and message != message:
        return "nan"
    return message


@pytest.mark.parametrize("layout", ["three processes", "one process"])
def test_insertion_and_final_mass(flights, layout):
    result, bag = flights[layout]
    assert result["mission"] == "ares_v"
    assert result["guidance"] == "peg"
    error = result["insertion_error"]
    assert abs(error["radius_m"]) <= 1.0
    assert abs(error["speed_m_s"]) <= 0.01
    assert abs(error["flight_path_angle_deg"]) <= 1e-4
    assert abs(error["inclination_deg"]) <= 1e-3
    assert result["m_f_kg"] >= 174_060.0
    assert result["t_plf_s"] == pytest.approx(433.7, abs=1.0)
    assert result["t_meco_s"] == pytest.approx(767.12, abs=0.1)
    assert result["guidance_cycles"] == 612
    assert result["lost_messages"] == 0
    assert result["bag"] == str(bag)


@pytest.mark.parametrize("other", ["three processes", "again"])
def test_the_same_flight_gives_the_same_messages(flights, other):
    one, two = decoded(flights["one process"][1]), decoded(flights[other][1])
    assert set(one) == set(two)
    for topic in one:
        assert one[topic] == two[topic], topic


def test_rosbags_and_mcap_read_the_same_values(flights):
    _, bag = flights["three processes"]
    ours = decoded(bag)
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        counts = {}
        for connection, log_time, raw in reader.messages():
            topic = connection.topic
            k = counts.setdefault(topic, 0)
            counts[topic] += 1
            message = reader.deserialize(raw, connection.msgtype)
            when, values = ours[topic][k]
            assert when == log_time
            for name, value in values:
                theirs = getattr(message, name)
                if name == "stamp":
                    assert dict(value) == {"sec": theirs.sec, "nanosec": theirs.nanosec}
                elif isinstance(value, tuple) and value and isinstance(value[0], float):
                    assert value == tuple(theirs)
                elif isinstance(value, float | int):
                    assert value == theirs
    assert counts == {topic: len(messages) for topic, messages in ours.items()}
    assert counts["/ares/nav_state"] == counts["/ares/thrust_command"] == 6113


def test_every_channel_carries_type_hash_and_qos(flights):
    _, bag = flights["three processes"]
    with next(bag.glob("*.mcap")).open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        for channel in reader.get_summary().channels.values():
            assert channel.message_encoding == "cdr"
            assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
            assert "reliability: reliable" in channel.metadata["offered_qos_profiles"]
    assert (bag / "metadata.yaml").is_file()
