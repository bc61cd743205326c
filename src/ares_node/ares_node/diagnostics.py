"""One-line reports on /diagnostics, stamped with flight time."""

from collections.abc import Callable, Mapping
from enum import Enum

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ares_node.identity import id_text
from ares_node.qos import DIAGNOSTIC, DIAGNOSTICS
from ares_node.time import stamp_from_ns


class Level(Enum):
    """Severity of a report, by the constants of diagnostic_msgs/DiagnosticStatus."""

    OK = DiagnosticStatus.OK
    WARN = DiagnosticStatus.WARN
    ERROR = DiagnosticStatus.ERROR
    STALE = DiagnosticStatus.STALE


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
    hardware id is `flight:` and the identity of the flight, as soon as there is one.
    """

    def __init__(self, node: Node, flight_id: Callable[[], int] = lambda: 0) -> None:
        """Create the publisher.

        Args:
            node: whose reports these are.
            flight_id: gives the flight that the node takes part in; 0 for none.
        """
        self._flight_id = flight_id
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, DIAGNOSTIC)

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
            message=" ".join(message.split()),
            values=[KeyValue(key=key, value=str(value)) for key, value in (values or {}).items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = stamp_from_ns(stamp_ns)
        self._publisher.publish(array)
