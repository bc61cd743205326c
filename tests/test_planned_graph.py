"""Free arcs through the nodes: guidance asks for its plan, and flies it."""

import numpy as np
import pytest

from ares_guidance.node import GuidanceNode
from ares_guidance.testing import RESTART
from ares_models.mission import load_mission
from ares_msgs.msg import FlightEvent, ThrustCommand
from ares_msgs.srv import SolveTrajectory
from ares_node.qos import FLIGHT
from ares_optimizer.solve import solve
from ares_studies.closed_loop import offline_trajectory
from ares_vehicle_sim.node import VehicleSimNode

Response = SolveTrajectory.Response
BURN, COAST = 153.252950, 450.0


def answer_of(mission):
    """The optimum of a mission as the service gives it."""
    solution = offline_trajectory(solve(mission, "indirect", verify=False))
    fields = {
        name: np.ravel(value).tolist() if isinstance(value, np.ndarray) else value
        for name, value in vars(solution).items()
    }
    return Response(**fields)


def test_guidance_asks_until_it_has_its_plan(graph, tmp_path):
    missions = {}
    for name, times in (("fixed", (BURN, COAST)), ("free", ("free", "free"))):
        path = tmp_path / f"{name}.yaml"
        path.write_text(RESTART.format(burn=times[0], coast=times[1]))
        missions[name] = str(path)
    answers = [
        Response(error_code=Response.NOT_CONVERGED, message="not yet"),
        answer_of(load_mission(missions["fixed"])),
    ]
    asked = []

    def serve(request, _):
        asked.append(request.method)
        return answers[min(len(asked), len(answers)) - 1]

    graph.observer.create_service(SolveTrajectory, "solve_trajectory", serve)
    commands = []
    graph.observer.create_subscription(ThrustCommand, "thrust_command", commands.append, FLIGHT)
    graph.start(GuidanceNode, mission=missions["free"], optimizer_timeout_s=0.5)
    simulator = graph.start(
        VehicleSimNode, mission=missions["free"], navigation_period_s=1.0, command_timeout_s=60.0
    )
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    assert asked == ["", ""]
    graph.wait_for_report("optimizer: not yet; law peg needs its plan: asking again")
    assert simulator.simulator.ended_well
    assert np.linalg.norm(graph.events[-1].position) == pytest.approx(6556000.0, abs=1.0)
    # one entry per arc: stage one, burn, coast, burn
    first, last = commands[0], commands[-1]
    assert len(first.arc_end_times) == 4
    assert np.isnan(first.arc_end_times).tolist() == [True, False, False, True]
    assert np.all(np.isnan(last.arc_end_times))
    ended = [event for event in graph.events if event.type == FlightEvent.ARC_ENDED]
    assert ended[2].time - ended[1].time == pytest.approx(COAST, abs=1e-6)
