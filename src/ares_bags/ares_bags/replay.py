# SPDX-License-Identifier: Apache-2.0
"""Publish a bag again: its messages as recorded, with /clock."""

# mypy: allow-untyped-calls
# rclpy's functions have no types

import os
import re
import signal
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from types import FrameType, MappingProxyType

import rclpy
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from ares_bags.errors import BagError
from ares_bags.playback import Playback, keys
from ares_bags.reader import Bag, BagTopic, open_bag
from ares_bags.remote import remote
from ares_bags.schema import type_hash
from ares_bags.types import check_installed, message_class
from ares_node.qos import CLOCK, CLOCK_QOS, TIMING, VEHICLE_STATE
from ares_node.security import (
    SecurityError,
    check_security,
    enclave_arguments,
    stay_on_this_machine,
)
from ares_node.time import NANOSECONDS, stamp_from_ns

#: Messages between two waits for acknowledgement; below the publishers' depth.
ACKNOWLEDGE_EVERY = 500
ACKNOWLEDGE_TIMEOUT_S = 5.0
#: Interval of checks for a stop meanwhile: the command line must end cleanly within 1 s.
ACKNOWLEDGE_SLICE = Duration(seconds=0.05)
DEPTH = 1000
#: Wall time in s to wait for expected readers, whose process may still be starting.
EXPECTED_READERS_S = 20.0

#: Longest full name of a topic that the middleware accepts, characters.
LONGEST_NAME = 247
_NAMESPACE = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*/?", re.ASCII)


@dataclass
class Replay:
    """Hold the result of a replay.

    Attributes:
        counts: number of messages by published topic.
        loops: number of repetitions after the first pass.
        complete: False if it was stopped before the end.
        wall_s: wall time from the first to the last message, s.
    """

    counts: dict[str, int] = field(default_factory=dict)
    loops: int = 0
    complete: bool = True
    wall_s: float = 0.0


@dataclass(frozen=True)
class Extract:
    """Select the part of a bag to publish.

    Attributes:
        topics: names, full or their ends; None: all whose types are installed, except /clock,
            which is generated.
        start_s: first flight time, s; None: the first message.
        end_s: last flight time, s, inclusive; None: the last message.
        loop: start again at the end.
        again: gets a line at each repetition.
    """

    topics: Sequence[str] | None = None
    start_s: float | None = None
    end_s: float | None = None
    loop: bool = False
    again: Callable[[str], None] = lambda _line: None

    @property
    def start_ns(self) -> int:
        """Return the first flight time, ns."""
        return 0 if self.start_s is None else round(self.start_s * NANOSECONDS)

    @property
    def end_ns(self) -> int | None:
        """Return the last flight time, ns; None: no limit."""
        return None if self.end_s is None else round(self.end_s * NANOSECONDS)

    def names(self, bag: Bag) -> list[str]:
        """Return the full names of the topics.

        Raises:
            BagError: a requested topic is missing, or cannot be published here.
        """
        if self.topics is not None:
            names = [bag.name_of(topic) for topic in self.topics]
        else:
            names = [name for name in bag.topics if name != CLOCK and _known(bag.topics[name])]
            if not names:
                raise BagError(f"bag {bag.path}: no topic in it is of a type that is installed")
        for name in names:
            check_installed(bag, bag.topics[name])
        return names

    def check(self, bag: Bag) -> None:
        """Read everything to be published: damage must be found before the first message goes out.

        Raises:
            BagError: the bag is damaged, or holds no message of the extract.
        """
        count = 0
        for _ in bag.raw_messages(self.names(bag), self.start_ns, self.end_ns):
            count += 1
        if not count:
            begin, end = bag.start_ns / NANOSECONDS, bag.end_ns / NANOSECONDS
            raise BagError(
                f"bag {bag.path} has no message to publish between start and end: it holds "
                f"{begin:.3f} to {end:.3f} s"
            )


def _known(topic: BagTopic) -> bool:
    try:
        type_hash(topic.type_name)
    except BagError:
        return False
    return True


def _publisher(node: Node, topic: BagTopic, full_name: str) -> Publisher:
    return node.create_publisher(message_class(topic.type_name), full_name, _offered(topic))


def _offered(topic: BagTopic) -> QoSProfile:
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE
    )
    if topic.qos and all(qos.durability == "transient_local" for qos in topic.qos):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile


def replay(
    bag: Bag,
    context: Context,
    *,
    playback: Playback | None = None,
    extract: Extract | None = None,
    namespace: str = "",
    wait_for_readers_s: float = 1.0,
    expected: Collection[str] = (),
    facts: Mapping[str, object] = MappingProxyType({}),
    stopped: Callable[[], bool] = lambda: False,
) -> Replay:
    """Publish a bag's messages in order of flight time, with /clock.

    Messages are published byte for byte; messages of equal time in recorded order. /clock
    carries the flight time and precedes the messages of that time.

    Args:
        bag: the bag.
        context: an initialized context.
        playback: rate, and control while the replay runs; default: real time.
        extract: part of the bag; default: all of it, once.
        namespace: prefix of every topic name (`/again` + `/ares/nav_state`).
        wait_for_readers_s: wall time in s to wait at most until every topic has a reader;
            messages published before a reader is discovered do not reach it.
        expected: ends of topic names whose readers are expected: wait for these up to
            EXPECTED_READERS_S.
        facts: published on the topic TIMING after the last message of the bag.
        stopped: polled between messages; True ends the replay.

    Raises:
        BagError: unknown topic, a type that is missing here or of another version, no message
            in the requested interval, or the bag is damaged.
        ValueError: the namespace is invalid.
    """
    extract = extract or Extract()
    names = extract.names(bag)
    full_names = {name: _joined(namespace, name) for name in names}
    node = Node(f"replay_{os.getpid()}", context=context, use_global_arguments=False)
    playback = playback or Playback()
    try:
        publishers = {
            name: _publisher(node, bag.topics[name], full_name)
            for name, full_name in full_names.items()
        }
        clock = node.create_publisher(Clock, CLOCK, CLOCK_QOS)
        awaited = [publishers[name] for name in names if name.rsplit("/", 1)[-1] in expected]
        _wait_for_readers(awaited, EXPECTED_READERS_S, stopped)
        _wait_for_readers(publishers.values(), wait_for_readers_s, stopped)
        run = _Run(bag, extract, publishers, clock, playback, stopped)
        with remote(node, playback, _timing_topic(full_names), _flight_of(bag)) as tell:
            return run.publish(lambda: tell(facts) if facts else None)
    finally:
        node.destroy_node()


def _joined(namespace: str, name: str) -> str:
    if namespace and not _NAMESPACE.fullmatch(namespace):
        raise ValueError(
            f"namespace is {namespace!r}; expected names of letters, digits and _, none of them "
            "beginning with a digit, with one / between two"
        )
    prefix = namespace.strip("/")
    full = f"/{prefix}{name}" if prefix else name
    if len(full) > LONGEST_NAME:
        raise ValueError(
            f"topic {full!r} has {len(full)} characters; expected at most {LONGEST_NAME}"
        )
    return full


def _flight_of(bag: Bag) -> int:
    """Return the identity of the flight in a bag; 0 if unknown."""
    try:
        return int(bag.custom_data["flight_id"], 16)
    except (KeyError, ValueError):
        return 0


def _timing_topic(full_names: dict[str, str]) -> str:
    """Return the name of topic TIMING in the namespace of the published flight."""
    states = [full for full in full_names.values() if full.endswith(f"/{VEHICLE_STATE}")]
    home = states[0].removesuffix(VEHICLE_STATE) if states else "/"
    return f"{home}{TIMING}"


def _wait_for_readers(
    publishers: Iterable[Publisher], seconds: float, stopped: Callable[[], bool]
) -> None:
    deadline = time.monotonic() + seconds
    waiting = list(publishers)
    while waiting and time.monotonic() < deadline and not stopped():
        time.sleep(0.01)
        waiting = [publisher for publisher in waiting if not publisher.get_subscription_count()]


class _Run:
    """Run one replay: publish the extract as often, and from the time, that is requested."""

    def __init__(
        self,
        bag: Bag,
        extract: Extract,
        publishers: dict[str, Publisher],
        clock: Publisher,
        playback: Playback,
        stopped: Callable[[], bool],
    ) -> None:
        self._bag = bag
        self._extract = extract
        self._publishers = publishers
        self._clock = clock
        self._playback = playback
        self._stopped = stopped
        self._since_acknowledged = 0
        self._result = Replay(counts={each.topic_name: 0 for each in publishers.values()})

    def publish(self, at_the_end: Callable[[], None]) -> Replay:
        """Publish until the end, or until stopped.

        Args:
            at_the_end: called after each pass that reaches the last message of the bag.
        """
        result = self._result
        begin = time.monotonic()
        start = self._extract.start_ns
        while not self._stopped():
            if self._once(start):
                self._catch_up()
                end_ns = self._extract.end_ns
                if end_ns is None or end_ns >= self._bag.end_ns:
                    at_the_end()
                if not self._extract.loop:
                    break
                result.loops += 1
                start = self._extract.start_ns
                self._extract.again(f"loop {result.loops}: the clock goes back")
                self._playback.jump()
            elif (target := self._playback.jump()) is not None:
                start = max(round(target * NANOSECONDS), self._extract.start_ns)
        result.complete = not self._stopped()
        self._catch_up()
        result.wall_s = time.monotonic() - begin
        return result

    def _once(self, start_ns: int) -> bool:
        """Publish from a time, ns; return False if stopped, or if another time was requested."""
        messages = self._bag.raw_messages(self._publishers, start_ns, self._extract.end_ns)
        for log_time, group in groupby(messages, key=lambda entry: entry[1]):
            if not self._playback.wait_until(log_time / NANOSECONDS, self._stopped):
                return False
            self._clock.publish(Clock(clock=stamp_from_ns(log_time)))
            for topic, _, data in group:
                self._send(self._publishers[topic], data)
            self._playback.sent(log_time / NANOSECONDS)
        return True

    def _send(self, publisher: Publisher, data: bytes) -> None:
        publisher.publish(data)
        self._result.counts[publisher.topic_name] += 1
        self._since_acknowledged += 1
        if self._since_acknowledged >= ACKNOWLEDGE_EVERY:
            # a reliable publisher drops messages beyond its depth
            self._catch_up()
            self._since_acknowledged = 0

    def _catch_up(self) -> None:
        """Wait for all acknowledgements, ACKNOWLEDGE_TIMEOUT_S at most, or until stopped."""
        deadline = time.monotonic() + ACKNOWLEDGE_TIMEOUT_S
        for each in (*self._publishers.values(), self._clock):
            while not each.wait_for_all_acked(ACKNOWLEDGE_SLICE) and not self._stopped():
                if time.monotonic() > deadline:
                    return


@contextmanager
def _stop_on_signals() -> Iterator[Callable[[], bool]]:
    asked: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        asked.append(number)

    former = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)


def run_replay(
    path: Path | str,
    *,
    rate: float = 1.0,
    extract: Extract | None = None,
    namespace: str = "",
    expected: Collection[str] = (),
    facts: Mapping[str, object] = MappingProxyType({}),
    then: Callable[[], None] = lambda: None,
) -> int:
    """Replay a bag from the command line, until its end, a key, SIGINT or SIGTERM.

    Call from the main thread.

    Args:
        path: the bag.
        rate: flight seconds per wall second; 0: as fast as the readers acknowledge.
        extract, namespace, expected, facts: see `replay`.
        then: called after a complete replay and its summary.

    Returns:
        Exit status: 0, or 2 with one line on standard error.
    """
    stay_on_this_machine()
    context = Context()
    extract = replace(extract or Extract(), again=print)
    try:
        check_security()
        with _stop_on_signals() as stopped:
            playback = Playback(rate)
            bag = open_bag(path)
            extract.check(bag)
            rclpy.init(
                args=enclave_arguments("replay"),
                context=context,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            with keys(playback, print) as ended:
                result = replay(
                    bag,
                    context,
                    playback=playback,
                    extract=extract,
                    namespace=namespace,
                    expected=expected,
                    facts=facts,
                    stopped=lambda: stopped() or ended(),
                )
    except (BagError, SecurityError, ValueError) as error:
        print(f"replay: {error}", file=sys.stderr)
        return 2
    finally:
        context.try_shutdown()
    end = "" if result.complete else ", stopped before the end"
    total = sum(result.counts.values())
    print(f"published {total} messages of {bag.path} in {result.wall_s:.1f} s{end}")
    if result.complete:
        then()
    return 0
