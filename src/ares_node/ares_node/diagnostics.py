"""One-line reports on /diagnostics, stamped with flight time."""

from collections.abc import Mapping
from enum import Enum

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ares_node.qos import DIAGNOSTIC, DIAGNOSTICS
from ares_node.time import stamp_from_ns


class Level(Enum):
    """Severity of a report, by the constants of diagnostic_msgs/DiagnosticStatus."""

    OK = DiagnosticStatus.OK
    WARN = DiagnosticStatus.WARN
    ERROR = DiagnosticStatus.ERROR
    STALE = DiagnosticStatus.STALE


class Diagnostics:
    """Publisher of a node's reports; each report is one array with one status.

    The status name is the node's full name without the leading slash (`ares/recorder`).
    """

    def __init__(self, node: Node) -> None:
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
            message=" ".join(message.split()),
            values=[KeyValue(key=key, value=str(value)) for key, value in (values or {}).items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = stamp_from_ns(stamp_ns)
        self._publisher.publish(array)
