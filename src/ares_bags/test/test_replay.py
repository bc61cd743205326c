# SPDX-License-Identifier: Apache-2.0
"""Replay: equal messages in equal order, with the clock, at a rate."""

import itertools
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from ares_bags.compare import differences
from ares_bags.errors import BagError
from ares_bags.playback import Playback
from ares_bags.reader import open_bag
from ares_bags.recorder import RecorderNode
from ares_bags.replay import Extract, replay
from ares_bags.schema import Topic
from ares_bags.writer import BagWriter
from ares_msgs.msg import FlightEvent, NavState
from ares_node.diagnostics import Timing
from ares_node.qos import DIAGNOSTIC, FLIGHT
from ares_node.time import ns_from_stamp
from ares_trials.testing.bags import EVENT, NAV, PERIOD_NS, START_NS, messages, topics, write_bag
from ares_trials.testing.ros import own_words, ros_context_on, spin_until

COUNT = 60


@pytest.fixture
def executor(ros_context: Context) -> Iterator[Executor]:
    executor = EventsExecutor(context=ros_context)
    yield executor
    executor.shutdown()


@pytest.fixture
def listener(ros_context: Context, executor: Executor) -> Iterator[Node]:
    node = Node("listener", context=ros_context)
    executor.add_node(node)
    yield node
    executor.remove_node(node)
    node.destroy_node()


def in_background(executor: Executor, work: Any, arrived: Callable[[], bool] = lambda: True) -> Any:
    """Run `work` in a thread and spin the executor until all its messages have arrived.

    Returns:
        The result of `work`, or its error.
    """
    outcome: list[Any] = []
    over = Event()

    def run() -> None:
        try:
            outcome.append(work())
        except Exception as error:
            outcome.append(error)
        finally:
            over.set()

    thread = Thread(target=run)
    thread.start()
    assert spin_until(executor, over.is_set, timeout=240.0)
    thread.join()
    assert spin_until(executor, arrived, timeout=240.0)
    if isinstance(outcome[0], Exception):
        raise outcome[0]
    return outcome[0]


def test_a_recorded_replay_equals_the_bag(
    executor: Executor, ros_domain: int, ros_context: Context, tmp_path: Path
) -> None:
    original = open_bag(write_bag(tmp_path / "flight", 3000))
    overrides = [Parameter("bag", value=str(tmp_path / "again"))]
    recorder = RecorderNode(context=ros_context, parameter_overrides=overrides)
    executor.add_node(recorder)
    assert recorder.start(), recorder.failure
    with ros_context_on(ros_domain) as other:
        result = in_background(
            executor,
            lambda: replay(original, other, playback=Playback(0.0), wait_for_readers_s=240.0),
            lambda: sum(recorder.message_counts.values()) >= original.message_count,
        )
        recorder.drain_and_close(executor)
    recorder.stop()
    executor.remove_node(recorder)
    recorder.destroy_node()
    again = open_bag(tmp_path / "again")
    assert result.complete
    assert result.counts == {name: topic.count for name, topic in original.topics.items()}
    assert differences(original, again) == []
    assert again.topics[EVENT].qos == original.topics[EVENT].qos


def test_order_and_clock(
    executor: Executor, listener: Node, ros_domain: int, tmp_path: Path
) -> None:
    heard: list[tuple[str, int]] = []
    clocks: list[int] = []
    listener.create_subscription(
        NavState, NAV, lambda m: heard.append((NAV, ns_from_stamp(m.stamp))), FLIGHT
    )
    listener.create_subscription(
        FlightEvent, EVENT, lambda m: heard.append((EVENT, ns_from_stamp(m.stamp))), FLIGHT
    )
    listener.create_subscription(
        Clock, "/clock", lambda m: clocks.append(ns_from_stamp(m.clock)), QoSProfile(depth=1000)
    )
    bag = open_bag(write_bag(tmp_path / "flight", COUNT))
    sent = [(topic, time) for topic, time, _ in messages(COUNT) if topic in (NAV, EVENT)]
    with ros_context_on(ros_domain) as context:
        in_background(
            executor,
            lambda: replay(
                bag,
                context,
                playback=Playback(0.0),
                extract=Extract(["nav_state", EVENT]),
                wait_for_readers_s=240.0,
            ),
            lambda: len(heard) >= len(sent) and len(clocks) >= COUNT,
        )
    for name in (NAV, EVENT):
        assert [entry for entry in heard if entry[0] == name] == [
            entry for entry in sent if entry[0] == name
        ]
    assert clocks == [START_NS + number * PERIOD_NS for number in range(COUNT)]


class NapClock:
    """Advance time by sleeps only, independent of the machine."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)
        self.now += seconds


def test_a_reader_that_is_known_to_come_is_waited_for(
    executor: Executor, listener: Node, ros_domain: int, tmp_path: Path
) -> None:
    """Subscribe after the publishers exist: no message goes out before."""
    heard: list[int] = []
    bag = open_bag(write_bag(tmp_path / "flight", COUNT))

    def come() -> None:
        if listener.count_publishers(NAV) and not listener.count_subscribers(NAV):
            listener.create_subscription(
                NavState, NAV, lambda state: heard.append(state.sequence), FLIGHT
            )

    listener.create_timer(0.5, come)
    with ros_context_on(ros_domain) as context:
        in_background(
            executor,
            lambda: replay(
                bag,
                context,
                playback=Playback(0.0),
                extract=Extract(["nav_state"]),
                wait_for_readers_s=0.0,
                expected=("nav_state", "vehicle_state"),
            ),
            lambda: bool(heard) and heard[-1] == COUNT - 1,
        )
    assert heard == list(range(COUNT))


def test_pace_namespace_and_topics(
    executor: Executor,
    listener: Node,
    ros_domain: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Replay 5.9 s of flight at ten times real time."""
    clock = NapClock()
    monkeypatch.setattr("ares_bags.replay.time", clock)
    monkeypatch.setattr("ares_bags.playback.time", clock)
    due: list[float] = []

    def look() -> bool:
        due.append(clock.now)
        return False

    arrivals: list[NavState] = []
    listener.create_subscription(NavState, "/again/ares/nav_state", arrivals.append, FLIGHT)
    bag = open_bag(write_bag(tmp_path / "flight", COUNT))
    with ros_context_on(ros_domain) as context:
        result = in_background(
            executor,
            lambda: replay(
                bag,
                context,
                playback=Playback(10.0),
                extract=Extract(["nav_state"]),
                namespace="/again/",
                wait_for_readers_s=240.0,
                stopped=look,
            ),
            lambda: len(arrivals) >= COUNT,
        )
    assert result.counts == {"/again/ares/nav_state": COUNT}
    assert [state.sequence for state in arrivals] == list(range(COUNT))
    assert result.wall_s == pytest.approx(0.59)
    begin = clock.now - result.wall_s
    paced = sorted({round(moment - begin, 6) for moment in due if moment > begin - 1e-6})
    assert paced == pytest.approx([0.01 * number for number in range(COUNT)])


@pytest.mark.parametrize(("end_s", "told"), [(None, ["well"]), (157.0, [])])
def test_facts_of_the_end_come_after_the_end_alone(
    executor: Executor,
    listener: Node,
    ros_domain: int,
    tmp_path: Path,
    end_s: float | None,
    told: list[str],
) -> None:
    """Publish facts behind the last message, of a replay that comes to it."""
    heard: list[tuple[str, str]] = []
    listener.create_subscription(NavState, NAV, lambda _: heard.append(("state", "")), FLIGHT)
    listener.create_subscription(
        Timing,
        "/timing",
        lambda m: heard.extend(("fact", item.value) for item in m.values if item.key == "end"),
        DIAGNOSTIC,
    )
    bag = open_bag(write_bag(tmp_path / "flight", COUNT))
    with ros_context_on(ros_domain) as context:
        result = in_background(
            executor,
            lambda: replay(
                bag,
                context,
                playback=Playback(0.0),
                extract=Extract(["nav_state"], end_s=end_s),
                wait_for_readers_s=240.0,
                facts={"end": "well"},
            ),
            lambda: sum(kind == "state" for kind, _ in heard) >= (12 if end_s else COUNT),
        )
        assert result.complete
        assert spin_until(executor, lambda: sum(k == "fact" for k, _ in heard) >= len(told), 60.0)
    assert [value for kind, value in heard if kind == "fact"] == told
    if told:
        assert heard[-1][0] == "fact"


def test_it_can_be_stopped(ros_context: Context, tmp_path: Path) -> None:
    bag = open_bag(write_bag(tmp_path / "flight", COUNT))
    looks = itertools.count()
    result = replay(
        bag,
        ros_context,
        playback=Playback(0.001),
        wait_for_readers_s=0.0,
        stopped=lambda: next(looks) > 5,
    )
    assert not result.complete
    assert sum(result.counts.values()) == 3


def test_what_cannot_be_replayed(ros_context: Context, tmp_path: Path) -> None:
    bag = open_bag(write_bag(tmp_path / "flight", 3))
    with pytest.raises(BagError, match="has no single topic 'nav'; expected of: /ares/"):
        replay(bag, ros_context, extract=Extract(["nav"]))
    for rate in (-1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="expected zero or a positive number"):
            Playback(rate)
    known = topics()[0]
    for name, topic, text in (
        (
            "version",
            Topic(NAV, known.type_name, known.definition, "RIHS01_" + "0" * 64),
            "topic /ares/nav_state was recorded with another version of ares_msgs/msg/NavState",
        ),
        (
            "missing",
            Topic(NAV, "no_such_msgs/msg/X", known.definition, "RIHS01_" + "0" * 64),
            "package no_such_msgs is not installed",
        ),
    ):
        with BagWriter(tmp_path / name) as writer:
            writer.add_topic(topic)
            writer.write(NAV, 1, messages(1)[0][2])
        with pytest.raises(BagError, match=text):
            replay(open_bag(tmp_path / name), ros_context, extract=Extract(["nav_state"]))


RUN = "import sys; from ares_bags.replay import run_replay; "


def run(environment: dict[str, str], call: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", RUN + call],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.trial
def test_as_a_process(
    executor: Executor, listener: Node, ros_environment: dict[str, str], tmp_path: Path
) -> None:
    path = write_bag(tmp_path / "flight", COUNT)
    process = run(ros_environment, f"sys.exit(run_replay({str(path)!r}, rate=0.0))")
    out, err = process.communicate()
    assert (process.returncode, own_words(err)) == (0, "")
    assert out.startswith(f"published {len(messages(COUNT))} messages of {path} in ")

    heard: list[NavState] = []
    listener.create_subscription(NavState, NAV, heard.append, FLIGHT)
    # ten minutes of replay: it is certainly not over
    long = write_bag(tmp_path / "long", 10 * COUNT)
    process = run(ros_environment, f"sys.exit(run_replay({str(long)!r}, rate=0.1))")
    assert spin_until(executor, lambda: bool(heard), timeout=240.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert (process.returncode, own_words(err)) == (0, "")
    assert out.endswith("s, stopped before the end\n")

    process = run(ros_environment, f"sys.exit(run_replay({str(tmp_path / 'none')!r}))")
    _, err = process.communicate()
    refused = f"replay: bag {tmp_path / 'none'} does not exist\n"
    assert (process.returncode, own_words(err)) == (2, refused)
