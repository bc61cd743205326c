"""Publishing a bag again: the messages as recorded, with the clock that belongs to them."""

# mypy: allow-untyped-calls
# rclpy's functions have no types

import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from types import FrameType

import rclpy
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from ares_bags.errors import BagError
from ares_bags.reader import Bag, BagTopic, open_bag
from ares_bags.schema import type_hash
from ares_bags.types import message_class
from ares_node.qos import CLOCK, CLOCK_QOS
from ares_node.time import stamp_from_ns

#: Messages between two waits for the readers' acknowledgement; below the publishers' depth.
ACKNOWLEDGE_EVERY = 500
ACKNOWLEDGE_TIMEOUT_S = 5.0
DEPTH = 1000
#: Longest nap in s between two looks at the stop request.
NAP = 0.05

#: Characters of a topic's full name that the middleware takes.
LONGEST_NAME = 247
_NAMESPACE = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*/?", re.ASCII)


@dataclass
class Replay:
    """What a replay published.

    Attributes:
        counts: messages by topic as published.
        complete: False if it was stopped before the end.
        wall_s: wall time from the first to the last message, s.
    """

    counts: dict[str, int] = field(default_factory=dict)
    complete: bool = True
    wall_s: float = 0.0


def _offered(topic: BagTopic) -> QoSProfile:
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE
    )
    if topic.qos and all(qos.durability == "transient_local" for qos in topic.qos):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile


def _check_type(bag: Bag, topic: BagTopic) -> None:
    installed = type_hash(topic.type_name)
    if topic.type_hash and topic.type_hash != installed:
        raise BagError(
            f"bag {bag.path}: topic {topic.name} was recorded with another version of "
            f"{topic.type_name} than the one installed here"
        )


def replay(
    bag: Bag,
    context: Context,
    *,
    rate: float = 1.0,
    topics: Iterable[str] | None = None,
    namespace: str = "",
    wait_for_readers_s: float = 1.0,
    stopped: Callable[[], bool] = lambda: False,
) -> Replay:
    """Publish a bag's messages in order of log time, and /clock.

    Messages go out as recorded, byte for byte; messages of the same time in the order in
    which they were recorded. /clock carries the log time and comes before the messages of
    that time.

    Args:
        bag: the bag.
        context: an initialized context.
        rate: flight seconds per wall second; 0 as fast as the readers acknowledge.
        topics: names, short or full; default all.
        namespace: put in front of every topic name (`/again` + `/ares/nav_state`).
        wait_for_readers_s: wall time in s to wait at most until every topic has a reader;
            messages published before a reader is known do not reach it.
        stopped: looked at between messages; True ends the replay.

    Raises:
        BagError: unknown topic, a type that is missing here or of another version, or the
            bag is damaged.
        ValueError: the rate is negative or not finite, or the namespace is none.
    """
    if not 0.0 <= rate < float("inf"):
        raise ValueError(f"rate is {rate}; expected zero or a positive number")
    names = list(bag.topics) if topics is None else [bag.name_of(topic) for topic in topics]
    full_names = {name: _joined(namespace, name) for name in names}
    for name in names:
        _check_type(bag, bag.topics[name])
    node = Node(
        f"replay_{os.getpid()}",
        context=context,
        use_global_arguments=False,
        start_parameter_services=False,
    )
    try:
        publishers = {
            name: node.create_publisher(
                message_class(bag.topics[name].type_name),
                full_name,
                _offered(bag.topics[name]),
            )
            for name, full_name in full_names.items()
        }
        clock = node.create_publisher(Clock, CLOCK, CLOCK_QOS)
        _wait_for_readers(publishers.values(), wait_for_readers_s, stopped)
        return _publish(bag, publishers, clock, rate, stopped)
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


def _wait_for_readers(
    publishers: Iterable[Publisher], seconds: float, stopped: Callable[[], bool]
) -> None:
    deadline = time.monotonic() + seconds
    waiting = list(publishers)
    while waiting and time.monotonic() < deadline and not stopped():
        time.sleep(0.01)
        waiting = [publisher for publisher in waiting if not publisher.get_subscription_count()]


def _publish(
    bag: Bag,
    publishers: dict[str, Publisher],
    clock: Publisher,
    rate: float,
    stopped: Callable[[], bool],
) -> Replay:
    result = Replay(counts={publisher.topic_name: 0 for publisher in publishers.values()})
    limit = Duration(seconds=ACKNOWLEDGE_TIMEOUT_S)
    since_acknowledged = 0
    begin = time.monotonic()
    first: int | None = None
    for log_time, group in groupby(bag.raw_messages(publishers), key=lambda entry: entry[1]):
        if first is None:
            first = log_time
        due = begin + (log_time - first) / 1e9 / rate if rate else begin
        while not stopped() and (left := due - time.monotonic()) > 0.0:
            time.sleep(min(left, NAP))
        if stopped():
            result.complete = False
            break
        clock.publish(Clock(clock=stamp_from_ns(log_time)))
        for topic, _, data in group:
            publisher = publishers[topic]
            publisher.publish(data)
            result.counts[publisher.topic_name] += 1
            since_acknowledged += 1
            if since_acknowledged >= ACKNOWLEDGE_EVERY:
                # a reliable publisher forgets what its depth cannot hold
                for each in publishers.values():
                    each.wait_for_all_acked(limit)
                since_acknowledged = 0
    for each in (*publishers.values(), clock):
        each.wait_for_all_acked(limit)
    result.wall_s = time.monotonic() - begin
    return result


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
    topics: Iterable[str] | None = None,
    namespace: str = "",
    say: Callable[[str], None] = print,
) -> int:
    """Replay a bag from the command line, until its end or until SIGINT or SIGTERM.

    Must be called from the main thread.

    Args:
        path: the bag.
        rate: see `replay`.
        topics: see `replay`.
        namespace: see `replay`.
        say: where the summary goes.

    Returns:
        Exit status: 0, or 2 with one line on standard error.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    try:
        with _stop_on_signals() as stopped:
            bag = open_bag(path)
            # half a flight must not go out before the damage in it is found
            for _ in bag.raw_messages(topics):
                pass
            rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
            result = replay(
                bag, context, rate=rate, topics=topics, namespace=namespace, stopped=stopped
            )
    except (BagError, ValueError) as error:
        print(f"replay: {error}", file=sys.stderr)
        return 2
    finally:
        context.try_shutdown()
    end = "" if result.complete else ", stopped before the end"
    total = sum(result.counts.values())
    say(f"published {total} messages of {bag.path} in {result.wall_s:.1f} s{end}")
    return 0
