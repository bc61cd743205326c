# SPDX-License-Identifier: Apache-2.0
"""Synthetic flights for tests only."""

from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message

from ares_bags.errors import BagError
from ares_bags.files import find_file
from ares_bags.schema import Qos, Topic
from ares_bags.verify import Examination
from ares_bags.writer import BagWriter
from ares_msgs.msg import FlightEvent, NavState
from ares_node.time import stamp_from_ns

START_NS = 155_900_000_000
PERIOD_NS = 100_000_000

NAV = "/ares/nav_state"
EVENT = "/ares/flight_event"
DIAGNOSTICS = "/diagnostics"

FLIGHT_ID = 0x1234

CUSTOM_DATA = {"mission": "ares_v", "law": "peg", "seed": "7"}


def nav_state(sequence: int) -> NavState:
    """Return navigation state number `sequence`; every field differs from the next one's."""
    return NavState(
        flight_id=FLIGHT_ID,
        stamp=stamp_from_ns(START_NS + sequence * PERIOD_NS),
        sequence=sequence,
        position=[6.5e6 + sequence, -1.25 * sequence, 0.1 * sequence],
        velocity=[7e3, -sequence / 3.0, 1e-9 * sequence],
        mass=1.5e6 - 1234.5 * sequence,
        sensed_delta_v=[0.0, -0.0, 1.0 * sequence],
        heating_rate=float("nan") if sequence % 2 else 1135.0,
        arc=sequence % 3,
        arc_start_time=155.9,
        jettisoned=sequence % 2,
    )


def flight_event(number: int) -> FlightEvent:
    """Return event number `number`."""
    stamp = START_NS + number * 10 * PERIOD_NS
    return FlightEvent(
        stamp=stamp_from_ns(stamp),
        flight_id=FLIGHT_ID,
        time=stamp / 1e9,
        type=number % 8 + 1,
        mass=1000.0 - number,
    )


def report(number: int) -> DiagnosticArray:
    """Return a diagnostic report with texts and values."""
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN,
        name="ares/test",
        message=f"line {number}",
        values=[KeyValue(key="n", value=str(number))] * (number % 3),
    )
    array = DiagnosticArray(status=[status])
    array.header.stamp = stamp_from_ns(START_NS + number * PERIOD_NS)
    return array


def topics() -> list[Topic]:
    """Return the topics of a synthetic bag."""
    kept = Qos(durability="transient_local")
    return [
        Topic.installed(NAV, "ares_msgs/msg/NavState", (Qos(),)),
        Topic.installed(EVENT, "ares_msgs/msg/FlightEvent", (kept,)),
        Topic.installed(DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", (Qos(), kept)),
    ]


@cache
def messages(count: int) -> tuple[tuple[str, int, bytes], ...]:
    """Return topic, log time in ns and CDR of a synthetic flight of `count` navigation states.

    The bytes are equal within a process; the padding in CDR differs between processes.
    """
    return tuple(_messages(count))


def _messages(count: int) -> Iterator[tuple[str, int, bytes]]:
    for number in range(count):
        time = START_NS + number * PERIOD_NS
        yield NAV, time, serialize_message(nav_state(number))
        if number % 10 == 0:
            yield EVENT, time, serialize_message(flight_event(number // 10))
        if number % 7 == 0:
            yield DIAGNOSTICS, time, serialize_message(report(number))


def write_bag(path: Path, count: int = 100, flush_every: int = 20) -> Path:
    """Write a complete bag with several chunks; return its path."""
    with BagWriter(path, CUSTOM_DATA, flush_interval_s=1e9) as writer:
        for entry in topics():
            writer.add_topic(entry)
        for number, (topic, time, data) in enumerate(messages(count)):
            writer.write(topic, time, data)
            if number % flush_every == flush_every - 1:
                writer.flush()
    return path


def recorded_so_far(bag: Path) -> Counter[str]:
    """Count the messages by topic in a bag that is being recorded, or about to be."""
    try:
        return Counter(Examination(bag, find_file(bag), decode=False).message_counts)
    except BagError:
        return Counter()
