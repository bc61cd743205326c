# SPDX-License-Identifier: Apache-2.0
"""Hostile input, a little of each kind, always the same. By the million: benchmarks/fuzz.py."""

import io
import json
import math
import os
import time
from itertools import product
from pathlib import Path
from random import Random

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message, serialize_message
from rich.console import Console

from ares_bags.errors import BagError
from ares_bags.files import find_file
from ares_bags.metadata import METADATA_FILE
from ares_bags.reader import open_bag
from ares_bags.repair import repair
from ares_bags.schema import load_yaml
from ares_bags.types import message_class
from ares_bags.verify import surveyed, verify
from ares_bags.writer import BagWriter
from ares_bringup.facts import facts_of
from ares_bringup.monitor import FlightMonitor
from ares_bringup.observed import Event
from ares_bringup.params_file import node_values
from ares_bringup.summary import FlightSummary
from ares_bringup.summary_json import to_json
from ares_bringup.terminal import TerminalView
from ares_models.arrays import STEERING
from ares_models.mission import MISSION, MissionError, load_mission
from ares_msgs.msg import FlightEvent, FlightMember, NavState, ThrustCommand, VehicleState
from ares_msgs.srv import SolveTrajectory
from ares_node.diagnostics import NODE, PACE, PAUSED, Timing, hardware_id, number_of
from ares_node.entry import BEYOND_NUMBERS
from ares_node.membership import MOST_HEARD, Membership, Role, State
from ares_node.qos import DIAGNOSTIC, EVENTS, FLIGHT, MEMBERS
from ares_node.states import StateMessage, Unreadable
from ares_node.time import stamp_from_seconds
from ares_optimizer.messages import RequestServer
from ares_trials.testing.bags import messages, write_bag
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.dispersions import DispersionsError, load_dispersions
from ares_vehicle_sim.node import VehicleSimNode
from ares_vehicle_sim.simulator import CommandRefused, Simulator
from ares_view.live.node import LiveNode
from ares_view.live.story import Seen
from ares_view.standard.node import ViewNode
from hostile import kept
from hostile import run as fuzz_run
from hostile.bags import DamagedBags, ForgedBags
from hostile.files import MissionFiles
from hostile.run import Run, pack, unpack
from hostile.target import Broken, Target
from hostile.targets import all_targets

pytestmark = pytest.mark.filterwarnings(f"ignore:{BEYOND_NUMBERS}:RuntimeWarning")

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"
#: Inputs of a target here: of its share of a million, as many as a quarter of a second takes.
COUNTS = {"mission files": 4, "dispersion files": 20, "damaged bags": 12, "forged bags": 8}
COUNTS |= {"commands on bags": 2, "optimizer": 6, "socket of the page": 60, "command lines": 12}
COUNTS |= {"terminal": 75, "parameters": 200, "answers of an optimizer": 150}


@pytest.mark.parametrize("target", all_targets(REFERENCE), ids=lambda target: target.name)
def test_nothing_comes_of_it_that_must_not(target: Target, tmp_path: Path) -> None:
    with target:
        run = Run([target], seed=20260101, folder=tmp_path)
        run.block(target, COUNTS.get(target.name, 500))
    account = run.accounts[target.name]
    texts = [path.read_text(errors="replace") for path in tmp_path.glob("*.txt")]
    assert not account.failures, texts[:1]
    assert account.outcomes.total() == account.inputs


class _Faulty(Target):
    """Fail, or take long, at random."""

    name = "faulty"
    stateful = True
    share = 100.0

    def make(self, random: Random) -> bytes:
        return bytes([random.randrange(4)])

    def run(self, data: bytes) -> str:
        if data[0] == 3:
            raise Broken("three")
        return "good"


def test_a_fault_is_counted_and_its_inputs_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = _Faulty()
    run = Run([target], seed=1, folder=tmp_path / "kept")
    run.round(100)
    account = run.accounts["faulty"]
    assert account.inputs == run.inputs == 100
    assert 5 < run.failures == account.failures["Broken in test_fuzz.py:run three"] < 50
    assert account.outcomes == {"good": 100 - run.failures, "broken": run.failures}
    files = sorted((tmp_path / "kept").glob("*.bin"))
    assert len(files) == fuzz_run.MOST_KEPT
    history = list(unpack(files[0].read_bytes()))
    assert history[-1] == b"\x03"
    assert pack(history) == files[0].read_bytes()
    # what came before it since the last failure, which a target with a memory needs
    numbered = [run.input(target, number) for number in range(100)]
    first = numbered.index(b"\x03")
    assert (
        list(unpack((tmp_path / "kept" / f"faulty_{first}.bin").read_bytes()))
        == (numbered[: first + 1])
    )
    monkeypatch.setattr(fuzz_run, "LONGEST", 0.0)
    run.block(target, 1)
    assert account.failures["took more than 0 s"] == 1
    assert run.as_json()["targets"]["faulty"]["failures"] == dict(account.failures)


def _sleep(_data: bytes) -> str:
    time.sleep(0.05)
    return "slept"


def test_a_wait_is_a_hang_and_to_have_no_processor_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = _Faulty()
    run = Run([target], seed=1, folder=tmp_path)
    monkeypatch.setattr(target, "run", _sleep)
    monkeypatch.setattr(fuzz_run, "LONGEST", 0.04)
    run.block(target, 1)
    assert run.failures == 1
    times = iter((0.0, 9.0))
    monkeypatch.setattr(fuzz_run, "queued", lambda: next(times))
    run.block(target, 1)
    assert run.failures == 1


def test_runs_are_summed_and_no_input_counts_twice(tmp_path: Path) -> None:
    def ran(begun: str, code: str, seed: int, inputs: int, failed: int) -> dict[str, object]:
        account = {"inputs": inputs, "slowest_s": inputs / 10}
        run = {"seed": seed, "grown_mib": 1.5, "failed": failed, "targets": {"a": account}}
        return {"begun": begun, "code": code} | run

    path = tmp_path / "some" / "fuzz.json"
    kept.keep(path, {"about": "a test"}, ran("1", "old", 1, 10, 0))
    kept.keep(path, {"about": "a test"}, ran("2", "new", 2, 3, 0))
    # the same run, further on
    kept.keep(path, {"about": "a test"}, ran("2", "new", 2, 5, 1))
    said = {row["what"]: row["value"] for row in json.loads(path.read_text())["figures"]}
    assert said["inputs"] == said["inputs for a"] == 15
    assert (said["inputs on code old"], said["inputs on code new"]) == (10, 5)
    assert said["slowest input"] == 1.0
    assert list(said.values())[1] == 1
    assert [run["begun"] for run in kept.load(path)] == ["1", "2"]
    assert kept.same_inputs(kept.load(path), 2, ["a", "b"]) == ["a"]
    assert kept.same_inputs(kept.load(path), 3, ["a", "b"]) == []
    assert not list(path.parent.glob("*.new"))


@pytest.mark.trial
def test_a_process_that_grows_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    held = [10**9]
    monkeypatch.setattr(fuzz_run, "memory", lambda: held[0])
    monkeypatch.setattr(fuzz_run, "WARM", 10)
    target = MissionFiles()
    with target:
        run = Run([target], seed=1, folder=tmp_path)
        held[0] *= 2
        run.round(1000)
        assert (run.inputs, run.grown, run.failures) == (10, 0, 0)
        held[0] += fuzz_run.MOST_GROWTH
        assert run.failures == 0
        held[0] += 1
        assert (run.grown, run.failures) == (fuzz_run.MOST_GROWTH + 1, 1)
        # what is kept to be written beside a failure is no growth
        run._before[target.name].append(bytes(len(run._before[target.name][-1]) + 1))
        assert run.failures == 0


# ---- what was found, replayed


@pytest.mark.parametrize("text", ["[" * 200_000, "{a: " * 60_000, "- " * 120_000, "[\n" * 100_000])
def test_a_deeply_nested_mission_is_refused_at_once(tmp_path: Path, text: str) -> None:
    path = tmp_path / "deep.yaml"
    path.write_text(text)
    with pytest.raises(MissionError, match="nested too deeply"):
        load_mission(path)


def test_a_mission_of_very_many_values_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wide.yaml"
    path.write_text("a: [" + "1," * 100_000 + "]")
    with pytest.raises(MissionError, match="has more than 32768 values"):
        load_mission(path)


@pytest.mark.parametrize("escape", ["\\U00110000", "\\UFFFFFFFF", "\\ud800", "\\xzz"])
def test_a_character_that_is_none_is_refused(tmp_path: Path, escape: str) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text(f'name: "{escape}"\n')
    with pytest.raises(MissionError, match=r"not valid YAML|half of a character") as caught:
        load_mission(path)
    assert str(caught.value).isprintable()


def test_a_key_that_looks_like_a_mark_of_the_checks_is_named(tmp_path: Path) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text('"<script>": 1\n')
    with pytest.raises(DispersionsError, match="<script> is not a known key"):
        load_dispersions(path)


@pytest.mark.parametrize("name", ["\t.yaml", "\r\n.yaml", "\ufeff/x", "\x1b[31m.yaml"])
def test_a_name_that_a_terminal_would_obey_is_escaped(name: str) -> None:
    with pytest.raises(MissionError) as caught:
        load_mission(name)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        "{a: " * 100_000,
        "- " * 100_000,
        "&a [*a]",
        "!!timestamp no",
        "!!int ''",
        "!!bool maybe",
        "2001-99-99",
        "1" * 5000,
        "a: &a [x, x]\nb: &b " + "[*a, *a, *a]\nc: [" + "*b, " * 20_000 + "]",
    ],
)
def test_yaml_of_a_bag_is_bounded(text: str) -> None:
    with pytest.raises(ValueError, match="not valid YAML"):
        load_yaml(text)


def test_yaml_of_a_bag_may_have_aliases() -> None:
    assert load_yaml("a: &a [1, 2]\nb: [*a, *a]\nc: &c 3\nd: *c") == {
        "a": [1, 2],
        "b": [[1, 2], [1, 2]],
        "c": 3,
        "d": 3,
    }


def test_a_bag_whose_metadata_is_a_bomb_is_damaged(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "flight", 10)
    bomb = "a0: &a0 [x]\n"
    for k in range(1, 12):
        bomb += f"a{k}: &a{k} [" + f"*a{k - 1}, " * 10 + "]\n"
    (bag / METADATA_FILE).write_text(bomb)
    assert verify(bag).findings
    with pytest.raises(BagError, match="grown by its aliases"):
        open_bag(bag)


@pytest.mark.trial
def test_a_repair_counts_what_it_saves_not_what_it_leaves_out(tmp_path: Path) -> None:
    target = ForgedBags()
    with target:
        for number in range(60):
            target.write(target.make(Random(f"{number}")))
            try:
                done = repair(target.bag, tmp_path / f"{number}")
            except BagError:
                continue
            assert verify(done.path, decode=False).messages == done.saved


def test_a_chunk_before_the_first_that_describes_its_topics_is_counted(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "flight", 40, 10)
    file = find_file(bag)
    data = file.read_bytes()
    found = surveyed(bag, file)
    first, second = found.chunks[:2]
    # the first chunk, which describes the topics, comes last and the file has no end
    order = data[: first.begin] + data[second.begin : found.chunks[-1].end]
    file.write_bytes(order + data[first.begin : second.begin])
    done = repair(bag)
    assert done.saved == verify(done.path).messages == len(messages(40))


def test_a_bag_with_names_that_a_terminal_would_obey(tmp_path: Path) -> None:
    with pytest.raises(BagError) as caught:
        open_bag(tmp_path / "\x1b[2J\n")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("name", ["x" * 300, "a/" * 3000, "/dev/null", "\x00"])
def test_a_name_that_is_no_bag(name: str) -> None:
    with pytest.raises(BagError, match=r"cannot be read|does not exist|neither a file"):
        open_bag(name)


@pytest.mark.parametrize(
    "text", ["&a [*a]", "[" * 10_000, "2001-99-99: {}", "a: !!timestamp x", "3"]
)
def test_parameter_files(tmp_path: Path, text: str) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"odd.yaml: not (valid YAML|a parameter file)") as caught:
        node_values(path, "guidance")
    assert str(caught.value).isprintable()


def test_a_pipe_is_no_parameter_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(ValueError, match="not a plain file"):
        node_values(tmp_path / "pipe.yaml", "guidance")
    large = tmp_path / "large.yaml"
    large.write_bytes(b"#" * 300_000)
    with pytest.raises(ValueError, match="larger than 262144 bytes"):
        node_values(large, "guidance")


def test_a_state_that_is_cut_is_unreadable() -> None:
    layout = StateMessage(NavState)
    for size in (0, 1, 2, 12, 40):
        with pytest.raises(Unreadable, match=f"{size} bytes; expected"):
            layout.read(bytes(size))


@pytest.mark.parametrize(
    ("field", "value"),
    [("direction_rate", [0.0, 1e308, 0.0]), ("reference_time", 1e300), ("reference_time", -1e10)],
)
def test_a_command_beyond_numbers_is_refused(field: str, value: object) -> None:
    simulator = Simulator(load_mission("ares_v"))
    command = np.zeros(1, STEERING)
    command["direction"] = [0.0, 1.0, 0.0]
    command["reference_time"] = 150.0
    for name in ("cutoff_time", "jettison_time", "arc_end_times"):
        command[name] = np.nan
    command["jettison"] = -1
    command[field] = value
    with pytest.raises(CommandRefused, match=f"{field} is .*; expected .* at most"):
        simulator.command(command)
    simulator.advance()
    assert np.all(np.isfinite(simulator.truth()["position"]))


@pytest.mark.parametrize("field", ["position", "velocity", "mass", "arc_start_time"])
@pytest.mark.parametrize("method", ["indirect", "analytic", "direct11"])
def test_a_request_from_beyond_numbers_is_refused(method: str, field: str) -> None:
    answers = RequestServer("ares_v", method, 1.0)
    start = load_mission("ares_v").start()
    state = NavState(
        position=start.position, velocity=start.velocity, mass=start.mass_kg, arc_start_time=155.9
    )
    setattr(state, field, [1e300, 0.0, 0.0] if field in ("position", "velocity") else 1e300)
    answer = answers.answer(
        SolveTrajectory.Request(use_nav_state=True, nav_state=state, method=method)
    )
    assert answer.error_code == SolveTrajectory.Response.INVALID_STATE
    assert answer.message.startswith(f"state.{field} is ")


@pytest.mark.parametrize("mass", [1.0, 6.5, 1e4])
@pytest.mark.parametrize("method", ["indirect", "analytic", "direct11", "closed_form", "jump"])
def test_a_request_from_a_vehicle_lighter_than_empty_is_answered(method: str, mass: float) -> None:
    answers = RequestServer("ares_v", method, 1.0)
    start = load_mission("ares_v").start()
    state = NavState(
        position=start.position, velocity=start.velocity, mass=mass, arc_start_time=171.49
    )
    state.stamp.sec = 161
    answer = answers.answer(
        SolveTrajectory.Request(use_nav_state=True, nav_state=state, method=method)
    )
    assert answer.error_code not in (
        SolveTrajectory.Response.NONE,
        SolveTrajectory.Response.INTERNAL,
    )
    assert answer.message.isprintable()


#: An odd state: mission, method, shares of place and speed at the start, mass in kg, arc.
ODD = [
    ("saturn_v_tli", "direct20", 1e3, -1e-30, 135_332.0, 0),
    ("saturn_v_tli", "direct20", 1.0, 0.0, 135_332.0, 0),
    ("saturn_v_tli", "jump", 1.0, 0.0, 135_332.0, 0),
    ("ariane5_eca", "indirect", 1.0, 0.0, 15_500.0, 2),
    ("ares_v_transients", "direct14", -1.0, 2.0, 1.0, 1),
]


@pytest.mark.parametrize(("mission", "method", "place", "speed", "mass", "arc"), ODD)
def test_a_request_from_an_odd_state_is_no_fault_of_the_server(
    mission: str, method: str, place: float, speed: float, mass: float, arc: int
) -> None:
    """Solve from a state at rest, where plane and perigee are undefined."""
    answers = RequestServer("ares_v", "indirect", 1.0)
    start = load_mission(mission).start()
    state = NavState(
        stamp=stamp_from_seconds(start.time_s),
        position=np.array(start.position) * place,
        velocity=np.array(start.velocity) * speed,
        mass=mass,
        arc=arc,
        arc_start_time=start.time_s - 10.0,
    )
    asked = SolveTrajectory.Request(
        mission=mission, use_nav_state=True, nav_state=state, method=method
    )
    answer = answers.answer(asked)
    assert answer.error_code not in (
        SolveTrajectory.Response.NONE,
        SolveTrajectory.Response.INTERNAL,
    ), answer.message


def test_a_vehicle_of_which_nothing_would_be_left_has_no_solution() -> None:
    answers = RequestServer("ares_v", "analytic", 1.0)
    state = NavState(
        position=[-5781333.8, -2024247.06, 3058328.51082876],
        velocity=[413.92700001, -1839.599, 202.55],
        mass=6.540625313204953,
        arc_start_time=171.49,
    )
    state.stamp.sec = 161
    answer = answers.answer(
        SolveTrajectory.Request(use_nav_state=True, nav_state=state, method="analytic")
    )
    assert answer.error_code == SolveTrajectory.Response.INFEASIBLE
    assert "kg are left of the vehicle" in answer.message


def _timing(**values: str) -> Timing:
    from diagnostic_msgs.msg import KeyValue

    said = [KeyValue(key=key, value=value) for key, value in values.items()]
    return Timing(hardware_id=hardware_id(7), values=said)


@pytest.mark.parametrize("text", ["", "much", "nan", "inf", "1e999"])
def test_what_is_no_number_is_none(text: str) -> None:
    assert number_of({"a": text}, "a") is None
    assert number_of({}, "a") is None
    assert number_of({"a": "1.5"}, "a") == 1.5


def test_the_live_page_outlives_what_it_hears(graph) -> None:
    live = graph.start(LiveNode)
    live._on_event(FlightEvent(flight_id=7, time=float("nan"), mass=float("inf"), type=1))
    for pace, node in (("", "/x"), ("nan", "/x"), ("1.0", "no name"), ("1.0", "")):
        live._on_timing(_timing(**{PACE: pace, PAUSED: "", NODE: node}))
    live._on_timing(_timing(**{PACE: "1.0"}))
    live._on_state(b"\x00\x01")
    live._on_status(b"\x00\x01\x00\x00")
    live._on_look()
    json.dumps(live._story.news(Seen())[0], allow_nan=False)


@pytest.mark.parametrize("kind", [LiveNode, ViewNode])
def test_no_file_is_opened_because_the_graph_names_it(graph, tmp_path, kind) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(MISSION.find("ares_v").read_text())
    node = graph.start(kind)
    node._on_member(
        FlightMember(
            flight_id=7,
            member_id=1,
            role=FlightMember.VEHICLE_SIM,
            state=FlightMember.FLYING,
            mission=str(path),
        )
    )
    shown = []
    node._begin(7) if kind is LiveNode else shown.append(node._begin(7).mission.name)
    if kind is LiveNode:
        assert "is not among those here" in node._story.news(Seen())[0]["about"]["note"]
    else:
        assert shown == ["ares_v"]
        graph.wait_for_report("is not among those here")


def test_members_without_end_are_not_remembered(graph) -> None:
    membership = Membership(graph.observer, Role.JUDGE, flight_id=7)
    membership.listen()
    for number in range(1, MOST_HEARD + 500):
        membership._on_member(FlightMember(member_id=number, flight_id=7, role=3))
    assert len(membership._heard) == MOST_HEARD
    assert membership.others(Role.RECORDER)[-1].member_id == MOST_HEARD + 499
    membership.close()


def test_a_simulator_that_comes_after_the_flight_is_no_rival(graph) -> None:
    simulator = graph.start(VehicleSimNode, flight_id=7)
    simulator._membership.state = State.OVER
    simulator.simulator.plant["complete"] = 1
    simulator._members.hear(
        FlightMember(member_id=1, flight_id=7, role=FlightMember.VEHICLE_SIM, state=State.PRESENT)
    )
    assert not simulator.done


def test_a_message_that_cannot_be_read_is_reported_once(graph) -> None:
    view = graph.start(ViewNode)
    take = view._inputs[2].callback
    for size in (0, 1, 30):
        take(bytes(size))
    assert view.unreadable == 3
    graph.wait_for_report("vehicle_state: a message that cannot be read: 0 bytes; expected")
    assert len([report for report in graph.reports if "cannot be read" in report]) == 1


def test_what_cannot_be_sent_on_to_foxglove_ends_nothing(graph, free_port) -> None:
    view = graph.start(ViewNode, foxglove_port=free_port)
    view._begin(7)
    status = StateMessage(NavState)
    early = status.data(-(10**9), 7, 1, np.zeros(1, status._record.dtype)[0])
    for one in view._inputs:
        if one.topic_name.endswith("nav_state"):
            one.callback(early)
            for size in (0, 1, 13, 23):
                one.callback(bytes(size))
    assert view.unreadable == 4
    graph.wait_for_report("nav_state: a message that cannot be read: 0 bytes, which name no")


def test_the_terminal_outlives_a_state_that_is_none(graph) -> None:
    summary = FlightSummary(facts_of(load_mission("ares_v")), "peg", None, 7)
    monitor = FlightMonitor(graph.observer, summary, print)
    monitor._on_event(FlightEvent(flight_id=7, type=FlightEvent.FLIGHT_STARTED))
    out = io.StringIO()
    with TerminalView(Console(file=out, force_terminal=True, width=80)) as view:
        view.show(monitor)
        for raw in (b"\x00\x01", b"", bytes(40), serialize_message(VehicleState(flight_id=7))):
            view._input.callback(raw)
            view.show(monitor)
    assert "ares_v: core" in out.getvalue()
    monitor.leave()


@pytest.mark.parametrize("mission", MISSION.shipped())
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0, 1e300, 1.7e308])
@pytest.mark.parametrize("field", ["position", "velocity"])
def test_an_end_that_is_no_state_is_judged_and_is_no_success(
    mission: str, field: str, value: float
) -> None:
    facts = facts_of(load_mission(mission))
    summary = FlightSummary(facts, "peg", None, 7)
    where = {"position": (6.6e6, 1e5, 1e5), "velocity": (10.0, 7.8e3, 10.0)}
    where[field] = (value, value, value)
    for kind in (FlightEvent.FLIGHT_STARTED, FlightEvent.CUTOFF, FlightEvent.FLIGHT_COMPLETE):
        summary.events.append(Event(kind, 0, 600.0, mass=1e5, **where))
    assert summary.exit_code == 1
    assert any("target missed" in line for line in summary.shortcomings())
    json.dumps(to_json(summary), allow_nan=False)


@pytest.mark.trial
@pytest.mark.parametrize(
    ("topic", "value"),
    # each topic and each value once
    one_in(
        4, product(("vehicle_state", "nav_state", "flight_event"), (math.nan, math.inf, -1e300))
    ),
)
def test_a_bag_of_states_that_are_none_is_shown_without_them(
    ares, tmp_path: Path, topic: str, value: float
) -> None:
    flight = open_bag(REFERENCE)
    bag = tmp_path / "odd"
    with BagWriter(bag, {"mission": "ares_v", "law": "peg"}) as writer:
        for part in flight.topics.values():
            writer.add_topic(part)
        number = 0
        for name, time_ns, data in flight.raw_messages():
            content = data
            number += name.endswith(topic)
            if name.endswith(topic) and number % 3 == 0:
                message = deserialize_message(data, message_class(flight.topics[name].type_name))
                message.position = [value, 7e6, 0.0]
                content = bytes(serialize_message(message))
            writer.write(name, time_ns, content)
    for words in (
        ("report", str(bag), "--out", str(tmp_path / "odd.html")),
        ("export", str(bag), "--format", "czml", "--out", str(tmp_path / "odd.czml")),
        ("export", str(bag), "--format", "kml", "--out", str(tmp_path / "odd.kml")),
        ("export", str(bag), "--format", "csv", "--out", str(tmp_path / "odd.csv")),
    ):
        done = ares(*words)
        assert done.returncode in (0, 1), done.stderr
        assert "Traceback" not in done.stderr
    assert "their positions are impossible" in (tmp_path / "odd.html").read_text()


@pytest.mark.parametrize("data", [b"", b"\x00", b"\x00\x01\x00\x00", b"\xff" * 40, bytes(9)])
def test_bytes_that_are_no_message_end_no_node(graph, data: bytes) -> None:
    """Publish invalid bytes: the middleware drops them unless a callback takes them raw."""
    simulator = graph.start(VehicleSimNode, flight_id=7)
    for kind, name, qos in (
        (ThrustCommand, "thrust_command", FLIGHT),
        (FlightMember, "flight_member", MEMBERS),
        (DiagnosticArray, "/diagnostics", DIAGNOSTIC),
        (FlightEvent, "flight_event", EVENTS),
    ):
        out = graph.observer.create_publisher(kind, name, qos)
        graph.spin(lambda out=out: out.get_subscription_count() > 0)
        out.publish(data)
    out.publish(FlightEvent(type=9))
    graph.spin(lambda: any(event.type == 9 for event in graph.events))
    assert not simulator.done


def test_a_cut_bag_is_never_called_whole() -> None:
    target = DamagedBags()
    with target:
        whole = target._good
        # each third byte of the end, where the index lies
        for size in [*range(0, len(whole) - 600, 23), *range(len(whole) - 600, len(whole), 3)]:
            target.write(whole[:size])
            with pytest.raises(BagError):
                open_bag(target.bag)
            assert _seen_through(target.bag), size


def _seen_through(bag: Path) -> bool:
    try:
        return bool(verify(bag, decode=False).findings)
    except BagError:
        return True
