# SPDX-License-Identifier: Apache-2.0
"""Watch one flight, print its summary and end with its exit status: the judge node."""

import signal
import sys
import time
from contextlib import suppress
from types import FrameType
from typing import Any

from rclpy.executors import Executor

from ares_bringup.fly import say_on_standard_error as say
from ares_bringup.inputs import mission_facts
from ares_bringup.keeper import RECORDER
from ares_bringup.monitor import FlightMonitor
from ares_bringup.options import CannotStart
from ares_bringup.outcomes import EXIT_CANNOT_START, EXIT_INTERRUPTED
from ares_bringup.processes import RECORDER_STOP_TIMEOUT
from ares_bringup.report import console, print_summary
from ares_bringup.summary import FlightSummary
from ares_bringup.watch import Watch
from ares_node.membership import FLIGHT_ID, State
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter

#: Wall time in s between two checks of the flight.
LOOK_PERIOD = 0.05

#: Signals of the launcher for a node that ended unexpectedly. A flight that has not begun cannot
#: start; one under way goes on, or is over if it was the simulator.
RECORDER_ENDED = signal.SIGUSR1
SIMULATOR_ENDED = signal.SIGUSR2
GUIDANCE_ENDED = signal.SIGRTMIN

PARAMETERS = (
    FLIGHT_ID,
    Parameter("mission", "ares_v", "Mission that is flown: name, or path of its file."),
    Parameter("law", "peg", "Guidance law, for the summary of a flight without its status."),
    Parameter("bag", "", "Folder of the bag, for the summary; empty: none."),
    Parameter(
        "expected_recorders",
        0,
        "Recorders whose bags must be closed before the verdict.",
        minimum=0,
        maximum=16,
    ),
)


class JudgeNode(FlightNode):
    """Judge a flight that other software starts, as `ares fly` does."""

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters."""
        super().__init__("judge", parameters=PARAMETERS, **kwargs)
        self._summary: FlightSummary | None = None
        self._over = False

    def configure(self) -> None:
        """Read the mission, create the endpoints."""
        values = self.values
        try:
            facts = mission_facts(values["mission"])
        except CannotStart as error:
            raise NodeError(str(error)) from error
        bag = values["bag"] or None
        self._begun = time.monotonic()
        self._summary = FlightSummary(facts, values["law"], bag, values["flight_id"])
        self._monitor = FlightMonitor(self, self._summary, say)
        self._ended: set[int] = set()
        for number in (RECORDER_ENDED, SIMULATOR_ENDED, GUIDANCE_ENDED):
            signal.signal(number, self._on_signal)

    def activate(self) -> None:
        """Start watching."""
        self._watch = Watch(self._monitor, say, lambda: False)
        self._looks = self.wall_timer(LOOK_PERIOD, self._on_look)

    def deactivate(self) -> None:
        """Stop watching."""
        self.destroy_timer(self._looks)

    def cleanup(self) -> None:
        """Free the endpoints."""
        self._monitor.leave()

    def drain(self, executor: Executor) -> None:
        """Print the summary if a signal ends the run before the flight is over."""
        if self._summary is not None and not self.done:
            self._summary.interrupted = True
            if self._summary.started:
                self._conclude(self._summary)
            else:
                self.exit_code = EXIT_INTERRUPTED

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._ended.add(number)

    def _on_look(self) -> None:
        summary = self._summary
        if summary is None or self.done:
            return
        if not self._over:
            try:
                lost = SIMULATOR_ENDED in self._ended
                self._over = self._watch.over() or (lost and summary.started)
            except CannotStart as error:
                say(f"{self.get_name()}: {error}")
                self.finish(EXIT_CANNOT_START)
                return
            self._over_at = time.monotonic()
        if self._over:
            if self._recorders_done() or SIMULATOR_ENDED in self._ended:
                self._conclude(summary)
        elif self._ended and not summary.started:
            self.finish(EXIT_CANNOT_START)
        elif GUIDANCE_ENDED in self._ended:
            # its successor may end too
            self._ended.remove(GUIDANCE_ENDED)
            self._monitor.guidance_ended()

    def _recorders_done(self) -> bool:
        done = self._monitor.recorders(State.OVER, State.FAILED, State.LEFT)
        late = time.monotonic() - self._over_at > RECORDER_STOP_TIMEOUT
        return (
            len(done) >= self.values["expected_recorders"] or late or RECORDER_ENDED in self._ended
        )

    def _conclude(self, summary: FlightSummary) -> None:
        for member in self._monitor.recorders(State.FAILED):
            summary.problems.append(f"{RECORDER}: {member.reason}")
        summary.wall_s = time.monotonic() - self._begun
        summary.guidance = law_that_flew(summary)
        self._monitor.say_verdict()
        print_summary(summary, console())
        sys.stdout.flush()
        self.finish(summary.exit_code)


def law_that_flew(summary: FlightSummary) -> str:
    """Return the law that ran in most cycles; before the first cycle, the requested one.

    Args:
        summary: of the flight; its `guidance` wins among laws of equal code.
    """
    from ares_guidance.laws import find_law
    from ares_guidance.registry import law_names

    if not summary.laws:
        return summary.guidance
    [(code, _)] = summary.laws.most_common(1)
    for name in (summary.guidance, *law_names()):
        with suppress(ValueError):
            if find_law(name).code == code:
                return name
    return f"law {code}"
