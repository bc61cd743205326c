# SPDX-License-Identifier: Apache-2.0
"""One-line reports on /diagnostics with flight time, warnings and errors also on /rosout."""

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
#: Timing of guidance, published when it holds its steering.
LONGEST_CYCLE_MS = "longest_cycle_ms"
#: Facts of an accepted plan, reported by guidance: mass after the last cut-off, and lowest altitude
#: of its coasts.
FINAL_MASS_KG = "final_mass_kg"
LOWEST_COAST_M = "lowest_coast_m"
#: Fact of a flight through the air, reported by the simulator at its end, see
#: `ares_models.passage`.
PASSAGE = "passage"
#: Facts on the pace of simulator or replay: real-time factor, pause, and the full name of the node
#: with the parameters of the same names.
PACE = "pace"
PAUSED = "paused"
NODE = "node"
#: Fact of a simulator: flight time, s.
FLIGHT_TIME_S = "flight_time_s"
#: Fact of a replay: true.
REPLAYED = "replayed"
#: Fact of the live page: number of browsers in which it is open.
PAGES = "pages"
#: Facts of the judge for the live page: the verdict, whether it is good, the shortcomings, one per
#: line, and the exit status with its meaning.
VERDICT = "verdict"
GOOD = "good"
SHORTCOMINGS = "shortcomings"
EXIT_STATUS = "exit_status"


def is_worth_reporting(count: int) -> bool:
    """Return whether to report a repeated event: the first, and every tenfold count."""
    return count > 0 and math.log10(count).is_integer()


class Level(Enum):
    """Severity of a report, by the constants of diagnostic_msgs/DiagnosticStatus."""

    OK = DiagnosticStatus.OK
    WARN = DiagnosticStatus.WARN
    ERROR = DiagnosticStatus.ERROR
    STALE = DiagnosticStatus.STALE


#: Levels that go to /rosout too, with their severity there.
_LOGGED = {Level.WARN: Log.WARN, Level.ERROR: Log.ERROR}
#: Timeout for the delivery of a node's last log record, wall time, s.
_LOG_TIMEOUT = 0.2


def folded(text: str) -> str:
    """Fold a text into one line."""
    return " ".join(text.split())


#: Prefix of the hardware id of reports on a flight.
FLIGHT_PREFIX = "flight:"


def hardware_id(flight_id: int) -> str:
    """Return the hardware id of reports on a flight; empty without a flight."""
    return FLIGHT_PREFIX + id_text(flight_id) if flight_id else ""


def of_another_flight(status: DiagnosticStatus, flight_id: int) -> bool:
    """Return whether a report names a flight other than ``flight_id``."""
    return bool(
        status.hardware_id.startswith(FLIGHT_PREFIX)
        and status.hardware_id != hardware_id(flight_id)
    )


def facts(values: Mapping[str, object]) -> list[KeyValue]:
    """Return the facts of a message; each value is written with str()."""
    return [KeyValue(key=key, value=str(value)) for key, value in values.items()]


class Diagnostics:
    """Publish a node's reports; each report is an array with one status.

    The status name is the node's full name without the leading slash (`ares/recorder`), the
    hardware id is `flight:` and the identity of the flight once there is one. Warnings and errors
    are log records on /rosout too, but not on the console: the process that starts the node shows
    them in its own way.
    """

    def __init__(self, node: Node, flight_id: Callable[[], int] = lambda: 0) -> None:
        """Create the publishers.

        Args:
            node: that reports.
            flight_id: returns the flight of the node; 0 for none.
        """
        self._node = node
        self._flight_id = flight_id
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, DIAGNOSTIC)
        self._log = node.create_publisher(Log, LOG, LOG_QOS)

    def report(
        self, level: Level, message: str, stamp_ns: int, values: Mapping[str, object] | None = None
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
            values=facts(values or {}),
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

    def log_last_error(self, message: str) -> None:
        """Log an error on /rosout and wait for its delivery, before the node ends."""
        self.log(Level.ERROR, message)
        self._log.wait_for_all_acked(Duration(seconds=_LOG_TIMEOUT))


def number_of(said: Mapping[str, str], key: str) -> float | None:
    """Return a finite number among the facts of `timing`, or None."""
    try:
        value = float(said.get(key, ""))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def pace_message(
    node: Node, flight_id: int, pace: float, paused: bool, more: Mapping[str, object]
) -> DiagnosticStatus:
    """Build the message on a flight's pace for the topic TIMING.

    Args:
        node: with the parameters `pace` and `paused`.
        flight_id: the flight.
        pace: real-time factor; 0: as fast as possible.
        paused: the flight pauses.
        more: further facts.
    """
    name = node.get_fully_qualified_name()
    return timing(node, flight_id, {PACE: pace, PAUSED: paused, NODE: name, **more})


def timing(node: Node, flight_id: int, values: Mapping[str, object]) -> DiagnosticStatus:
    """Build a message of wall-clock facts for the topic TIMING.

    Args:
        node: that publishes it.
        flight_id: of the node.
        values: facts; each is written with str().
    """
    return Timing(name=node.get_name(), hardware_id=hardware_id(flight_id), values=facts(values))
