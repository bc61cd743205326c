# SPDX-License-Identifier: Apache-2.0
"""The iterative guidance mode through the nodes."""

import math

import numpy as np
import pytest

from ares_guidance.node import GuidanceNode
from ares_models.mission import MISSION
from ares_models.orbits import Insertion
from ares_msgs.msg import FlightEvent, GuidanceStatus
from ares_node.qos import FLIGHT
from ares_vehicle_sim.node import VehicleSimNode


def test_it_flies_the_saturn_and_says_that_it_does(graph):
    statuses = []
    graph.observer.create_subscription(GuidanceStatus, "guidance_status", statuses.append, FLIGHT)
    mission = "saturn_v_as506"
    simulator = graph.start(
        VehicleSimNode, mission=mission, navigation_period_s=1.0, command_timeout_s=60.0
    )
    graph.start(GuidanceNode, mission=mission, law="igm")
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    end = graph.events[-1]
    flown = Insertion.from_state(np.array(end.position), np.array(end.velocity))
    assert flown.radius == pytest.approx(6_563_366.0, abs=10.0)
    assert flown.speed == pytest.approx(7793.0429, abs=0.05)
    assert math.degrees(flown.flight_path_angle) == pytest.approx(0.0, abs=1e-3)
    assert math.degrees(flown.inclination) == pytest.approx(32.531, abs=1e-3)
    assert simulator.simulator.ended_well
    assert {status.law for status in statuses} == {GuidanceStatus.LAW_IGM}
    assert {status.error_code for status in statuses} == {GuidanceStatus.NONE}
    assert statuses[0].converged
    assert not graph.reports


def test_peg_steers_up_to_a_burn_in_held_attitude_and_that_is_said(graph, tmp_path):
    mission = tmp_path / "held.yaml"
    burn = "burn_time_s: 181.25"
    text = MISSION.find("ares_v").read_text()
    assert burn in text
    mission.write_text(text.replace(burn, f"attitude: held\n    {burn}"))
    simulator = graph.start(
        VehicleSimNode, mission=str(mission), navigation_period_s=1.0, command_timeout_s=60.0
    )
    graph.start(GuidanceNode, mission=str(mission), law="igm")
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    assert simulator.simulator.ended_well
    assert graph.reported("arc 0 is flown in held attitude: peg steers up to it")
    assert graph.reported("solution of law igm again")
    assert len(graph.reports) == 2, graph.reports
