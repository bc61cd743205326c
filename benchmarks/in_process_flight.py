# SPDX-License-Identifier: Apache-2.0
"""Compare a recorded flight in one process with a bare exchange of the same messages, in turn.

    ./ares exec python benchmarks/in_process_flight.py [--rounds N]

The exchange is two nodes on one executor without computation: one sends the clock, the true state
and the navigation state, the other the command, and with every tenth its status.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import rclpy
from figures import Figures, keep_option
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from ares_bringup.fly import fly
from ares_bringup.options import FlyOptions
from ares_msgs.msg import GuidanceStatus, NavState, ThrustCommand, VehicleState
from ares_node.domains import claimed_domain
from ares_node.qos import (
    CLOCK,
    CLOCK_QOS,
    FLIGHT,
    GUIDANCE_STATUS,
    NAV_STATE,
    THRUST_COMMAND,
    VEHICLE_STATE,
)

CYCLE = 10


class Exchange:
    """Run two nodes that answer each other."""

    def __init__(self, context: Context, count: int) -> None:
        """Prepare to send `count` navigation states."""
        self.left = count
        self.answers = 0
        self.one = Node("one", namespace="ares", context=context)
        self.other = Node("other", namespace="ares", context=context)
        self.clock = self.one.create_publisher(Clock, CLOCK, CLOCK_QOS)
        self.truth = self.one.create_publisher(VehicleState, VEHICLE_STATE, FLIGHT)
        self.nav = self.one.create_publisher(NavState, NAV_STATE, FLIGHT)
        self.command = self.other.create_publisher(ThrustCommand, THRUST_COMMAND, FLIGHT)
        self.status = self.other.create_publisher(GuidanceStatus, GUIDANCE_STATUS, FLIGHT)
        self.one.create_subscription(ThrustCommand, THRUST_COMMAND, self.on_command, FLIGHT)
        self.other.create_subscription(NavState, NAV_STATE, self.on_nav, FLIGHT)

    def send(self) -> None:
        """Send one state."""
        self.clock.publish(Clock())
        self.truth.publish(VehicleState())
        self.nav.publish(NavState())

    def on_nav(self, _: NavState) -> None:
        """Answer a state."""
        self.command.publish(ThrustCommand())
        self.answers += 1
        if self.answers % CYCLE == 0:
            self.status.publish(GuidanceStatus())

    def on_command(self, _: ThrustCommand) -> None:
        """Send the next state."""
        self.left -= 1
        if self.left:
            self.send()


def exchange(count: int) -> float:
    """Return the wall time of `count` states and answers, s."""
    context = Context()
    with claimed_domain() as domain:
        rclpy.init(args=[], context=context, domain_id=domain)
        executor = EventsExecutor(context=context)
        both = Exchange(context, count)
        executor.add_node(both.one)
        executor.add_node(both.other)
        while not (both.nav.get_subscription_count() and both.command.get_subscription_count()):
            executor.spin_once(timeout_sec=0.01)
        begun = time.perf_counter()
        both.send()
        while both.left:
            executor.spin_once(timeout_sec=1.0)
        taken = time.perf_counter() - begun
        executor.shutdown()
        both.one.destroy_node()
        both.other.destroy_node()
        context.try_shutdown()
    return taken


def flight(bag: Path) -> tuple[float, int]:
    """Return Ares V's wall time without start-up, s, and its navigation states."""
    summary = fly(FlyOptions("ares_v", in_process=True, bag=bag))
    assert summary.exit_code == 0 and summary.realtime_factor is not None
    length = summary.events[-1].time - summary.events[0].time
    return length / summary.realtime_factor, round(10.0 * length)


def main() -> None:
    """Print both times and their ratio for each round."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    keep_option(parser)
    options = parser.parse_args()
    ratios = []
    with tempfile.TemporaryDirectory() as name:
        for k in range(options.rounds):
            flown, states = flight(Path(name) / f"bag_{k}")
            bare = exchange(states)
            ratios.append(flown / bare)
            print(f"{states} states: flight {flown:.2f} s, bare exchange {bare:.2f} s", flush=True)
    figures = Figures(
        __file__, "A recorded flight in one process beside a bare exchange of its messages."
    )
    figures.add("ratio, median", statistics.median(ratios), "")
    figures.add("ratio, least", min(ratios), "")
    figures.add("ratio, greatest", max(ratios), "")
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
