# SPDX-License-Identifier: Apache-2.0
"""Optimal guidance through the nodes: it flies the optimum, and reports when it cannot."""

import math

import numpy as np
import pytest

from ares_guidance.node import GuidanceNode
from ares_models.mission import load_mission
from ares_models.orbits import Insertion
from ares_msgs.msg import FlightEvent, GuidanceStatus
from ares_node.qos import FLIGHT
from ares_optimizer.solve import solve
from ares_vehicle_sim.node import VehicleSimNode


def fly(graph, **parameters):
    """Fly the default mission; the statuses of guidance."""
    statuses = []
    graph.observer.create_subscription(GuidanceStatus, "guidance_status", statuses.append, FLIGHT)
    graph.start(VehicleSimNode, mission="ares_v", navigation_period_s=1.0, command_timeout_s=60.0)
    graph.start(GuidanceNode, mission="ares_v", law="optimal", **parameters)
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    return statuses


def test_the_optimum_is_flown(graph):
    statuses = fly(graph)
    best = solve(load_mission("ares_v"), "indirect", verify=False)
    end = graph.events[-1]
    assert end.mass == pytest.approx(best.m_f_kg, abs=0.1)
    assert end.mass >= 174_182.0
    (drop,) = (e for e in graph.events if e.type == FlightEvent.JETTISON)
    assert drop.time == pytest.approx(best.t_plf_s, abs=0.02)
    assert drop.time == pytest.approx(416.64, abs=0.2)
    assert drop.heating_rate <= 1135.0
    flown = Insertion.from_state(np.array(end.position), np.array(end.velocity))
    assert flown.radius == pytest.approx(6_518_889.0, abs=1.0)
    assert flown.speed == pytest.approx(7840.675, abs=0.01)
    assert math.degrees(flown.flight_path_angle) == pytest.approx(1.0064, abs=1e-4)
    assert math.degrees(flown.inclination) == pytest.approx(28.5, abs=1e-3)
    assert {status.law for status in statuses} == {GuidanceStatus.LAW_OPTIMAL}
    assert not graph.reports


def test_peg_takes_over_visibly(graph):
    statuses = fly(graph, max_solve_iterations=0)
    assert {status.law for status in statuses} == {GuidanceStatus.LAW_PEG}
    assert any("law optimal has no solution for the burn" in report for report in graph.reports)
    end = graph.events[-1]
    assert float(np.linalg.norm(end.position)) == pytest.approx(6_518_889.0, abs=1.0)
