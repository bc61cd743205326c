# SPDX-License-Identifier: Apache-2.0
"""Seals: proof that the publisher of a message holds the flight's key.

A flight without a key has no seals; see `ares_node.key`.
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
from ares_node.diagnostics import is_worth_reporting
from ares_node.key import FORGED, digest, flight_key
from ares_node.qos import FLIGHT, FLIGHT_SEAL

#: Largest number of pending seals, and of pending messages per topic.
MOST_WAITING = 2000
#: Timeout of a message without a seal, after which it counts as forged, and period of the checks,
#: wall time, s.
SEAL_TIMEOUT = 1.0
LOOK_PERIOD = 0.25


def canonical(message: Any) -> bytes:
    """Serialize all fields of a message except its digest, equally on every machine."""
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
    """Return the keyed digest of a message or of its serialized content."""
    if isinstance(message, bytes):
        return digest(key, "bytes", message)
    return digest(key, type(message).__name__, canonical(message))


def as_field(own: bytes) -> NDArray[np.uint8]:
    """Convert a digest to the field of a message."""
    return np.frombuffer(own, np.uint8)


class Reader:
    """Hold the pending messages of a topic."""

    def __init__(self, name: str, callback: Callable[[Any], None]) -> None:
        """Start without pending messages.

        Args:
            name: of the topic.
            callback: called with each sealed message.
        """
        self.name = name
        self.callback = callback
        #: messages by digest, with their wall time of arrival
        self.waiting: OrderedDict[bytes, tuple[float, Any]] = OrderedDict()


class Seals:
    """Seal a node's messages and check the seals of others.

    Attributes:
        key: of the flight; empty: nothing is sealed and everything is accepted.
        forged: number of messages without a seal.
    """

    def __init__(
        self, node: Node, flight_id: Callable[[], int], complain: Callable[[str], None]
    ) -> None:
        """Create the endpoints, if the flight has a key.

        Args:
            node: that owns the endpoints.
            flight_id: returns the flight of the node.
            complain: called with a line on forged messages, the first and every tenfold.

        Raises:
            FlightKeyError: the key is invalid.
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
            self._timer = node.create_timer(LOOK_PERIOD, self._expire, clock=steady)

    def close(self) -> None:
        """Free the endpoints."""
        if self.key:
            self._node.destroy_publisher(self._out)
            self._node.destroy_subscription(self._in)
            self._node.destroy_timer(self._timer)

    def seal(self, message: Any) -> None:
        """Publish the seal of a message; call it before the message is published."""
        if self.key:
            own = digest_of(self.key, message)
            self._out.publish(Seal(flight_id=self._flight_id(), digest=as_field(own)))

    def reader(
        self,
        name: str,
        callback: Callable[[Any], None],
        flight_of: Callable[[Any], int] = lambda message: int(message.flight_id),
        content: Callable[[Any], Any] = lambda message: message,
    ) -> Callable[[Any], None]:
        """Wrap a callback to receive only sealed messages of this flight.

        Args:
            name: of the topic.
            callback: of the subscription.
            flight_of: returns the flight of a message.
            content: returns the sealed part of a raw message.
        """
        if not self.key:
            return callback
        reader = Reader(name, callback)
        self._readers.append(reader)

        def receive(message: Any) -> None:
            if flight_of(message) != self._flight_id():
                # the callback handles messages of other flights
                callback(message)
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

        return receive

    def proves(self, message: Any) -> bool:
        """Return whether a message holds its own digest; compare in constant time.

        Without a key every message passes.
        """
        return not self.key or compare_digest(digest_of(self.key, message), bytes(message.digest))

    def sealed(self, message: Any) -> Any:
        """Write its digest into a message."""
        if self.key:
            message.digest = as_field(digest_of(self.key, message))
        return message

    def _on_seal(self, seal: Seal) -> None:
        own = bytes(seal.digest)
        # without the key nobody can make a seal that matches a message
        self._seen[own] = None
        if len(self._seen) > MOST_WAITING:
            self._seen.popitem(last=False)
        for reader in self._readers:
            waiting = reader.waiting.pop(own, None)
            if waiting is not None:
                self._hand_on(reader, *waiting)

    def _hand_on(self, reader: Reader, since: float, message: Any) -> None:
        """Deliver a sealed message, and count earlier pending ones as forged.

        Seals arrive in the order of their messages, so the earlier ones have none.
        """
        for own, (came, _) in list(reader.waiting.items()):
            if came < since:
                del reader.waiting[own]
                self.note(f"a message on {reader.name}")
        reader.callback(message)

    def _expire(self) -> None:
        """Count messages that have waited too long as forged."""
        now = time.monotonic()
        for reader in self._readers:
            while reader.waiting:
                own, (since, _) = next(iter(reader.waiting.items()))
                if now - since < SEAL_TIMEOUT:
                    break
                del reader.waiting[own]
                self.note(f"a message on {reader.name}")

    def note(self, what: str) -> None:
        """Count a forged message; report the first and every tenfold."""
        self.forged += 1
        if is_worth_reporting(self.forged):
            text = f"{FORGED}{what} without the seal of the flight, refused"
            self._complain(f"{text} ({self.forged} so far)" if self.forged > 1 else text)
