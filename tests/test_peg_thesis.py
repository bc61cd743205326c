# SPDX-License-Identifier: Apache-2.0
"""Law peg_thesis in a graph: it calls the optimizer, and reports its fallback without an answer."""

import json

import numpy as np
import pytest
from rclpy.parameter import Parameter

from ares_guidance.node import GuidanceNode
from ares_models.mission import load_mission
from ares_msgs.msg import FlightEvent, GuidanceStatus
from ares_msgs.srv import SolveTrajectory
from ares_node.qos import FLIGHT
from ares_optimizer.messages import RequestServer
from ares_optimizer.node import OptimizerNode
from ares_studies.closed_loop import fly_compiled
from ares_vehicle_sim.node import VehicleSimNode
from ares_vehicle_sim.simulator import SimulatorOptions

Response = SolveTrajectory.Response
#: Between navigation states, seldom: the numbers are compared with a flight like it.
PERIOD_S = 1.0
SELDOM = SimulatorOptions(navigation_period_s=PERIOD_S)


def fly(graph, **parameters):
    statuses = []
    graph.observer.create_subscription(GuidanceStatus, "guidance_status", statuses.append, FLIGHT)
    graph.start(GuidanceNode, law="peg_thesis", **parameters)
    # a slow machine is not a lost command
    graph.start(VehicleSimNode, command_timeout_s=60.0, navigation_period_s=PERIOD_S)
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    cutoff = next(event for event in graph.events if event.type == FlightEvent.CUTOFF)
    assert np.linalg.norm(cutoff.position) == pytest.approx(6_518_889.0, abs=10.0)
    assert np.linalg.norm(cutoff.velocity) == pytest.approx(7840.675, abs=0.5)
    return statuses, cutoff


def test_it_starts_from_the_analytic_solution(graph):
    graph.start(OptimizerNode, method="analytic")
    statuses, cutoff = fly(graph, optimizer_timeout_s=60.0)
    assert graph.reports == ["ares/guidance: starting from the optimizer's answer"]
    assert {status.law for status in statuses} == {GuidanceStatus.LAW_PEG_THESIS}
    assert [status.cycle for status in statuses] == list(range(1, len(statuses) + 1))
    # the first cycle has made one pass, and says that it has not settled
    assert statuses[0].iterations == 1
    assert not statuses[0].converged
    times = np.array([status.stamp.sec + 1e-9 * status.stamp.nanosec for status in statuses])
    predicted = np.array([status.jettison_time for status in statuses])
    staging = next(e.time for e in graph.events if e.type == FlightEvent.STAGING)
    assert np.ptp(predicted[(times > staging - 20.0) & (times < staging)]) < 0.5
    assert np.ptp(predicted[(times > staging) & (times < staging + 20.0)]) > 5.0
    # the same flight as without ROS
    alone = fly_compiled(load_mission("ares_v"), SELDOM, law="peg_thesis").plant
    assert cutoff.time == pytest.approx(float(alone["time"]), abs=1e-6)
    assert cutoff.mass == pytest.approx(float(alone["mass"]), abs=1e-3)


@pytest.mark.parametrize(
    ("answer", "complaint"),
    [
        (None, "optimizer: no such service on the graph; law peg_thesis cannot start"),
        (Response(error_code=Response.INFEASIBLE, message="no way"), "optimizer: no way; law peg"),
    ],
    ids=["absent", "refused"],
)
def test_without_an_answer_plain_peg_flies_and_says_so(graph, answer, complaint):
    if answer is not None:
        graph.observer.create_service(
            SolveTrajectory, "solve_trajectory", lambda _request, _response: answer
        )
    # an answer that comes is waited for
    statuses, cutoff = fly(graph, optimizer_timeout_s=0.3 if answer is None else 60.0)
    graph.wait_for_report(complaint)
    assert {status.law for status in statuses} == {GuidanceStatus.LAW_PEG}
    assert statuses[0].converged
    alone = fly_compiled(load_mission("ares_v"), SELDOM).plant
    assert cutoff.mass == pytest.approx(float(alone["mass"]), abs=1e-3)


def test_an_answer_without_a_jettison_is_no_start(graph):
    asked = []

    def serve(request, response):
        asked.append(request)
        response = RequestServer("ares_v", "analytic", 60.0).answer(request)
        response.jettison_time = float("nan")
        return response

    graph.observer.create_service(SolveTrajectory, "solve_trajectory", serve)
    commands = []
    graph.observer.create_subscription(GuidanceStatus, "guidance_status", commands.append, FLIGHT)
    graph.start(GuidanceNode, law="peg_thesis", optimizer_timeout_s=60.0)
    graph.start(VehicleSimNode)
    graph.spin(lambda: commands)
    assert asked[0].method == "analytic"
    graph.wait_for_report("unusable answer: jettison_time is nan")
    assert commands[0].law == GuidanceStatus.LAW_PEG


def test_a_mission_of_another_kind_leaves_the_node_unconfigured(graph):
    overrides = [Parameter("law", value="peg_thesis"), Parameter("mission", value="delta_iii")]
    node = graph.add(GuidanceNode(context=graph.context, parameter_overrides=overrides))
    assert not node.start()
    assert "flies two stages with one jettison by heating_limit_w_m2" in node.failure


# ---- the command line

LAW = ("--mission", "ares_v", "--guidance", "peg_thesis")


@pytest.mark.trial
def test_the_command_alone_just_works(ares):
    done = ares("fly", *LAW, "--json", "--no-record", "--nav-period", "1")
    assert done.returncode == 0, done.stderr
    flight = json.loads(done.stdout)
    assert flight["guidance"] == "peg_thesis"
    assert flight["diagnostics"] == []
    assert abs(flight["insertion_error"]["radius_m"]) <= 10.0
    assert abs(flight["insertion_error"]["speed_m_s"]) <= 0.5
    assert abs(flight["insertion_error"]["flight_path_angle_deg"]) <= 1e-3
    assert flight["m_f_kg"] == pytest.approx(174_027.0, abs=20.0)


@pytest.mark.parametrize("layout", [[], ["--in-process"]], ids=["processes", "one_process"])
def test_a_mission_of_another_kind_is_one_line_and_exit_2(ares, layout):
    done = ares("fly", *LAW, "--no-record", "--mission", "delta_iii", *layout)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "two stages" in done.stderr
