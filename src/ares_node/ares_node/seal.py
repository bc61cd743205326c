# SPDX-License-Identifier: Apache-2.0
"""Prove that a message of a flight was said by who has the flight's key.

A flight without a key has none of it: `ares_node.key` says how a flight gets one.
"""

import time
from collections import OrderedDict
from collections.abc import Callable
from hmac import compare_digest
from struct import pack
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from ares_msgs.msg import Seal
from ares_node.diagnostics import worth_saying
from ares_node.key import FORGED, digest, flight_key
from ares_node.qos import FLIGHT, FLIGHT_SEAL

#: Seals and messages that wait for each other, of a kind.
MOST_WAITING = 2000
#: Wall time in s after which a message without a seal is a forged one at the latest, and between
#: looks.
SEAL_TIMEOUT = 1.0
LOOK_PERIOD = 0.25


def canonical(message: Any) -> bytes:
    """All fields of a message but its digest, the same bytes on every machine."""
    names = message.get_fields_and_field_types()
    return b"".join(_packed(getattr(message, name)) for name in names if name != "digest")


def _packed(value: Any) -> bytes:
    if isinstance(value, (bool, int)):
        return pack("<cq", b"i", value) if value < 2**63 else pack("<cQ", b"i", value)
    if isinstance(value, float):
        return pack("<cd", b"f", value)
    if isinstance(value, str):
        text = value.encode("utf-8", "surrogatepass")
        return pack("<cI", b"s", len(text)) + text
    if hasattr(value, "get_fields_and_field_types"):
        return canonical(value)
    numbers = [float(number) for number in value]
    return pack(f"<cI{len(numbers)}d", b"a", len(numbers), *numbers)


def digest_of(key: bytes, message: Any) -> bytes:
    """Return the keyed digest of a message, or of one as it was sent."""
    if isinstance(message, bytes):
        return digest(key, "bytes", message)
    return digest(key, type(message).__name__, canonical(message))


def as_field(own: bytes) -> NDArray[np.uint8]:
    """Make of a digest what a message takes."""
    return np.frombuffer(own, np.uint8)


class Reader:
    """Hands on the messages of one kind that have a seal."""

    def __init__(self, name: str, take: Callable[[Any], None]) -> None:
        """Nothing waits.

        Args:
            name: of the topic.
            take: gets each message with a seal.
        """
        self.name = name
        self.take = take
        #: messages by digest, with the wall time at which they came
        self.waiting: OrderedDict[bytes, tuple[float, Any]] = OrderedDict()


class Seals:
    """The seals of a node's messages, and those of others.

    Attributes:
        key: of the flight; empty: there is none, nothing is sealed and everything is taken.
        forged: messages without a seal, so far.
    """

    def __init__(
        self, node: Node, flight_id: Callable[[], int], complain: Callable[[str], None]
    ) -> None:
        """Create the endpoints, if the flight has a key.

        Args:
            node: on which.
            flight_id: gives the flight that the node takes part in.
            complain: gets a line on messages without a seal, seldom.

        Raises:
            FlightKeyError: the key is none.
        """
        self.key = flight_key()
        self.forged = 0
        self._node = node
        self._flight_id = flight_id
        self._complain = complain
        self._readers: list[Reader] = []
        self._seen: OrderedDict[bytes, None] = OrderedDict()
        if self.key:
            self._out = node.create_publisher(Seal, FLIGHT_SEAL, FLIGHT)
            self._in = node.create_subscription(Seal, FLIGHT_SEAL, self._on_seal, FLIGHT)
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(LOOK_PERIOD, self._look, clock=steady)

    def close(self) -> None:
        """Free the endpoints."""
        if self.key:
            self._node.destroy_publisher(self._out)
            self._node.destroy_subscription(self._in)
            self._node.destroy_timer(self._timer)

    def seal(self, message: Any) -> None:
        """Publish the seal of a message that is said now: before it, so that it is there."""
        if self.key:
            own = digest_of(self.key, message)
            self._out.publish(Seal(flight_id=self._flight_id(), digest=as_field(own)))

    def reader(
        self,
        name: str,
        take: Callable[[Any], None],
        flight_of: Callable[[Any], int] = lambda message: int(message.flight_id),
        content: Callable[[Any], Any] = lambda message: message,
    ) -> Callable[[Any], None]:
        """Make of a callback one that hands on what has a seal.

        Args:
            name: of the topic.
            take: the callback.
            flight_of: gives the flight of a message.
            content: gives of a message as bytes those that were sealed.
        """
        if not self.key:
            return take
        reader = Reader(name, take)
        self._readers.append(reader)

        def hear(message: Any) -> None:
            if flight_of(message) != self._flight_id():
                # somebody else's business, which the callback knows
                take(message)
                return
            own = digest_of(self.key, content(message))
            now = time.monotonic()
            if own in self._seen:
                self._hand_on(reader, now, message)
                return
            reader.waiting[own] = now, message
            while len(reader.waiting) > MOST_WAITING:
                reader.waiting.popitem(last=False)
                self.note(f"a message on {name}")

        return hear

    def proves(self, message: Any) -> bool:
        """Tell whether a message holds its own digest, or the flight has no key."""
        return not self.key or compare_digest(digest_of(self.key, message), bytes(message.digest))

    def sealed(self, message: Any) -> Any:
        """Write its digest into a message."""
        if self.key:
            message.digest = as_field(digest_of(self.key, message))
        return message

    def _on_seal(self, seal: Seal) -> None:
        own = bytes(seal.digest)
        # whoever has no key can make no seal that any message has
        self._seen[own] = None
        if len(self._seen) > MOST_WAITING:
            self._seen.popitem(last=False)
        for reader in self._readers:
            waiting = reader.waiting.pop(own, None)
            if waiting is not None:
                self._hand_on(reader, *waiting)

    def _hand_on(self, reader: Reader, since: float, message: Any) -> None:
        """Take a message with a seal, and count those that came before it.

        Seals come in the order of their messages, so these have none.
        """
        for own, (came, _) in list(reader.waiting.items()):
            if came < since:
                del reader.waiting[own]
                self.note(f"a message on {reader.name}")
        reader.take(message)

    def _look(self) -> None:
        """Count what has waited too long."""
        now = time.monotonic()
        for reader in self._readers:
            while reader.waiting:
                own, (since, _) = next(iter(reader.waiting.items()))
                if now - since < SEAL_TIMEOUT:
                    break
                del reader.waiting[own]
                self.note(f"a message on {reader.name}")

    def note(self, what: str) -> None:
        """Count a forged message; say so of the first, and at every tenfold."""
        self.forged += 1
        if worth_saying(self.forged):
            text = f"{FORGED}{what} without the seal of the flight, refused"
            self._complain(f"{text} ({self.forged} so far)" if self.forged > 1 else text)
