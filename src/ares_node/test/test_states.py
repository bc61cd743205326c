# SPDX-License-Identifier: Apache-2.0
"""Serialized states against the middleware's own conversion."""

import struct

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock

from ares_msgs.msg import GuidanceStatus, NavState, ThrustCommand, VehicleState
from ares_node.states import StateMessage, clock_data
from ares_node.time import NANOSECONDS

HEAD = {"flight_id": 2**64 - 1, "sequence": 2**32 - 1}
NUMBERS = {"double": 0.1, "uint8": 7}


def made_up(kind):
    """Return a message with a different value in each field."""
    values = {}
    for k, (name, text) in enumerate(kind.get_fields_and_field_types().items()):
        if text == "double[3]":
            values[name] = [k + 0.1, -k - 0.2, 1e-300]
        elif text in NUMBERS:
            values[name] = NUMBERS[text] + k
    return kind(stamp=Time(sec=-3, nanosec=999_999_999), **HEAD, **values)


def plain(message):
    """Return the values of a message by name."""
    fields = message.get_fields_and_field_types()
    return {name: np.asarray(getattr(message, name)).tolist() for name in list(fields)[1:]}


@pytest.mark.parametrize("kind", [NavState, VehicleState])
def test_what_one_writes_the_other_reads(kind):
    message, state = made_up(kind), StateMessage(kind)
    assert len({str(value) for value in plain(message).values()}) > len(state.fields)
    stamp, flight_id, sequence, record = state.read(serialize_message(message))
    assert stamp == -3 * NANOSECONDS + 999_999_999
    assert {"flight_id": flight_id, "sequence": sequence} == HEAD
    for name in state.fields:
        np.testing.assert_array_equal(record[name], getattr(message, name))
    back = deserialize_message(state.data(stamp, flight_id, sequence, record), kind)
    assert (back.stamp, plain(back)) == (message.stamp, plain(message))


@pytest.mark.parametrize(("sec", "nanosec"), [(0, 0), (155, 900_000_000), (-3, 999_999_999)])
def test_the_clock(sec, nanosec):
    read = deserialize_message(clock_data(sec * NANOSECONDS + nanosec), Clock)
    assert read == Clock(clock=Time(sec=sec, nanosec=nanosec))


def test_one_message_does_not_change_the_next():
    state = StateMessage(NavState)
    *head, record = state.read(serialize_message(made_up(NavState)))
    first = state.data(*head, record)
    assert state.data(4, 5, 6, np.zeros_like(record)) != first
    assert state.data(*head, record) == first
    assert state.read(first) == (*head, record)


def test_a_sender_of_the_other_byte_order():
    state = StateMessage(VehicleState)
    *_, record = state.read(serialize_message(made_up(VehicleState)))
    swapped = np.zeros(1, record.dtype.newbyteorder(">"))
    swapped[0] = record
    body = struct.pack(">iIQI", 1, 2, 3, 4) + swapped.tobytes()[20:]
    stamp, flight_id, sequence, read = state.read(bytes(4) + body)
    assert (stamp, flight_id, sequence) == (NANOSECONDS + 2, 3, 4)
    assert str(read) == str(record)


def test_what_is_no_state_is_refused():
    for kind in (ThrustCommand, GuidanceStatus):
        with pytest.raises(TypeError, match=f"{kind.__name__} does not begin with stamp, fl"):
            StateMessage(kind)

    class Longer(NavState):
        @classmethod
        def get_fields_and_field_types(cls):
            return NavState.get_fields_and_field_types() | {"more": "sequence<double, 3>"}

    with pytest.raises(TypeError, match=r"Longer\.more is sequence<double, 3>; expected"):
        StateMessage(Longer)


def test_a_message_that_is_too_short_is_no_state():
    state = StateMessage(NavState)
    whole = serialize_message(made_up(NavState))
    for length in (8, 20, 100):
        with pytest.raises((ValueError, struct.error)):
            state.read(whole[:length])
