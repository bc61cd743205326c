# SPDX-License-Identifier: Apache-2.0
"""Definitions and type hashes compared with those computed by the rosbags library."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ares_bags.errors import BagError
from ares_bags.schema import (
    Qos,
    Topic,
    message_definition,
    qos_from_text,
    qos_text,
    split_type_name,
    type_hash,
)

OURS = ["NavState", "VehicleState", "ThrustCommand", "GuidanceStatus", "FlightEvent"]
COMMON = [
    "diagnostic_msgs/msg/DiagnosticArray",
    "sensor_msgs/msg/PointCloud2",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "builtin_interfaces/msg/Time",
]


@pytest.mark.parametrize("name", OURS)
def test_hash_of_our_types_follows_from_the_definition(name: str) -> None:
    type_name = f"ares_msgs/msg/{name}"
    store = get_typestore(Stores.ROS2_JAZZY)
    found = get_types_from_msg(message_definition(type_name), type_name)
    store.register({key: value for key, value in found.items() if key not in store.types})
    assert type_hash(type_name) == store.hash_rihs01(type_name)


@pytest.mark.parametrize("type_name", COMMON)
def test_common_types(type_name: str) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    assert type_hash(type_name) == store.hash_rihs01(type_name)
    assert get_types_from_msg(message_definition(type_name), type_name)[type_name][1] == (
        store.get_msgdef(type_name).fields
    )


@pytest.mark.parametrize("type_name", COMMON + [f"ares_msgs/msg/{name}" for name in OURS])
def test_definitions_are_parsed_by_mcap_ros2(type_name: str) -> None:
    assert type_name in generate_dynamic(type_name, message_definition(type_name))


def test_each_dependency_appears_once_in_rosbag2_order() -> None:
    lines = message_definition("diagnostic_msgs/msg/DiagnosticArray").splitlines()
    heads = [lines[i + 1] for i, line in enumerate(lines) if line == "=" * 80]
    assert heads == [
        "MSG: diagnostic_msgs/DiagnosticStatus",
        "MSG: diagnostic_msgs/KeyValue",
        "MSG: std_msgs/Header",
        "MSG: builtin_interfaces/Time",
    ]


@pytest.mark.parametrize(
    ("type_name", "text"),
    [
        ("NavState", "expected package/msg/Name"),
        ("ares_msgs/srv/SolveTrajectory", "expected package/msg/Name"),
        ("no_such_msgs/msg/Thing", "package no_such_msgs is not installed"),
        ("ares_msgs/msg/Thing", "ares_msgs/msg/Thing is not installed"),
    ],
)
def test_types_that_are_not_there(type_name: str, text: str) -> None:
    with pytest.raises(BagError, match=text):
        Topic.installed("/x", type_name)


def test_short_type_names() -> None:
    assert split_type_name("std_msgs/Header") == ("std_msgs", "Header")
    assert type_hash("std_msgs/Header") == type_hash("std_msgs/msg/Header")


PROFILES = st.builds(
    Qos,
    reliability=st.sampled_from(["reliable", "best_effort"]),
    durability=st.sampled_from(["volatile", "transient_local"]),
    history=st.sampled_from(["keep_last", "keep_all", "unknown"]),
    depth=st.integers(0, 10**6),
    deadline_ns=st.integers(0, 2**63 - 1),
)


@given(st.lists(PROFILES, max_size=3).map(tuple))
def test_qos_round_trip(profiles: tuple[Qos, ...]) -> None:
    assert qos_from_text(qos_text(profiles)) == profiles


def test_qos_that_is_none() -> None:
    assert qos_text(()) == ""
    assert qos_from_text("") == ()
    beyond = qos_text((Qos(),)).replace("nsec: 854775807", "nsec: .inf")
    assert ".inf" in beyond
    for text in ("{", "7", "- 3", "[[]]", beyond):
        with pytest.raises(ValueError, match="not a list of QoS profiles"):
            qos_from_text(text)
