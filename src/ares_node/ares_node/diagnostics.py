# SPDX-License-Identifier: Apache-2.0
"""One-line reports: on /diagnostics with flight time, what is wrong on /rosout too."""

import math
from collections.abc import Callable, Mapping
from enum import Enum

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import Log
from rclpy.duration import Duration
from rclpy.node import Node

from ares_node.identity import id_text
from ares_node.qos import DIAGNOSTIC, DIAGNOSTICS, LOG, LOG_QOS
from ares_node.time import stamp_from_ns

#: Message of the topic TIMING.
Timing = DiagnosticStatus
#: What guidance tells of its timing when its last solution stands.
LONGEST_CYCLE_MS = "longest_cycle_ms"
#: What guidance reports of the plan that it has taken: mass after the last cut-off, and the lowest
#: altitude of its coasts.
FINAL_MASS_KG = "final_mass_kg"
LOWEST_COAST_M = "lowest_coast_m"
#: What simulator and replay tell of the wall clock: real-time factor, whether it pauses, and the
#: full name of the node, whose parameters of the same names may be set.
PACE = "pace"
PAUSED = "paused"
NODE = "node"
#: What the live page tells: in how many browsers it is open.
PAGES = "pages"
#: What the judge tells the live page in the end, and whether all was as it should be.
VERDICT = "verdict"
GOOD = "good"


def worth_saying(count: int) -> bool:
    """Tell whether a report of which there are so many is said: the first, and at every tenfold."""
    return count > 0 and math.log10(count).is_integer()


class Level(Enum):
    """Severity of a report, by the constants of diagnostic_msgs/DiagnosticStatus."""

    OK = DiagnosticStatus.OK
    WARN = DiagnosticStatus.WARN
    ERROR = DiagnosticStatus.ERROR
    STALE = DiagnosticStatus.STALE


#: Severities that /rosout hears of.
_LOGGED = {Level.WARN: Log.WARN, Level.ERROR: Log.ERROR}
#: Longest wall time in s that the last words of a node may take to arrive.
_LAST_WORDS = 0.2


def folded(text: str) -> str:
    """A text on one line."""
    return " ".join(text.split())


#: What the hardware id of a report on a flight begins with.
FLIGHT_PREFIX = "flight:"


def hardware_id(flight_id: int) -> str:
    """The hardware id of reports on a flight; empty if there is no flight."""
    return FLIGHT_PREFIX + id_text(flight_id) if flight_id else ""


def of_another_flight(status: DiagnosticStatus, flight_id: int) -> bool:
    """Whether a report says that it is on a flight, and that this is another one."""
    return bool(
        status.hardware_id.startswith(FLIGHT_PREFIX)
        and status.hardware_id != hardware_id(flight_id)
    )


class Diagnostics:
    """Publisher of a node's reports; each report is one array with one status.

    The status name is the node's full name without the leading slash (`ares/recorder`), the
    hardware id is `flight:` and the identity of the flight, as soon as there is one. Warnings
    and errors are log records on /rosout too; the console is not written to, since whoever
    starts the node has its own way to show them.
    """

    def __init__(self, node: Node, flight_id: Callable[[], int] = lambda: 0) -> None:
        """Create the publishers.

        Args:
            node: whose reports these are.
            flight_id: gives the flight that the node takes part in; 0 for none.
        """
        self._node = node
        self._flight_id = flight_id
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, DIAGNOSTIC)
        self._log = node.create_publisher(Log, LOG, LOG_QOS)

    def report(
        self,
        level: Level,
        message: str,
        stamp_ns: int,
        values: Mapping[str, object] | None = None,
    ) -> None:
        """Publish one status.

        Args:
            level: severity.
            message: one line; a longer text is folded into one line.
            stamp_ns: flight time in ns.
            values: further facts; each value is written with str().
        """
        status = DiagnosticStatus(
            level=level.value,
            name=self._name,
            hardware_id=hardware_id(self._flight_id()),
            message=folded(message),
            values=[KeyValue(key=key, value=str(value)) for key, value in (values or {}).items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = stamp_from_ns(stamp_ns)
        self._publisher.publish(array)
        if level in _LOGGED:
            self.log(level, message)

    def log(self, level: Level, message: str) -> None:
        """Publish one log record on /rosout only.

        Args:
            level: WARN or ERROR.
            message: one line; a longer text is folded into one line.
        """
        self._log.publish(
            Log(
                stamp=self._node.get_clock().now().to_msg(),
                level=_LOGGED[level],
                name=self._node.get_logger().name,
                msg=folded(message),
            )
        )

    def last_words(self, message: str) -> None:
        """An error on /rosout from a node that ends at once: wait until it has been sent."""
        self.log(Level.ERROR, message)
        self._log.wait_for_all_acked(Duration(seconds=_LAST_WORDS))


def number_of(said: Mapping[str, str], key: str) -> float | None:
    """A number among the facts of `timing`; None where there is none, or none that is finite."""
    try:
        value = float(said.get(key, ""))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def pace_word(node: Node, flight_id: int, pace: float, paused: bool) -> DiagnosticStatus:
    """How fast a node lets a flight go by, for the topic TIMING.

    Args:
        node: whose parameters `pace` and `paused` say so.
        flight_id: the flight.
        pace: real-time factor; 0: as fast as may be.
        paused: nothing goes by.
    """
    name = node.get_fully_qualified_name()
    return timing(node, flight_id, {PACE: pace, PAUSED: paused, NODE: name})


def timing(node: Node, flight_id: int, values: Mapping[str, object]) -> DiagnosticStatus:
    """What took how long, for the topic TIMING.

    Args:
        node: whose.
        flight_id: that it takes part in.
        values: facts; each is written with str().
    """
    return Timing(
        name=node.get_name(),
        hardware_id=hardware_id(flight_id),
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
