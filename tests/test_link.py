# SPDX-License-Identifier: Apache-2.0
"""A link with latency and loss, and the vehicle that flies over it."""

import numpy as np
import pytest
import yaml
from rclpy.node import Node
from rclpy.parameter import Parameter

from ares_guidance.node import GuidanceNode
from ares_msgs.msg import FlightEvent, ThrustCommand
from ares_node.qos import FLIGHT
from ares_node.time import NANOSECONDS, ns_from_stamp
from ares_trials.faults.link import DelayLine, Link, LinkNode, LinkOptions
from ares_trials.faults.relay import GUIDANCE_ARGUMENTS, Relay
from ares_trials.testing.flights import short_burn
from ares_vehicle_sim.node import VehicleSimNode

PERIOD_NS = NANOSECONDS // 10


@pytest.fixture
def mission(tmp_path):
    content = short_burn()
    del content["jettisons"]
    path = tmp_path / "mission.yaml"
    path.write_text(yaml.safe_dump(content))
    return str(path)


def begin(graph, mission, relay, **simulator):
    """Start a flight with a relay between its nodes."""
    commands = []
    graph.observer.create_subscription(ThrustCommand, "thrust_command", commands.append, FLIGHT)
    node = graph.add(Node("between", namespace="ares", context=graph.context))
    between = relay(node)
    guidance = graph.add(
        GuidanceNode(
            context=graph.context,
            cli_args=["--ros-args", *GUIDANCE_ARGUMENTS],
            parameter_overrides=[Parameter("mission", value=mission)],
        )
    )
    assert guidance.start(), guidance.failure
    vehicle = graph.start(VehicleSimNode, mission=mission, expected_judges=1, **simulator)
    return vehicle, between, commands


def end_of(graph):
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    return graph.events[-1]


def stamps(commands):
    return [ns_from_stamp(command.nav_stamp) for command in commands]


def test_a_way_keeps_order_and_takes_its_time():
    line = DelayLine(LinkOptions(latency_s=0.2, jitter_s=1.0), np.random.default_rng(1))
    for k in range(100):
        line.send(0.1 * k, k)
    assert line.arrived(0.19) == []
    found = line.arrived(1e6)
    assert [message for _, message in found] == list(range(100))
    times = np.array([at for at, _ in found])
    late = times - 0.1 * np.arange(100)
    assert np.all(np.diff(times) >= 0.0)
    assert 0.2 <= late.min() < 0.5 < late.max() <= 1.2


def test_a_way_loses_its_share_by_its_seed():
    def carried(seed):
        line = DelayLine(LinkOptions(loss=0.3), np.random.default_rng(seed))
        for k in range(1000):
            line.send(0.0, k)
        assert line.lost + line.carried == 1000
        return [message for _, message in line.arrived(0.0)]

    assert carried(3) == carried(3) != carried(4)
    assert len(carried(3)) == pytest.approx(700, abs=60)


def test_in_lock_step_a_command_is_as_old_as_the_link_makes_it(graph, mission):
    options = LinkOptions(latency_s=0.12)
    vehicle, _, commands = begin(
        graph, mission, lambda node: Link(node, options), longest_command_age_s=60.0
    )
    end_of(graph)
    graph.spin(lambda: len(commands) == len(graph.states))
    ages = [
        ns_from_stamp(state.stamp) - answered
        for state, answered in zip(graph.states, stamps(commands), strict=True)
    ]
    # 0.24 s there and back, and a command is looked for each 0.1 s; the first is before the flight
    assert ages == [0, PERIOD_NS, 2 * PERIOD_NS, *[3 * PERIOD_NS] * (len(ages) - 3)]
    assert vehicle.simulator.ended_well
    assert not graph.reports


def test_a_link_without_latency_changes_nothing(graph, mission):
    _, _, commands = begin(
        graph, mission, lambda node: Link(node, LinkOptions()), longest_command_age_s=60.0
    )
    end_of(graph)
    graph.spin(lambda: len(commands) == len(graph.states))
    assert stamps(commands) == [ns_from_stamp(state.stamp) for state in graph.states]


def test_a_command_that_is_too_old_is_refused(graph, mission):
    options = LinkOptions(latency_s=0.4)
    begin(
        graph,
        mission,
        lambda node: Link(node, options),
        longest_command_age_s=0.5,
        command_timeout_s=0.02,
    )
    graph.wait_for_report("command refused: nav_stamp is 1000 s; expected 1000.6")


def test_in_real_time_the_vehicle_waits_for_nobody_and_says_what_it_missed(graph, mission):
    def deaf_for_a_while(node):
        relay = Relay(node)
        relay.commands.begin, relay.commands.end = 1010.0, 1020.0
        relay.commands.tamper = lambda _now, _command: []
        return relay

    vehicle, _, _ = begin(graph, mission, deaf_for_a_while, longest_command_age_s=2.0, pace=50.0)
    end_of(graph)
    graph.wait_for_report("no command younger than 2 s: flying on without guidance")
    graph.wait_for_report("vehicle_sim: real time: ")
    kinds = [event.type for event in graph.events]
    lost, back = FlightEvent.GUIDANCE_LOST, FlightEvent.GUIDANCE_BACK
    # on a busy machine more often
    assert kinds.count(lost) == kinds.count(back) >= 1
    when = next(event.time for event in graph.events if event.type == lost)
    assert 1002.0 < when <= 1012.2
    assert vehicle._flight.pace.deadlines.states == len(graph.states)


def test_a_link_of_real_time_ends_with_its_flight(graph, mission):
    link = graph.add(
        LinkNode(context=graph.context, parameter_overrides=[Parameter("latency_s", value=0.001)])
    )
    assert link.start(), link.failure
    _, _, commands = begin(graph, mission, lambda _node: None, longest_command_age_s=2.0, pace=50.0)
    end_of(graph)
    graph.spin(lambda: link.done)
    assert link.exit_code == 0
    assert len(commands) > 100
    assert link._link.up.carried == len(graph.states)
