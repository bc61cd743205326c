# SPDX-License-Identifier: Apache-2.0
"""Fly with one process for each node."""

import os
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ares_bringup.crew import Crew, describe_end, ros_arguments
from ares_bringup.graph import Callbacks, Say, flight_graph, keep_watch, spinning
from ares_bringup.held import shared_memory_cleared
from ares_bringup.keeper import (
    GUIDANCE,
    OPTIMIZER,
    RECORDER,
    SIMULATOR,
    SPARED,
    VIEW,
    Keeper,
    describe_loss,
)
from ares_bringup.options import CannotStart
from ares_bringup.outcomes import EXIT_CANNOT_START
from ares_bringup.summary import FlightSummary

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from ares_bringup.monitor import FlightMonitor

#: Modules that run the nodes as processes.
MODULES = {
    SIMULATOR: "ares_vehicle_sim",
    GUIDANCE: "ares_guidance",
    RECORDER: "ares_bags",
    OPTIMIZER: "ares_optimizer",
    VIEW: "ares_view.standard",
}
#: Wall time in s for which the start of guidance waits for the optimizer, which may compile first.
OPTIMIZER_TIMEOUT = 120.0
#: Wall time in s for simulator and guidance to end: after the flight, and after a signal,
#: where a person waits.
NODE_STOP_TIMEOUT = 10.0
INTERRUPTED_STOP_TIMEOUT = 3.0
#: Wall time in s by which the recorder ends after the other nodes.
HEAD_START = 0.1
#: Wall time in s for the recorder to write its queues and close the bag.
RECORDER_STOP_TIMEOUT = 30.0


def fly_in_processes(
    summary: FlightSummary,
    parameters: Mapping[str, Mapping[str, Any]],
    terms: Callbacks,
    modules: Mapping[str, str],
) -> None:
    """Fly with one process for each node; add what is seen to the summary.

    Args:
        summary: of the flight.
        parameters: of each node, by its name.
        terms: callbacks and options.
        modules: module of each node, by its name.

    Raises:
        CannotStart: a node cannot start; one line, "" if it has printed the reason.
    """
    say, audience = terms.say, terms.audience
    keeper = Keeper(terms.options.restarts)
    with (
        shared_memory_cleared() as look_at_shared_memory,
        Crew({**os.environ, "ROS_DOMAIN_ID": str(summary.domain_id)}) as crew,
    ):

        def start(name: str) -> None:
            arguments = ros_arguments(parameters[name], summary.namespace)
            crew.start(name, modules[name], [*arguments, *terms.options.arguments.get(name, ())])

        # guidance needs the optimizer at its start, so it starts after it
        late = [GUIDANCE] if OPTIMIZER in parameters else []
        begun = time.monotonic()

        def lost() -> bool:
            if late and _answers_or_never(monitor, crew, begun):
                start(late.pop())
            look_at_shared_memory()
            audience.look(monitor)
            terms.show(monitor)
            for name, again in _ended(crew, keeper, summary, say):
                if name == GUIDANCE:
                    monitor.guidance_ended()
                if again:
                    start(name)
            return SIMULATOR not in crew.running()

        # the children first, since they take longest to start
        for name in parameters:
            if name not in late:
                start(name)
        with flight_graph(summary, say, lambda: False) as (monitor, executor, stop):
            audience.come(monitor)
            with spinning(monitor, executor, stop) as spinner:
                keep_watch(monitor, terms, stop, spinner, lost)

            within = INTERRUPTED_STOP_TIMEOUT if stop.requested else NODE_STOP_TIMEOUT
            _end_crew(crew, summary, say, executor, within)
            audience.leave(monitor)


def _answers_or_never(monitor: "FlightMonitor", crew: Crew, begun: float) -> bool:
    """Return whether the optimizer answers, has ended or has had its time to start."""
    from ares_node.qos import SOLVE_TRAJECTORY

    return (
        bool(monitor.node.count_services(SOLVE_TRAJECTORY))
        or OPTIMIZER not in crew.running()
        or time.monotonic() - begun > OPTIMIZER_TIMEOUT
    )


def _ended(crew: Crew, keeper: Keeper, summary: FlightSummary, say: Say) -> list[tuple[str, bool]]:
    """Report the nodes that have ended; return each with whether to restart it.

    Raises:
        CannotStart: the flight has not begun, and cannot without one of them.
    """
    ended = []
    for name, status in crew.newly_ended():
        if status == EXIT_CANNOT_START and (name == SIMULATOR or not summary.started):
            # the node has printed the reason
            raise CannotStart("")
        if not summary.started and name not in SPARED:
            raise CannotStart(f"{name} {describe_end(status)}")
        line, again = keeper.ended(name, status)
        _say_ended(name, line, summary, say)
        ended.append((name, again))
    return ended


def _say_ended(name: str, line: str, summary: FlightSummary, say: Say) -> None:
    """Report that a node has ended; count it as a shortcoming unless the flight can spare it."""
    if name not in SPARED:
        summary.problems.append(line)
    say(line)


def _end_crew(
    crew: Crew, summary: FlightSummary, say: Say, executor: "Executor", within: float
) -> None:
    """End the flying nodes within `within` s, then the recorder, which writes all they sent."""

    def listen() -> None:
        executor.spin_once(timeout_sec=0.005)

    alive = crew.running()
    for name, status in crew.newly_ended():
        # ended between the last poll and the end of the flight
        if summary.started and name not in SPARED:
            _say_ended(name, describe_loss(name, status), summary, say)
    flying = [name for name in alive if name != RECORDER]
    crew.ask_to_stop(flying)
    if RECORDER in alive:
        # the recorder receives their last messages before it ends
        begun = time.monotonic()
        while time.monotonic() - begun < HEAD_START and set(flying) & set(crew.running()):
            listen()
        crew.ask_to_stop([RECORDER])
    for name in crew.stop(flying, within, listen):
        problem = f"{name} did not end within {within:g} s: killed"
        if name in SPARED:
            say(problem)
        else:
            summary.problems.append(problem)
    if RECORDER in alive:
        crew.stop([RECORDER], RECORDER_STOP_TIMEOUT, listen)
        if closed := crew.status(RECORDER):
            summary.problems.append(f"{RECORDER} {describe_end(closed)}: the bag is incomplete")
