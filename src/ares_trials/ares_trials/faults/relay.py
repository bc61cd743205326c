# SPDX-License-Identifier: Apache-2.0
"""Relay messages between simulator and guidance, and tamper with them."""

import math
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher

from ares_msgs.msg import FlightMember, NavState, ThrustCommand
from ares_node.membership import Membership, Role
from ares_node.qos import FLIGHT, NAV_STATE, THRUST_COMMAND
from ares_node.states import StateMessage
from ares_node.time import NANOSECONDS

#: Namespace of guidance's topics beyond the relay.
BEYOND = "relayed/"
#: ROS arguments that put guidance beyond the relay and make the simulator wait for the relay.
GUIDANCE_ARGUMENTS = tuple(
    word for name in (NAV_STATE, THRUST_COMMAND) for word in ("-r", f"{name}:={BEYOND}{name}")
)
SIMULATOR_ARGUMENTS = ("-p", "expected_judges:=2")

#: Maps flight time in s and a message to its copies, each with its delay in s.
Tamper = Callable[[float, Any], list[tuple[float, Any]]]


class Channel:
    """Carry the messages of one direction.

    Attributes:
        tamper: applied to messages; None: none.
        begin: first flight time at which it applies, s.
        end: flight time at which it ends, s.
        after: deliver late messages after newer ones instead of before.
        touched: number of messages tampered with.
    """

    def __init__(self, out: Publisher) -> None:
        self.tamper: Tamper | None = None
        self.begin = -math.inf
        self.end = math.inf
        self.after = False
        self.touched = 0
        self._out = out
        self._late: list[tuple[float, Any]] = []

    def take(self, now: float, message: Any) -> None:
        """Forward a message at a flight time in s, tampered with if due."""
        fates = [(0.0, message)]
        if self.tamper is not None and self.begin <= now < self.end:
            fates = self.tamper(now, message)
            self.touched += len(fates) != 1 or fates[0] != (0.0, message)
        for delay, copy in fates:
            if delay > 0.0:
                self._late.append((now + delay, copy))
            else:
                self._out.publish(copy)

    def release(self, now: float) -> None:
        """Forward the delayed messages that are due at a flight time in s."""
        due = [copy for at, copy in self._late if at <= now]
        self._late = [(at, copy) for at, copy in self._late if at > now]
        for copy in due:
            self._out.publish(copy)


class Relay:
    """Join the flight as a judge, so that the simulator waits for both sides.

    Attributes:
        now: flight time of the newest navigation state, s.
        states: from the simulator.
        commands: from guidance.
        last_command: the newest command; None before the first.
        hold_at: flight time in s from which the next state is withheld until `let_go`.
        on_command: called with each command before it is forwarded.
    """

    def __init__(self, node: Node) -> None:
        """Create the endpoints.

        Args:
            node: owner of the endpoints.
        """
        self.now = -math.inf
        self.hold_at = math.inf
        self.last_command: ThrustCommand | None = None
        self.on_command: Callable[[ThrustCommand], None] = lambda _command: None
        self._message = StateMessage(NavState)
        self._held: bytes | None = None
        self.membership = Membership(node, Role.JUDGE)
        self.states = Channel(node.create_publisher(NavState, BEYOND + NAV_STATE, FLIGHT))
        self.commands = Channel(node.create_publisher(ThrustCommand, THRUST_COMMAND, FLIGHT))
        node.create_subscription(NavState, NAV_STATE, self._on_state, FLIGHT, raw=True)
        node.create_subscription(ThrustCommand, BEYOND + THRUST_COMMAND, self._on_command, FLIGHT)
        self.membership.listen(self._on_member)

    @property
    def holding(self) -> bool:
        """Return whether a state is withheld, so that the simulator waits for its answer."""
        return self._held is not None

    def let_go(self, hold_at: float = math.inf) -> None:
        """Forward the state withheld, and withhold none before another flight time in s."""
        data, self._held, self.hold_at = self._held, None, hold_at
        if data is not None:
            self._hand_on(data)

    def changed(self, data: bytes, change: Callable[[Any], None]) -> bytes:
        """Return a serialized state with its record changed."""
        stamp, flight_id, sequence, record = self._message.read(data)
        record = record.copy()
        change(record)
        return self._message.data(stamp, flight_id, sequence, record)

    def restamped(self, data: bytes, stamp_ns: int) -> bytes:
        """Return a serialized state with another stamp, ns."""
        _, flight_id, sequence, record = self._message.read(data)
        return self._message.data(stamp_ns, flight_id, sequence, record)

    def _on_member(self, _member: FlightMember) -> None:
        self.membership.agree_as_observer()

    def _on_state(self, data: bytes) -> None:
        stamp, flight_id, _, _ = self._message.read(data)
        if not self.membership.belongs(flight_id):
            return
        self.now = stamp / NANOSECONDS
        if self.now >= self.hold_at:
            self._held = data
        else:
            self._hand_on(data)

    def _hand_on(self, data: bytes) -> None:
        for channel in (self.commands, self.states):
            if not channel.after:
                channel.release(self.now)
        self.states.take(self.now, data)
        for channel in (self.commands, self.states):
            channel.release(self.now)

    def _on_command(self, command: ThrustCommand) -> None:
        self.last_command = command
        self.on_command(command)
        self.commands.take(self.now, command)
