# SPDX-License-Identifier: Apache-2.0
"""Kill a recorder at a random moment and check what its bag must still hold.

For tests and benchmarks only.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.node import Node

from ares_bags.errors import BagError
from ares_bags.reader import open_bag
from ares_bags.repair import repair
from ares_msgs.msg import FlightEvent, NavState
from ares_node.qos import DIAGNOSTIC, EVENTS, FLIGHT, NAMESPACE
from ares_trials.testing.bags import (
    DIAGNOSTICS,
    EVENT,
    NAV,
    PERIOD_NS,
    START_NS,
    flight_event,
    nav_state,
    report,
)

#: Navigation states per second: in real time, ten times faster, in lock-step.
RATES = (10.0, 100.0, 1500.0)
#: Age in s at the kill from which a message must have been saved.
PROMISE = 1.0
#: Longest recording, s; largest delay of the kill after the file has reached its size, s.
LONGEST = 6.0
LATER = 0.6
#: Approximate bytes of the file per navigation state; more at low rates.
_BYTES_PER_STATE = 60.0
#: Wall time in s within which the recorder must start.
_PATIENCE = 120.0


@dataclass(frozen=True)
class Killed:
    """Hold the result of one trial.

    Attributes:
        size: size of the file at the kill, bytes.
        published: messages sent before the kill.
        due: messages sent more than PROMISE before the kill.
        saved: messages in the repaired bag.
        missing: messages that were due and are not in the repaired bag.
        youngest_missing_s: time in s from the oldest unsaved message to the kill; 0 if all
            messages are saved.
    """

    size: int
    published: int
    due: int
    saved: int
    missing: int
    youngest_missing_s: float


class _Source(Node):
    """Publish a synthetic flight and record when each message was sent."""

    def __init__(self, context: Context) -> None:
        super().__init__("source", namespace=NAMESPACE, context=context)
        self._nav = self.create_publisher(NavState, NAV, FLIGHT)
        self._event = self.create_publisher(FlightEvent, EVENT, EVENTS)
        self._report = self.create_publisher(DiagnosticArray, DIAGNOSTICS, DIAGNOSTIC)
        #: wall time in s of each message's publication, by topic and log time in ns
        self.sent: dict[tuple[str, int], float] = {}
        self._count = 0

    def wait_for_recorder(self) -> None:
        deadline = time.monotonic() + _PATIENCE
        outputs = (self._nav, self._event, self._report)
        while not all(output.get_subscription_count() for output in outputs):
            if time.monotonic() > deadline:
                raise TimeoutError("the recorder did not come")
            time.sleep(0.01)

    def publish_up_to(self, count: int) -> None:
        while self._count < count:
            number = self._count
            time_ns = START_NS + number * PERIOD_NS
            topics = [NAV]
            self._nav.publish(nav_state(number))
            if number % 10 == 0:
                self._event.publish(flight_event(number // 10))
                topics.append(EVENT)
            if number % 7 == 0:
                self._report.publish(report(number))
                topics.append(DIAGNOSTICS)
            now = time.monotonic()
            self.sent |= {(topic, time_ns): now for topic in topics}
            self._count += 1


def killed_recording(
    context: Context, environment: Mapping[str, str], folder: Path, random: Random
) -> Killed:
    """Record at a random rate, kill the recorder at a random file size, repair the bag and compare.

    Args:
        context: of the publisher.
        environment: of the recorder's process; on the same domain.
        folder: folder for the bags; must not hold any.
        random: draws the rate, the file size and the delay of the kill.
    """
    rate = random.choice(RATES)
    growth = random.uniform(0.0, rate * LONGEST * _BYTES_PER_STATE)
    later = random.uniform(0.0, LATER)
    bag = folder / "flight"
    source = _Source(context)
    process = subprocess.Popen(
        [sys.executable, "-m", "ares_bags", "--ros-args", "-p", f"bag:={json.dumps(str(bag))}"],
        env=dict(environment),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        source.wait_for_recorder()
        _publish(source, rate, bag / f"{bag.name}_0.mcap", growth, later)
        killed_at = time.monotonic()
    finally:
        process.kill()
        process.wait()
        source.destroy_node()
    return _compare(bag, source.sent, killed_at)


def _publish(source: _Source, rate: float, file: Path, growth: float, later: float) -> None:
    """Publish at `rate` until the file has grown by `growth` bytes, then for `later` s more."""
    begun = now = time.monotonic()
    wanted = file.stat().st_size + growth
    end = begun + LONGEST
    grown = False
    while now < end:
        source.publish_up_to(int((now - begun) * rate))
        if not grown and os.path.getsize(file) >= wanted:  # noqa: PTH202, some thousand times
            grown = True
            end = min(end, now + later)
        time.sleep(0.0005)
        now = time.monotonic()


def _compare(bag: Path, sent: Mapping[tuple[str, int], float], killed_at: float) -> Killed:
    size = (bag / f"{bag.name}_0.mcap").stat().st_size
    try:
        found = open_bag(repair(bag).path)
        saved = {(topic, time_ns) for topic, time_ns, _ in found.raw_messages()}
    except BagError as error:
        if "no message can be saved" not in str(error):
            raise
        saved = set()
    lost = {message: at for message, at in sent.items() if message not in saved}
    due = [message for message, at in sent.items() if at < killed_at - PROMISE]
    return Killed(
        size,
        len(sent),
        len(due),
        len(saved),
        sum(message in lost for message in due),
        round(max((killed_at - at for at in lost.values()), default=0.0), 3),
    )
