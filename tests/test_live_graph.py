# SPDX-License-Identifier: Apache-2.0
"""Pause and pace in flight; the live node beside flights, and whom it obeys."""

import json
import time

import pytest
import yaml
from rclpy.parameter import Parameter

from ares_bags.compare import differences
from ares_bags.reader import open_bag
from ares_bags.recorder import RecorderNode
from ares_guidance.node import GuidanceNode
from ares_models.mission import load_mission
from ares_msgs.msg import FlightEvent, FlightMember
from ares_node.membership import State
from ares_trials.testing.flights import short_burn
from ares_vehicle_sim.node import VehicleSimNode
from ares_view.live.node import LiveNode
from ares_view.live.story import Seen

PAUSE = 0.3


@pytest.fixture
def mission(tmp_path):
    path = tmp_path / "short_burn.yaml"
    path.write_text(yaml.safe_dump(short_burn()))
    return str(path)


def set_now(node, **values):
    """Set parameters; the reason of the first that is refused."""
    results = node.set_parameters([Parameter(name, value=x) for name, x in values.items()])
    return next((result.reason for result in results if not result.successful), "")


def over(graph, simulator):
    return any(
        event.flight_id == simulator.flight_id and event.type == FlightEvent.FLIGHT_COMPLETE
        for event in graph.events
    )


def spin_for(graph, seconds):
    until = time.monotonic() + seconds
    graph.spin(lambda: time.monotonic() > until)


def story_of(live):
    message, _ = live._story.news(Seen())
    return message


def column(live, name):
    from ares_view.live.story import STATE_FIELDS

    at = STATE_FIELDS.index(name)
    return [row[at] for _, row in story_of(live)["states"]]


# ---- the simulator


def test_pauses_and_paces_change_nothing_but_the_wall_clock(graph, tmp_path, mission):
    def flown(name, *halts):
        simulator = graph.start(VehicleSimNode, mission=mission, expected_recorders=1)
        guidance = graph.start(GuidanceNode, mission=mission)
        recorder = graph.start(RecorderNode, bag=str(tmp_path / name), mission=mission)
        for states, pace in halts:
            graph.spin(lambda states=states: simulator.simulator.sequence >= states)
            assert set_now(simulator, paused=True) == ""
            spin_for(graph, 0.05)
            held = simulator.simulator.sequence
            spin_for(graph, PAUSE)
            assert simulator.simulator.sequence == held
            assert set_now(simulator, paused=False, pace=pace) == ""
        graph.spin(lambda: recorder._membership.state is State.OVER)
        for node in (simulator, guidance, recorder):
            node.stop()
        return open_bag(tmp_path / name)

    bags = flown("straight"), flown("halting", (5, 0.0), (40, 200.0), (60, 30.0), (70, 0.0))
    topics = [topic for topic in bags[0].topics if topic != "/diagnostics"]
    assert len(topics) == 5
    assert differences(*bags, topics) == []


def test_a_pause_is_not_made_up_for(graph, mission):
    simulator = graph.start(VehicleSimNode, mission=mission, pace=2.0)
    graph.start(GuidanceNode, mission=mission)
    graph.spin(lambda: simulator.simulator.sequence > 10)
    set_now(simulator, paused=True)
    spin_for(graph, 1.0)
    set_now(simulator, paused=False)
    begun, first = time.monotonic(), simulator.simulator.sequence
    graph.spin(lambda: simulator.simulator.sequence >= first + 20)
    assert time.monotonic() - begun > 0.9 * 0.1 * 20 / 2.0
    assert not graph.reported("behind its pace")


def test_a_flight_may_begin_paused(graph, mission):
    simulator = graph.start(VehicleSimNode, mission=mission, paused=True)
    graph.start(GuidanceNode, mission=mission)
    graph.spin(lambda: simulator._flight.paused)
    spin_for(graph, PAUSE)
    assert simulator.simulator.sequence == 0
    set_now(simulator, paused=False)
    graph.spin(lambda: over(graph, simulator))


def test_what_cannot_be_set_in_flight_is_refused(graph, mission):
    simulator = graph.start(VehicleSimNode, mission=mission, paused=True)
    graph.start(GuidanceNode, mission=mission)
    graph.spin(lambda: simulator._flight.paused)
    assert set_now(simulator, pace=1e-9) == "parameter pace is 1e-09; expected 0, or 0.001 up"
    assert "pace" in set_now(simulator, pace=-1.0)
    assert set_now(simulator, pace="fast")
    assert "configured with it" in set_now(simulator, seed=3)
    assert simulator.values["pace"] == 0.0
    set_now(simulator, paused=False)
    graph.spin(lambda: over(graph, simulator))


# ---- the node of the page


def test_one_flight_at_a_time_and_the_next_anew(graph, mission):
    live = graph.start(LiveNode, mission=mission)
    seen = []
    for flight_id in (11, 12):
        simulator = graph.start(VehicleSimNode, mission=mission, flight_id=flight_id, pace=60.0)
        guidance = graph.start(GuidanceNode, mission=mission, flight_id=flight_id)
        graph.spin(lambda simulator=simulator: over(graph, simulator))
        spin_for(graph, 0.2)
        told = story_of(live)
        assert told["about"]["flight"] == f"{flight_id:016x}"
        assert told["about"]["end"] == "flight complete"
        assert told["about"]["law"] == "peg"
        assert told["events"][0]["text"] == "flight started"
        times = column(live, "time_s")
        assert times == sorted(times)
        assert times[0] == pytest.approx(1000.0, abs=2.0)
        seen.append(told["states"][-1][1])
        for node in (simulator, guidance):
            node.stop()
    assert seen[0] == seen[1]


def test_messages_of_another_flight_are_not_shown(graph, mission):
    live = graph.start(LiveNode, mission=mission, flight_id=21)
    flights = [
        graph.start(VehicleSimNode, mission=mission, flight_id=flight_id, seed=flight_id)
        for flight_id in (21, 22)
    ]
    for flight in flights:
        graph.start(GuidanceNode, mission=mission, flight_id=flight.flight_id)
    graph.spin(lambda: all(over(graph, flight) for flight in flights))
    spin_for(graph, 0.2)
    told = story_of(live)
    kinds = [event["text"] for event in told["events"]]
    assert len(kinds) == sum(event.flight_id == 21 for event in graph.events)
    assert "no part in this flight" in told["complaints"][0]["text"]
    times = column(live, "time_s")
    assert times == sorted(set(times))


def test_a_rocket_of_ones_own_needs_no_option(graph, mission):
    """The flight tells the text of its mission; who comes late gets it too."""
    simulator = graph.start(VehicleSimNode, mission=mission, pace=40.0)
    graph.start(GuidanceNode, mission=mission)
    graph.spin(lambda: simulator.simulator.sequence > 5)
    live = graph.start(LiveNode)
    graph.spin(lambda: over(graph, simulator))
    spin_for(graph, 0.2)
    told = story_of(live)
    known = load_mission(mission)
    assert told["about"]["title"] == known.title
    assert told["about"]["note"] == ""
    phases = [phase["name"].partition(", after")[0] for phase in told["about"]["phases"]]
    assert phases
    assert set(phases) <= set(known.arc_names)
    assert told["events"][0]["text"] == "flight started"
    assert any(known.arc_names[0] in event["text"] for event in told["events"])


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ("", "is not among those here, and the flight tells no more"),
        ("{", "is not among those here, and the flight tells no more"),
        ('{"mission_text": 5}', "is not among those here, and the flight tells no more"),
        ('{"mission_text": "name: 5"}', "title is missing"),
    ],
)
def test_a_mission_that_is_told_wrong_is_shown_without_its_names(graph, settings, why):
    live = graph.start(LiveNode)
    word = FlightMember(
        flight_id=5, role=FlightMember.VEHICLE_SIM, state=FlightMember.FLYING, mission="mine"
    )
    word.settings = settings
    live._on_member(word)
    about = story_of(live)["about"]
    assert about["title"] == "A flight"
    assert about["note"].startswith("Names and limits are not known: mission mine: ")
    assert why in about["note"]


def test_commands_reach_the_simulator(graph, mission):
    live = graph.start(LiveNode, mission=mission)
    simulator = graph.start(VehicleSimNode, mission=mission, pace=5.0)
    graph.start(GuidanceNode, mission=mission)
    graph.spin(lambda: len(column(live, "time_s")) > 3)
    refused = []

    def obey(name, value=0.0):
        live._commands.put((name, value, refused.append))

    obey("pause")
    graph.spin(lambda: story_of(live)["about"]["paused"])
    assert simulator.values["paused"]
    obey("pace", 1e-4)
    graph.spin(lambda: refused)
    assert refused == ["parameter pace is 0.0001; expected 0, or 0.001 up"]
    obey("pace", 0.0)
    obey("play")
    graph.spin(lambda: over(graph, simulator))
    simulator.stop()
    spin_for(graph, 0.2)
    obey("pause")
    graph.spin(lambda: len(refused) > 1)
    assert refused[1] == "nobody here obeys: this flight sets its own pace"


@pytest.mark.trial
def test_history_is_bounded_however_long_the_flight(graph, mission):
    live = graph.start(LiveNode, mission=mission)
    simulator = graph.start(VehicleSimNode, mission=mission, navigation_period_s=0.01)
    graph.start(GuidanceNode, mission=mission)
    graph.spin(lambda: over(graph, simulator))
    spin_for(graph, 0.2)
    text = json.dumps(story_of(live))
    assert len(text) < 400_000
    assert column(live, "time_s")[-1] == pytest.approx(simulator.simulator.time_ns / 1e9, abs=1e-3)
