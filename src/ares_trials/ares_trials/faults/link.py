# SPDX-License-Identifier: Apache-2.0
"""Simulate a link with latency and loss between simulator and guidance.

In lock-step, times are flight time: the simulator waits until the link has delivered everything due
by then, so a flight is the same on every machine, at any pace. In real time (`wall`) they are
wall-clock time. Messages keep their order, as in reliable DDS.

python -m ares_trials.faults.link --ros-args ... inserts it into a flight of other processes.
"""

import sys
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from rclpy.node import Node

from ares_bringup.discovery import apply_discovery_settings
from ares_msgs.msg import ThrustCommand
from ares_node.membership import State
from ares_node.node import FlightNode
from ares_node.parameters import Parameter
from ares_node.run import run_node
from ares_trials.faults.relay import Relay

#: Wall time in s between two deliveries.
LOOK_PERIOD = 0.0005


@dataclass(frozen=True)
class LinkOptions:
    """Hold the parameters of a link, equal in both directions.

    Attributes:
        latency_s: delay of each message, s.
        jitter_s: largest additional delay, uniformly distributed, s.
        loss: fraction of the messages lost.
        seed: of jitter and loss.
        wall: times are of the wall clock, not of the flight.
    """

    latency_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    seed: int = 0
    wall: bool = False


class DelayLine:
    """Delay the messages of one direction, first in, first out.

    Attributes:
        lost: number of messages lost.
        carried: number of the others.
    """

    def __init__(self, options: LinkOptions, rng: Generator) -> None:
        """Start empty."""
        self.lost = self.carried = 0
        self._options = options
        self._rng = rng
        self._under_way: deque[tuple[float, Any]] = deque()

    def send(self, now: float, message: Any) -> None:
        """Accept a message at a time in s."""
        options = self._options
        lost, late = self._rng.random(2)
        if lost < options.loss:
            self.lost += 1
            return
        self.carried += 1
        arrival = now + options.latency_s + options.jitter_s * late
        if self._under_way:
            arrival = max(arrival, self._under_way[-1][0])
        self._under_way.append((arrival, message))

    def arrived(self, now: float) -> list[tuple[float, Any]]:
        """Return the messages that have arrived by a time in s, with their arrival times."""
        found = []
        # 1 ns of tolerance for rounding
        while self._under_way and self._under_way[0][0] <= now + 1e-9:
            found.append(self._under_way.popleft())
        return found


class Link(Relay):
    """Carry states up and commands down; the first of each at once, since they precede the flight.

    Attributes:
        up: from the simulator to guidance.
        down: from guidance to the simulator.
    """

    def __init__(self, node: Node, options: LinkOptions) -> None:
        """Create the endpoints on a node."""
        super().__init__(node)
        rngs = np.random.default_rng(options.seed).spawn(2)
        self.up, self.down = (DelayLine(options, rng) for rng in rngs)
        self._wall = options.wall
        self._in_force: ThrustCommand | None = None
        #: arrival time and CDR of states whose answers are awaited
        self._to_answer: deque[tuple[float, bytes]] = deque()

    def _hand_on(self, data: bytes) -> None:
        if self._wall:
            self.up.send(time.monotonic(), data)
            return
        if self._in_force is None:
            self._to_answer.append((self.now, data))
        else:
            self.up.send(self.now, data)
            self._to_answer.extend(self.up.arrived(self.now))
        self._go_on()

    def _go_on(self) -> None:
        """Send guidance the next state to answer; without one, deliver the command in force."""
        if self._to_answer:
            self.states.take(self.now, self._to_answer[0][1])
            return
        for _, command in self.down.arrived(self.now):
            self._in_force = command
        if self._in_force is not None:
            self.commands.take(self.now, self._in_force)

    def _on_command(self, command: ThrustCommand) -> None:
        self.last_command = command
        if self._wall:
            self.down.send(time.monotonic(), command)
            return
        if not self._to_answer:
            return
        at, _ = self._to_answer.popleft()
        if self._in_force is None:
            self._in_force = command
        else:
            self.down.send(at, command)
        self._go_on()

    def look(self) -> None:
        """Deliver the messages due by the wall clock."""
        now = time.monotonic()
        for _, data in self.up.arrived(now):
            self.states.take(now, data)
        for _, command in self.down.arrived(now):
            self.commands.take(now, command)


PARAMETERS = (
    Parameter("latency_s", 0.0, "Time that each message takes.", unit="s", minimum=0.0),
    Parameter("jitter_s", 0.0, "What it may take longer.", unit="s", minimum=0.0),
    Parameter("loss", 0.0, "Share of messages that are lost.", minimum=0.0, maximum=1.0),
    Parameter("seed", 0, "Seed of jitter and loss.", minimum=0),
)


class LinkNode(FlightNode):
    """Run a real-time link in the first flight heard."""

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters."""
        super().__init__("link", parameters=PARAMETERS, **kwargs)

    def configure(self) -> None:
        """Create the link."""
        self._link = Link(
            self, LinkOptions(**{p.name: self.values[p.name] for p in PARAMETERS}, wall=True)
        )

    def activate(self) -> None:
        """Start delivering."""
        self._timer = self.wall_timer(LOOK_PERIOD, self._look)

    def deactivate(self) -> None:
        """Stop delivering."""
        self.destroy_timer(self._timer)

    def cleanup(self) -> None:
        """Leave the flight."""
        self._link.membership.close()

    def _look(self) -> None:
        self._link.look()
        simulator = self._link.membership.simulator
        if simulator is not None and simulator.state == State.OVER and not self.done:
            up, down = self._link.up, self._link.down
            self.get_logger().info(
                f"states: {up.carried} carried, {up.lost} lost; "
                f"commands: {down.carried} carried, {down.lost} lost"
            )
            self.finish(0)


def main() -> int:
    """Run the node as a process."""
    apply_discovery_settings()
    return run_node(LinkNode, name="link")


if __name__ == "__main__":
    sys.exit(main())
