# SPDX-License-Identifier: Apache-2.0
"""Join the graph of a flight as its judge, and spin until the flight is over."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ares_bringup.audience import Audience
from ares_bringup.keeper import JUDGE
from ares_bringup.options import FlyOptions
from ares_bringup.outcomes import EXIT_INTERRUPTED
from ares_bringup.summary import FlightSummary
from ares_bringup.watch import PATIENCE, Watch
from ares_node.names import remappings
from ares_node.security import enclave_arguments

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from ares_bringup.monitor import FlightMonitor
    from ares_node.run import StopSignals
    from ares_node.spin import Spinner

#: Security enclave of this process, which runs the judge, or all nodes.
FLY = "fly"
Say = Callable[[str], None]
Show = Callable[["FlightMonitor"], None]


@dataclass(frozen=True)
class Callbacks:
    """Hold the callbacks and options of a flight.

    Attributes:
        say: gets lines for the user.
        begun: called when the flight has begun.
        audience: the live page.
        show: gets the monitor repeatedly.
        options: the flight.
    """

    say: Say
    begun: Callable[[], None]
    audience: Audience
    show: Show
    options: FlyOptions


@contextmanager
def flight_graph(
    summary: FlightSummary, say: Say, abandonable: Callable[[], bool]
) -> Iterator[tuple["FlightMonitor", "Executor", "StopSignals"]]:
    """Yield the monitor and its executor in a private context, and the signals as a flag.

    Args:
        summary: of the flight.
        say: gets lines for the user.
        abandonable: whether an interrupted process may end at once, even while it computes.
    """
    import rclpy
    from rclpy.context import Context
    from rclpy.experimental.events_executor import EventsExecutor
    from rclpy.node import Node
    from rclpy.signals import SignalHandlerOptions

    from ares_bringup.monitor import FlightMonitor
    from ares_node.heartbeat import Heartbeat
    from ares_node.run import StopSignals

    stop = StopSignals(abandonable, EXIT_INTERRUPTED)
    stop.starting = False
    context = Context()
    with stop.watch():
        rclpy.init(
            args=enclave_arguments(FLY),
            context=context,
            domain_id=summary.domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        try:
            executor = EventsExecutor(context=context)
            stop.install()
            stop.wake_with(executor.wake)
            node = Node(
                JUDGE,
                namespace=summary.namespace,
                context=context,
                cli_args=["--ros-args", *remappings(summary.namespace)],
                enable_rosout=False,
                start_parameter_services=False,
            )
            Heartbeat(node, flight_id=lambda: summary.flight_id)
            monitor = FlightMonitor(node, summary, say)
            try:
                executor.add_node(node)
                yield monitor, executor, stop
            finally:
                stop.wake_with(None)
                executor.shutdown()
                monitor.leave()
                node.destroy_node()
        finally:
            context.try_shutdown()


@contextmanager
def spinning(
    monitor: "FlightMonitor", executor: "Executor", stop: "StopSignals"
) -> Iterator["Spinner"]:
    """Yield a spinner that returns at once on a signal and at the end of the flight."""
    from ares_node.spin import Spinner

    with Spinner(executor, monitor.node) as spinner:
        monitor.when_ended = spinner.come_back
        stop.wake_with(spinner.come_back)
        yield spinner
        stop.wake_with(executor.wake)


def keep_watch(
    monitor: "FlightMonitor",
    terms: Callbacks,
    stop: "StopSignals",
    spinner: "Spinner",
    lost: Callable[[], bool],
) -> None:
    """Spin until the flight is over or lost.

    Args:
        monitor: of the flight.
        terms: callbacks of the flight.
        stop: signals so far.
        spinner: of its executor.
        lost: whether the flight cannot go on.
    """
    # only on a terminal: for a program, the lines must not depend on the machine's speed
    patience = PATIENCE if sys.stderr.isatty() else math.inf
    watch = Watch(monitor, terms.say, lambda: stop.requested, terms.begun, patience)
    while not watch.over():
        spinner.spin()
        if lost():
            return
