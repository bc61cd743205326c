# SPDX-License-Identifier: Apache-2.0
"""The nodes under a lifecycle manager: other missions, other bags, pauses in flight."""

import numpy as np
import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from ares_bags.reader import open_bag
from ares_bags.recorder import RecorderNode
from ares_guidance.node import GuidanceNode
from ares_msgs.msg import FlightEvent
from ares_vehicle_sim.node import VehicleSimNode

SUCCESS = TransitionCallbackReturn.SUCCESS


def set_parameters(node, **values):
    results = node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
    assert all(result.successful for result in results), results


def again(node, **values):
    """Take a node back, set parameters, bring it up."""
    if node._label == "active":
        assert node.trigger_deactivate() == SUCCESS
    assert node.trigger_cleanup() == SUCCESS
    set_parameters(node, **values)
    assert node.start(), node.failure


def flights_over(graph):
    return [event for event in graph.events if event.type == FlightEvent.FLIGHT_COMPLETE]


def assert_on_target(graph):
    cutoff = [event for event in graph.events if event.type == FlightEvent.CUTOFF][-1]
    assert np.linalg.norm(cutoff.position) == pytest.approx(6_518_889.0, abs=1.0)
    assert np.linalg.norm(cutoff.velocity) == pytest.approx(7840.675, abs=0.01)


def test_the_same_nodes_fly_one_mission_after_the_other(graph, tmp_path):
    recorder = graph.start(RecorderNode, bag=str(tmp_path / "first"))
    guidance = graph.start(GuidanceNode)
    simulator = graph.start(VehicleSimNode, expected_recorders=1, navigation_period_s=1.0)
    graph.spin(lambda: len(flights_over(graph)) == 1 and recorder._writer is None)

    again(recorder, bag=str(tmp_path / "second"))
    again(guidance, mission="delta_iii")
    again(simulator, mission="delta_iii")
    graph.spin(lambda: len(flights_over(graph)) == 2 and recorder._writer is None)

    bags = [open_bag(tmp_path / name) for name in ("first", "second")]
    starts = [next(bag.messages("nav_state"))[1] for bag in bags]
    assert starts[0].mass == pytest.approx(1_227_734.0)
    assert starts[1].mass != pytest.approx(starts[0].mass)
    assert starts[0].flight_id != starts[1].flight_id


def test_guidance_that_pauses_goes_on(graph):
    guidance = graph.start(GuidanceNode)
    graph.start(VehicleSimNode, navigation_period_s=0.5)
    graph.spin(lambda: len(graph.states) > 100)
    assert guidance.trigger_deactivate() == SUCCESS
    # the simulator waits for its answer meanwhile
    graph.spin(lambda: guidance._held_back is not None)
    flown = len(graph.states)
    assert guidance.trigger_activate() == SUCCESS
    graph.spin(lambda: bool(flights_over(graph)))
    assert len(graph.states) > flown
    assert_on_target(graph)
    assert not graph.reports


def test_a_stopped_flight_is_not_taken_up_but_a_new_one_is(graph):
    graph.start(GuidanceNode)
    simulator = graph.start(VehicleSimNode, navigation_period_s=0.5)
    graph.spin(lambda: len(graph.states) > 100)
    assert simulator.trigger_deactivate() == SUCCESS
    assert simulator.trigger_activate() != SUCCESS
    assert simulator.failure.startswith("the flight was stopped and cannot go on, at ")
    again(simulator)
    graph.spin(lambda: bool(flights_over(graph)))
    assert_on_target(graph)

    assert simulator.trigger_deactivate() == SUCCESS
    assert simulator.trigger_activate() != SUCCESS
    assert simulator.failure.startswith("the flight is over, at ")


def test_a_closed_bag_is_not_written_to(graph, tmp_path):
    recorder = graph.start(RecorderNode, bag=str(tmp_path / "bag"))
    assert recorder.trigger_deactivate() == SUCCESS
    assert recorder.trigger_activate() != SUCCESS
    assert "is closed; clean up, set parameter bag to a new folder" in recorder.failure
    assert recorder.trigger_cleanup() == SUCCESS
    set_parameters(recorder, bag=str(tmp_path / "another"))
    assert recorder.start(), recorder.failure


def test_a_guidance_that_has_prepared_for_long_gets_time_to_agree(graph, monkeypatch):
    simulator = graph.start(VehicleSimNode, start_timeout_s=30.0)
    begun = simulator._members.activated_at
    monkeypatch.setattr(simulator._membership, "preparing", lambda _role: True)
    simulator._members.count(begun + 100.0)
    monkeypatch.setattr(simulator._membership, "preparing", lambda _role: False)
    simulator._members.count(begun + 129.0)
    assert not simulator.done
    simulator._members.count(begun + 131.0)
    assert simulator.failure == "no guidance on the graph after 131 s"
