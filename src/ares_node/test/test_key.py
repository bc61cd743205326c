# SPDX-License-Identifier: Apache-2.0
"""The key of a flight, and digests by it."""

import math

import pytest
from rclpy.node import Node

from ares_msgs.msg import FlightMember, Seal, ThrustCommand
from ares_node.key import VARIABLE, FlightKeyError, flight_key, new_key
from ares_node.seal import Seals, as_field, canonical, digest_of

KEY = bytes(range(32))


def command(**fields) -> ThrustCommand:
    plain = {"flight_id": 2**63 + 5, "direction": [0.0, 1.0, 0.0], "cutoff_time": math.nan}
    return ThrustCommand(**(plain | fields))


def test_a_key_is_held_for_a_flight_alone():
    environ: dict[str, str] = {}
    assert flight_key(environ) == b""
    with new_key(environ):
        first = flight_key(environ)
        assert len(first) == 32
        with new_key(environ):
            assert flight_key(environ) == first
    assert not environ
    with new_key(environ):
        assert flight_key(environ) != first


@pytest.mark.parametrize("text", ["secret", "00", "0" * 63, "0" * 66])
def test_what_is_no_key_is_refused_and_not_shown(text):
    with pytest.raises(FlightKeyError, match="expected 64 hexadecimal digits") as refused:
        flight_key({VARIABLE: text})
    assert text not in str(refused.value).replace("64", "")


def test_a_digest_is_of_every_field_the_type_and_the_key():
    own = digest_of(KEY, command())
    assert digest_of(KEY, command()) == own
    for changed in ({"flight_id": 7}, {"direction": [0.0, 1.0, 1e-12]}, {"cutoff_time": 1.0}):
        assert digest_of(KEY, command(**changed)) != own
    assert digest_of(KEY, command(arc_end_times=[math.nan])) != own
    assert digest_of(bytes(32), command()) != own


def test_a_digest_in_a_message_is_not_of_itself():
    word = FlightMember(node="/ares/guidance", reason="a", settings="b")
    before = canonical(word)
    word.digest = as_field(digest_of(KEY, word))
    assert canonical(word) == before
    # the boundary between two texts matters
    assert canonical(FlightMember(node="/ares/guidance", reason="ab")) != before


class Sent:
    """Send and receive as a node would, one call after the other."""

    def __init__(self, monkeypatch, ros_context):
        monkeypatch.setenv(VARIABLE, KEY.hex())
        self.complaints = []
        self.taken = []
        self.node = Node("guidance", context=ros_context)
        self.seals = Seals(self.node, lambda: 7, self.complaints.append)
        self.hear = self.seals.reader("thrust_command", self.taken.append)

    def seal(self, message):
        """Deliver a seal of the message made with the key."""
        self.seals._on_seal(Seal(flight_id=7, digest=as_field(digest_of(KEY, message))))


def test_a_message_without_a_seal_is_forged_once_a_later_one_has_its_own(monkeypatch, ros_context):
    sent = Sent(monkeypatch, ros_context)
    true = [command(flight_id=7, cutoff_time=float(k)) for k in range(3)]
    sent.seal(true[0])
    sent.hear(true[0])
    sent.hear(command(flight_id=7, cutoff_time=9.0))
    # a message may come before its seal
    sent.hear(true[1])
    assert not sent.complaints
    sent.seal(true[1])
    sent.seal(true[2])
    sent.hear(true[2])
    assert sent.taken == true
    assert sent.seals.forged == 1
    words = "forged: a message on thrust_command without the seal of the flight, refused"
    assert sent.complaints == [words]
    sent.node.destroy_node()
