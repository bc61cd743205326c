# SPDX-License-Identifier: Apache-2.0
"""The recorder node: published messages are in the bag, however the recording ends."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rosbags.rosbag2 import Reader

from ares_bags import recorder as recorder_module
from ares_bags.compare import differences
from ares_bags.reader import LOG_TIME, open_bag
from ares_bags.recorder import TYPES, RecorderNode, qos_of
from ares_bags.repair import repair
from ares_bags.schema import type_hash
from ares_bags.verify import verify
from ares_bags.writer import DATE_KEY, MACHINE_KEY
from ares_msgs.msg import FlightEvent, GuidanceStatus, NavState
from ares_node.diagnostics import hardware_id
from ares_node.identity import id_text
from ares_node.membership import Membership, Role, State
from ares_node.qos import DIAGNOSTIC, EVENTS, FLIGHT
from ares_trials.testing.bags import (
    DIAGNOSTICS,
    EVENT,
    FLIGHT_ID,
    NAV,
    START_NS,
    flight_event,
    nav_state,
    recorded_so_far,
    report,
)
from ares_trials.testing.ros import own_words, spin_until
from ares_trials.testing.samples import one_in

#: s; only a test that fails waits so long.
PATIENCE_S = 120


@dataclass
class Source:
    """Publish a synthetic flight and listen to /diagnostics."""

    context: Context
    node: Node
    executor: Executor
    nav: Publisher
    event: Publisher
    diagnostics: Publisher
    heard: list[DiagnosticArray] = field(default_factory=list)

    def publish(self, first: int, count: int) -> None:
        for number in range(first, first + count):
            self.nav.publish(nav_state(number))
            if number % 10 == 0:
                self.event.publish(flight_event(number // 10))
            if number % 7 == 0:
                self.diagnostics.publish(report(number))
        self.wait_for_delivery()

    def wait_for_delivery(self) -> None:
        """Wait until the messages published are in the queues of all subscriptions."""
        for publisher in (self.nav, self.event, self.diagnostics):
            assert publisher.wait_for_all_acked(Duration(seconds=PATIENCE_S))

    def wait_for_recorder(self) -> None:
        outputs = (self.nav, self.event, self.diagnostics)
        # it listens to its own diagnostics
        wanted = (1, 1, 2)
        assert spin_until(
            self.executor,
            lambda: all(
                output.get_subscription_count() >= count
                for output, count in zip(outputs, wanted, strict=True)
            ),
            PATIENCE_S,
        )


def expected_counts(count: int) -> dict[str, int]:
    return {NAV: count, EVENT: -(-count // 10), DIAGNOSTICS: -(-count // 7)}


@pytest.fixture
def source(ros_context: Context) -> Iterator[Source]:
    node = Node("source", namespace="ares", context=ros_context)
    executor = EventsExecutor(context=ros_context)
    executor.add_node(node)
    source = Source(
        ros_context,
        node,
        executor,
        node.create_publisher(NavState, "nav_state", FLIGHT),
        node.create_publisher(FlightEvent, "flight_event", EVENTS),
        node.create_publisher(DiagnosticArray, "/diagnostics", DIAGNOSTIC),
    )
    node.create_subscription(DiagnosticArray, "/diagnostics", source.heard.append, 100)
    yield source
    executor.shutdown()
    node.destroy_node()


@pytest.fixture
def recorders(source: Source) -> Iterator[Any]:
    made: list[RecorderNode] = []

    def make(**values: object) -> RecorderNode:
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        node = RecorderNode(context=source.context, parameter_overrides=overrides)
        source.executor.add_node(node)
        made.append(node)
        return node

    yield make
    for node in made:
        node.stop()
        source.executor.remove_node(node)
        node.destroy_node()


def test_what_is_published_is_in_the_bag(source: Source, recorders: Any, tmp_path: Path) -> None:
    path = tmp_path / "flight"
    recorder = recorders(bag=str(path), mission="ares_v", law="peg", seed=7)
    # flight_event is kept for late readers: this one comes before the recorder
    source.event.publish(flight_event(99))
    assert recorder.start(), recorder.failure
    source.wait_for_recorder()
    source.publish(0, 200)
    recorder.drain_and_close(source.executor)
    counts = expected_counts(200)
    counts[EVENT] += 1
    assert recorder.message_counts == counts
    assert (recorder.error, recorder.lost, recorder.exit_code) == (None, 0, 0)

    bag = open_bag(path)
    assert {name: topic.count for name, topic in bag.topics.items()} == counts
    made = {key: bag.custom_data[key] for key in (DATE_KEY, MACHINE_KEY)}
    assert abs(datetime.now(UTC) - datetime.fromisoformat(made[DATE_KEY])) < timedelta(hours=1)
    assert made[MACHINE_KEY].endswith(f" {os.cpu_count()} cores")
    assert bag.custom_data == made | {
        "mission": "ares_v",
        "law": "peg",
        "seed": "7",
        "flight_id": id_text(FLIGHT_ID),
    }
    columns = bag.columns("nav_state")
    assert columns["sequence"].tolist() == list(range(200))
    assert (columns[LOG_TIME] == columns["stamp"]).all()
    assert columns["position"].tolist() == [list(nav_state(n).position) for n in range(200)]
    assert [message.status[0].message for _, message in bag.messages("diagnostics")] == [
        f"line {number}" for number in range(0, 200, 7)
    ]
    for name, topic in bag.topics.items():
        assert topic.type_hash == type_hash(topic.type_name)
        assert [qos.reliability for qos in topic.qos] == ["reliable"]
        kept = "transient_local" if name == EVENT else "volatile"
        assert [qos.durability for qos in topic.qos] == [kept]
    with Reader(path) as reader:
        assert sum(1 for _ in reader.messages()) == sum(counts.values())


def test_qos_is_that_of_the_publisher(source: Source, recorders: Any, tmp_path: Path) -> None:
    """Publish with another profile: the bag has the discovered one, not the requested one."""
    other = source.node.create_publisher(
        NavState, "nav_state", QoSProfile(depth=3, durability=EVENTS.durability)
    )
    recorder = recorders(bag=str(tmp_path / "flight"), topics=["nav_state"])
    assert recorder.start()
    assert spin_until(source.executor, lambda: other.get_subscription_count() == 1, PATIENCE_S)
    other.publish(nav_state(0))
    assert other.wait_for_all_acked(Duration(seconds=PATIENCE_S))
    recorder.drain_and_close(source.executor)
    topic = open_bag(tmp_path / "flight").topics[NAV]
    assert sorted(qos.durability for qos in topic.qos) == ["transient_local", "volatile"]
    endless = {qos.deadline_ns for qos in topic.qos} | {qos.lifespan_ns for qos in topic.qos}
    assert endless == {2**63 - 1}
    assert qos_of(EVENTS).durability == "transient_local"


def test_times_of_other_clocks_and_before_zero(
    source: Source, recorders: Any, tmp_path: Path
) -> None:
    recorder = recorders(bag=str(tmp_path / "flight"))
    assert recorder.start()
    source.wait_for_recorder()
    source.nav.publish(nav_state(5))
    assert spin_until(source.executor, lambda: recorder.message_counts.get(NAV) == 1, PATIENCE_S)
    for sec in (1_790_000_000, -3):
        foreign = report(0)
        foreign.header.stamp.sec = sec
        source.diagnostics.publish(foreign)
    source.wait_for_delivery()
    recorder.drain_and_close(source.executor)
    bag = open_bag(tmp_path / "flight")
    flight_time = START_NS + 5 * 10**8
    assert bag.columns("diagnostics")[LOG_TIME].tolist() == [flight_time] * 2
    assert (bag.start_ns, bag.end_ns) == (flight_time, flight_time)


def test_deactivation_drains_and_closes(source: Source, recorders: Any, tmp_path: Path) -> None:
    recorder = recorders(bag=str(tmp_path / "flight"))
    assert recorder.start()
    source.wait_for_recorder()
    source.publish(0, 500)
    # as from a lifecycle service call: nothing spins meanwhile
    recorder.trigger_deactivate()
    assert recorder.message_counts == expected_counts(500)
    assert open_bag(tmp_path / "flight").message_count == sum(expected_counts(500).values())
    recorder.trigger_activate()
    assert recorder.failure == (
        f"bag {tmp_path / 'flight'} is closed; clean up, set parameter bag to a new folder and "
        "configure"
    )


def test_never_activated(recorders: Any, tmp_path: Path) -> None:
    recorder = recorders(bag=str(tmp_path / "flight"))
    recorder.trigger_configure()
    recorder.stop()
    # a flight that never began leaves no bag
    assert not (tmp_path / "flight").exists()


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({}, "parameter bag is ''; expected the folder of a new bag"),
        ({"bag": "{tmp}"}, "bag {tmp} exists already; expected a new name"),
        ({"bag": "{tmp}/file/bag"}, "bag {tmp}/file/bag cannot be created: "),
        ({"bag": "{tmp}/a", "topics": ["nav"]}, "parameter topics has 'nav'; expected one of nav_"),
        (
            {"bag": "{tmp}/b", "topics": ["x:no_msgs/msg/X"]},
            "parameter topics has 'x:no_msgs/msg/X': message type no_msgs/msg/X is not installed",
        ),
        (
            {"bag": "{tmp}/c", "topics": ["x:std_msgs/msg/String"]},
            "parameter topics has 'x:std_msgs/msg/String'; expected a type that begins with a s",
        ),
    ],
)
def test_recordings_that_cannot_start(
    recorders: Any, tmp_path: Path, values: dict[str, Any], line: str
) -> None:
    (tmp_path / "file").touch()
    if "bag" in values:
        values = {**values, "bag": values["bag"].format(tmp=tmp_path)}
    recorder = recorders(**values)
    assert not recorder.start()
    assert recorder.failure.startswith(line.format(tmp=tmp_path))


def test_full_disk_is_reported_once_and_the_flight_goes_on(
    source: Source, recorders: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorder = recorders(bag=str(tmp_path / "flight"), flush_interval_s=0.01)
    assert recorder.start()
    source.wait_for_recorder()
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, former[1]))
    try:
        for first in range(0, 2000, 50):
            source.publish(first, 50)
            taken = first + 50
            assert spin_until(
                source.executor,
                lambda: recorder.error or recorder.message_counts.get(NAV) == taken,  # noqa: B023
                PATIENCE_S,
            )
            if recorder.error:
                break
        assert recorder.error is not None
        source.publish(5000, 70)
        assert spin_until(source.executor, lambda: recorder.lost > 70, PATIENCE_S)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)
    recorder.drain_and_close(source.executor)
    assert recorder.exit_code == 1
    bag = open_bag(tmp_path / "flight")
    counts = {name: topic.count for name, topic in bag.topics.items() if topic.count}
    assert counts == recorder.message_counts
    assert counts[NAV] > 50
    assert bag.columns(NAV)["sequence"].tolist() == list(range(counts[NAV]))
    reports = [
        array
        for array in source.heard
        if array.status[0].name == "ares/recorder" and array.status[0].level == b"\x02"
    ]
    assert [array.status[0].message for array in reports] == [recorder.error]
    assert reports[0].header.stamp.sec >= START_NS // 10**9
    error_output = capsys.readouterr().err
    assert error_output == f"recorder: {recorder.error}\n"
    assert "is incomplete: File too large; " in error_output


def wait_until_saved(bag: Path, count: int) -> None:
    """Wait until the file of a bag being recorded holds `count` navigation states."""
    while recorded_so_far(bag)[NAV] < count:
        time.sleep(0.02)


def start_process(
    environment: dict[str, str], path: Path, *more: str, limit: int | None = None
) -> "subprocess.Popen[str]":
    values = [f"bag:={json.dumps(str(path))}", *more]
    arguments = [item for value in values for item in ("-p", value)]
    process = subprocess.Popen(
        [sys.executable, "-m", "ares_bags", "--ros-args", *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    if limit is not None:
        limits = (limit, resource.RLIM_INFINITY)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, limits)
    return process


@pytest.mark.parametrize("number", one_in(2, [signal.SIGTERM, signal.SIGINT]))
def test_a_signal_right_after_the_last_message_loses_nothing(
    source: Source, ros_environment: dict[str, str], tmp_path: Path, number: signal.Signals
) -> None:
    process = start_process(ros_environment, tmp_path / "flight", "mission:=ares_v")
    try:
        source.wait_for_recorder()
        source.publish(0, 900)
        process.send_signal(number)
        out, err = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    assert (process.returncode, out, own_words(err)) == (0, "", "")
    bag = open_bag(tmp_path / "flight")
    assert {name: topic.count for name, topic in bag.topics.items()} == expected_counts(900)


def test_a_killed_process_leaves_a_bag_that_can_be_repaired(
    source: Source, ros_environment: dict[str, str], tmp_path: Path
) -> None:
    process = start_process(ros_environment, tmp_path / "flight", "flush_interval_s:=0.1")
    try:
        source.wait_for_recorder()
        source.publish(0, 300)
        wait_until_saved(tmp_path / "flight", 300)
        source.publish(300, 100)
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE_S)
    done = repair(tmp_path / "flight")
    # the timer flushed what came before the pause
    assert done.counts[NAV] >= 300
    columns = open_bag(done.path).columns(NAV)
    assert columns["sequence"].tolist() == list(range(done.counts[NAV]))


def test_a_process_with_a_full_disk_ends_with_status_1(
    source: Source, ros_environment: dict[str, str], tmp_path: Path
) -> None:
    process = start_process(
        ros_environment, tmp_path / "flight", "flush_interval_s:=0.05", limit=20_000
    )
    try:
        source.wait_for_recorder()

        def reported() -> bool:
            return any(array.status[0].name == "ares/recorder" for array in source.heard)

        # few at a time: the report must not be pushed out of the queue of what is heard
        for first in range(0, 90_000, 90):
            source.publish(first, 90)
            if spin_until(source.executor, reported, 0.1):
                break
        assert reported()
        assert process.poll() is None, "it stays, so that the flight goes on"
        process.terminate()
        _, err = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    assert process.returncode == 1
    # the limit is that of shared memory too: the middleware says in words of its own that it
    # does without
    (said,) = (line for line in err.splitlines() if line.startswith("recorder: "))
    assert said.startswith(f"recorder: bag {tmp_path / 'flight'} is incomplete: File too large; ")
    assert "Traceback" not in err
    assert open_bag(tmp_path / "flight").custom_data["incomplete"] == "File too large"


def test_a_process_that_cannot_start_ends_with_status_2(
    ros_environment: dict[str, str], tmp_path: Path
) -> None:
    process = start_process(ros_environment, tmp_path)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2
    assert own_words(err) == f"recorder: bag {tmp_path} exists already; expected a new name\n"


def test_two_recorders_write_equal_bags(
    source: Source, recorders: Any, ros_environment: dict[str, str], tmp_path: Path
) -> None:
    """Record in this process and in another: decoded messages and times are equal."""
    recorder = recorders(bag=str(tmp_path / "one"))
    process = start_process(ros_environment, tmp_path / "two")
    try:
        assert recorder.start()
        assert spin_until(
            source.executor,
            lambda: (
                source.nav.get_subscription_count() == 2
                and source.event.get_subscription_count() == 2
                and source.diagnostics.get_subscription_count() == 3
            ),
            timeout=PATIENCE_S,
        )
        source.publish(0, 300)
        recorder.drain_and_close(source.executor)
        for publisher in (source.nav, source.event, source.diagnostics):
            assert publisher.wait_for_all_acked(Duration(seconds=PATIENCE_S))
        process.terminate()
        process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    assert differences(open_bag(tmp_path / "one"), open_bag(tmp_path / "two")) == []


def test_every_topic_of_the_design_has_a_type() -> None:
    assert TYPES.keys() == {
        "nav_state", "vehicle_state", "thrust_command", "guidance_status", "flight_event",
        "/diagnostics",
    }  # fmt: skip
    for type_name in TYPES.values():
        assert type_hash(type_name).startswith("RIHS01_")
    assert os.environ["ROS_PYTHON_CHECK_FIELDS"] == "1"


# ---- one flight in a bag


def test_another_flight_is_not_recorded(source: Source, recorders: Any, tmp_path: Path) -> None:
    recorder = recorders(bag=str(tmp_path / "flight"), flight_id=FLIGHT_ID)
    assert recorder.start(), recorder.failure
    source.wait_for_recorder()
    for number in range(30):
        source.nav.publish(nav_state(number))
        stranger = nav_state(number)
        stranger.flight_id = FLIGHT_ID + 1
        source.nav.publish(stranger)
        words = report(number)
        words.status[0].hardware_id = hardware_id(FLIGHT_ID + number % 2)
        source.diagnostics.publish(words)
    recorder.drain_and_close(source.executor)
    assert recorder.message_counts == {NAV: 30, DIAGNOSTICS: 15}
    assert (recorder.error, recorder.exit_code) == (None, 0)
    bag = open_bag(tmp_path / "flight")
    assert set(bag.columns("nav_state")["flight_id"]) == {FLIGHT_ID}
    assert bag.custom_data["foreign_messages"] == "45"


def test_a_message_without_a_flight_is_nobodys(
    source: Source, recorders: Any, tmp_path: Path
) -> None:
    recorder = recorders(bag=str(tmp_path / "flight"))
    assert recorder.start(), recorder.failure
    source.wait_for_recorder()
    nameless = nav_state(0)
    nameless.flight_id = 0
    source.nav.publish(nameless)
    source.publish(0, 5)
    recorder.drain_and_close(source.executor)
    assert recorder.message_counts[NAV] == 5


@pytest.mark.parametrize(("numbers", "missing"), [([0, 1, 4, 5], 2), ([3, 4], 3)])
def test_a_bag_without_some_states_is_called_incomplete(
    source: Source, recorders: Any, tmp_path: Path, numbers: list[int], missing: int
) -> None:
    recorder = recorders(bag=str(tmp_path / "flight"))
    assert recorder.start(), recorder.failure
    source.wait_for_recorder()
    for number in numbers:
        source.nav.publish(nav_state(number))
    recorder.drain_and_close(source.executor)
    assert recorder.exit_code == 1
    assert recorder.error.endswith(f"is incomplete: {missing} messages did not arrive")
    custom_data = open_bag(tmp_path / "flight").custom_data
    assert custom_data["incomplete"] == f"{missing} messages did not arrive"


@pytest.mark.trial
@pytest.mark.parametrize(("sent", "whole"), [(10, True), (8, False)])
def test_the_simulator_says_how_many_states_there_were(
    source: Source, recorders: Any, tmp_path: Path, sent: int, whole: bool
) -> None:
    simulator = Membership(source.node, Role.VEHICLE_SIM, "ares_v", FLIGHT_ID)
    simulator.listen()
    recorder = recorders(bag=str(tmp_path / "flight"), flight_id=FLIGHT_ID, topics=["nav_state"])
    assert recorder.start(), recorder.failure
    assert spin_until(source.executor, lambda: source.nav.get_subscription_count() == 1)
    for number in range(sent):
        source.nav.publish(nav_state(number))
    simulator.say(State.OVER, last_sequence=10)
    # it closes its bag by itself and says how that went
    wanted = State.OVER if whole else State.FAILED
    assert spin_until(source.executor, lambda: simulator.others(Role.RECORDER, wanted))
    word = simulator.others(Role.RECORDER)[0].reason
    assert word == ("" if whole else str(recorder.error))
    assert recorder.exit_code == (not whole)
    assert open_bag(tmp_path / "flight").topics[NAV].count == sent
    simulator.close()


@pytest.mark.parametrize("words", [(State.READY, State.FAILED), (State.READY, State.LEFT)])
def test_a_flight_that_is_refused_leaves_no_bag(
    source: Source, recorders: Any, tmp_path: Path, words: tuple[State, ...]
) -> None:
    """Refuse a flight after its first state, as for a plan that was not found."""
    simulator = Membership(source.node, Role.VEHICLE_SIM, "ares_v", FLIGHT_ID)
    simulator.listen()
    recorder = recorders(bag=str(tmp_path / "flight"), flight_id=FLIGHT_ID, topics=["nav_state"])
    assert recorder.start(), recorder.failure
    assert spin_until(source.executor, lambda: source.nav.get_subscription_count() == 1)
    for word in words:
        simulator.say(word)
        heard = source.executor.spin_once
        for _ in range(20):
            heard(timeout_sec=0.01)
    source.nav.publish(nav_state(0))
    assert spin_until(source.executor, lambda: recorder.message_counts == {NAV: 1})
    recorder.drain_and_close()
    assert recorder.error is None
    assert not (tmp_path / "flight").exists()
    simulator.close()


@pytest.mark.trial
@pytest.mark.parametrize(("sent", "whole"), [(4, True), (3, False)])
def test_guidance_says_how_many_statuses_there_were(
    source: Source, recorders: Any, tmp_path: Path, sent: int, whole: bool
) -> None:
    simulator = Membership(source.node, Role.VEHICLE_SIM, "ares_v", FLIGHT_ID)
    guidance = Membership(source.node, Role.GUIDANCE, "ares_v", FLIGHT_ID)
    out = source.node.create_publisher(GuidanceStatus, "guidance_status", FLIGHT)
    simulator.listen()
    guidance.listen()
    recorder = recorders(
        bag=str(tmp_path / "flight"), flight_id=FLIGHT_ID, topics=["nav_state", "guidance_status"]
    )
    assert recorder.start(), recorder.failure
    simulator.say(State.FLYING, guidance_id=guidance.member_id)
    guidance.agree(guidance.member_id)
    assert spin_until(source.executor, lambda: simulator.others(Role.RECORDER, State.READY))
    for number in range(2):
        source.nav.publish(nav_state(number))
    simulator.say(State.OVER, last_sequence=2)
    # the flight is over, guidance has not said its last word: the bag stays open
    assert not spin_until(
        source.executor, lambda: simulator.others(Role.RECORDER, State.OVER), timeout=0.4
    )
    other = GuidanceStatus(flight_id=FLIGHT_ID, guidance_id=guidance.member_id + 1)
    mine = GuidanceStatus(flight_id=FLIGHT_ID, guidance_id=guidance.member_id)
    for status in [other] + sent * [mine]:
        out.publish(status)
    guidance.say(State.OVER, last_sequence=4)
    wanted = State.OVER if whole else State.FAILED
    assert spin_until(source.executor, lambda: simulator.others(Role.RECORDER, wanted))
    if not whole:
        assert str(recorder.error).endswith("is incomplete: 1 messages did not arrive")
    assert open_bag(tmp_path / "flight").topics["/ares/guidance_status"].count == sent + 1
    guidance.close()
    simulator.close()


def test_a_recorder_that_is_killed_leaves_what_was_flown(
    source: Source, recorders: Any, tmp_path: Path
) -> None:
    """Check that the file has the settings before the first message."""
    simulator = Membership(source.node, Role.VEHICLE_SIM, "ares_v", FLIGHT_ID)
    guidance = Membership(source.node, Role.GUIDANCE, "ares_v", FLIGHT_ID)
    told = {
        "simulator": '{"mission_text": "name: mine"}',
        f"guidance {id_text(guidance.member_id)}": '{"law": "peg"}',
    }
    for member, settings in zip((simulator, guidance), told.values(), strict=True):
        member.announce_settings(settings)
    simulator.listen()
    guidance.listen()
    recorder = recorders(
        bag=str(tmp_path / "flight"), flight_id=FLIGHT_ID, flush_interval_s=0.01, mission="mine"
    )
    assert recorder.start(), recorder.failure
    simulator.say(State.PRESENT, guidance_id=guidance.member_id)
    guidance.agree(guidance.member_id)
    assert spin_until(source.executor, lambda: simulator.others(Role.RECORDER, State.READY))
    source.wait_for_recorder()
    source.publish(0, 50)
    file = tmp_path / "flight" / "flight_0.mcap"
    killed = tmp_path / "killed"
    killed.mkdir()
    assert spin_until(source.executor, lambda: recorded_so_far(tmp_path / "flight")[NAV] == 50)
    shutil.copy(file, killed / "killed_0.mcap")
    saved = open_bag(repair(killed).path).custom_data
    assert {key: saved[key] for key in told} == told
    simulator.close()
    guidance.close()
    recorder.drain_and_close(source.executor)
    whole = open_bag(tmp_path / "flight").custom_data
    assert {key: whole[key] for key in told} == told
    assert not verify(tmp_path / "flight").findings


def test_a_guidance_without_a_last_word_is_not_waited_for(
    source: Source, recorders: Any, tmp_path: Path
) -> None:
    simulator = Membership(source.node, Role.VEHICLE_SIM, "ares_v", FLIGHT_ID)
    guidance = Membership(source.node, Role.GUIDANCE, "ares_v", FLIGHT_ID)
    simulator.listen()
    guidance.listen()
    recorder = recorders(bag=str(tmp_path / "flight"), flight_id=FLIGHT_ID, topics=["nav_state"])
    assert recorder.start(), recorder.failure
    simulator.say(State.FLYING, guidance_id=guidance.member_id)
    guidance.agree(guidance.member_id)
    assert spin_until(source.executor, lambda: simulator.others(Role.RECORDER, State.READY))
    source.nav.publish(nav_state(0))
    simulator.say(State.OVER, last_sequence=1)
    assert spin_until(source.executor, lambda: simulator.others(Role.RECORDER, State.OVER))
    guidance.close()
    simulator.close()


def test_a_bag_that_is_closed_while_the_flight_goes_on_is_called_incomplete(
    source: Source, recorders: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "DRAIN_LIMIT", 0.5)
    simulator = Membership(source.node, Role.VEHICLE_SIM, "ares_v", FLIGHT_ID)
    simulator.listen()
    recorder = recorders(bag=str(tmp_path / "flight"), flight_id=FLIGHT_ID)
    assert recorder.start(), recorder.failure
    source.wait_for_recorder()
    simulator.say(State.FLYING)
    numbers = iter(range(100_000))
    source.node.create_timer(0.01, lambda: source.nav.publish(nav_state(next(numbers))))
    assert spin_until(source.executor, lambda: recorder.message_counts, PATIENCE_S)
    recorder.drain_and_close(source.executor)
    assert recorder.exit_code == 1
    assert recorder.error.endswith("is incomplete: the flight went on")
    assert open_bag(tmp_path / "flight").custom_data["incomplete"] == "the flight went on"
    simulator.close()
