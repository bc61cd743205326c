# SPDX-License-Identifier: Apache-2.0
"""The optimizer's service in a graph, and guidance that calls it, in time or not."""

import math
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.action import ActionClient
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node

from ares_guidance.messages import _trajectory
from ares_guidance.node import GuidanceNode
from ares_models.mission import MISSION
from ares_msgs.action import OptimizeTrajectory
from ares_msgs.msg import FlightEvent, GuidanceStatus, NavState
from ares_msgs.srv import SolveTrajectory
from ares_node.qos import FLIGHT
from ares_optimizer import messages
from ares_optimizer.messages import ERROR_CODES
from ares_optimizer.node import OptimizerNode
from ares_optimizer.solution import Cause, Status, failed
from ares_vehicle_sim.node import VehicleSimNode

Response = SolveTrajectory.Response
Result = OptimizeTrajectory.Result
SOLVE = "solve_trajectory"
LISTS = ("arc_", "steering_", "sample_")


def load_mission_text(name):
    return MISSION.find(name).read_text()


def serve(graph, **parameters):
    """Start the optimizer; a function that asks it."""
    graph.start(OptimizerNode, **parameters)
    client = graph.observer.create_client(SolveTrajectory, "solve_trajectory")
    graph.spin(client.service_is_ready)

    def ask(count=1, **fields):
        calls = [client.call_async(SolveTrajectory.Request(**fields)) for _ in range(count)]
        graph.spin(lambda: all(call.done() for call in calls))
        answers = [call.result() for call in calls]
        return answers if count > 1 else answers[0]

    return ask


@pytest.fixture
def served(graph):
    """Start a graph with the optimizer; return a function that calls it."""
    return serve(graph)


def test_the_optimum_is_served_whole(served):
    answer = served(mission="ares_v", method="direct11")
    assert answer.error_code == Response.NONE, answer.message
    assert answer.converged
    assert answer.final_mass == pytest.approx(174_183.1, abs=0.5)
    assert answer.jettison_time == pytest.approx(416.64, abs=0.1)
    assert answer.cutoff_time == pytest.approx(766.907, abs=0.005)
    assert list(answer.arc_end_time)[:-1] == pytest.approx(list(answer.arc_start_time)[1:])
    directions = np.reshape(answer.steering_direction, (-1, 3))
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
    positions = np.reshape(answer.sample_position, (-1, 3))
    assert len(positions) == len(answer.sample_time) == len(answer.sample_mass)
    assert np.linalg.norm(positions[-1]) == pytest.approx(6_518_889.0, abs=1.0)


def test_a_plan_by_legs_is_served_and_read_as_one(monkeypatch):
    found = messages.solve_once
    asked = SolveTrajectory.Request(mission="ares_v")
    service = messages.RequestServer("ares_v", "indirect", 10.0)
    assert not service.answer(asked).by_legs

    def by_legs(*given, **more):
        return replace(found(*given, **more), by_legs=True)

    monkeypatch.setattr(messages, "solve_once", by_legs)
    assert _trajectory(service.answer(asked)).by_legs


def test_a_request_that_names_nothing_gets_the_nodes_mission(served):
    answer = served()
    assert answer.error_code == Response.NONE
    assert answer.method == "auto"
    assert answer.final_mass == pytest.approx(174_183.1, abs=0.5)


NO_STATE = NavState(mass=math.nan)


@pytest.mark.parametrize(
    ("fields", "code", "text"),
    [
        ({"method": "magic"}, Response.UNKNOWN_METHOD, "method is 'magic'; expected one of"),
        ({"mission": "ares_vi"}, Response.INVALID_MISSION, "mission is 'ares_vi'; expected"),
        (
            {"mission": "/etc/passwd"},
            Response.INVALID_MISSION,
            "mission is '/etc/passwd'; ",
        ),
        ({"mission": "/"}, Response.INVALID_MISSION, "mission is '/'; expected the server's own"),
        ({"mission_text": "a: 1\n"}, Response.INVALID_MISSION, "mission_text: line 1: a is not a"),
        ({"mission_text": "a" * 300_000}, Response.INVALID_MISSION, "is larger than 262144 bytes"),
        ({"mission": "ares_v", "mission_text": "a: 1"}, Response.INVALID_MISSION, "one of them"),
        ({"use_nav_state": True}, Response.INVALID_STATE, "state."),
        ({"use_nav_state": True, "nav_state": NO_STATE}, Response.INVALID_STATE, "state."),
        (
            {"mission": "delta_iii", "method": "analytic"},
            Response.UNFIT_METHOD,
            "method analytic takes",
        ),
        ({"time_limit": -1.0}, Response.INVALID_TIME_LIMIT, "time_limit is -1 s; expected"),
        ({"time_limit": math.nan}, Response.INVALID_TIME_LIMIT, "time_limit is nan s"),
        ({"time_limit": math.inf}, Response.INVALID_TIME_LIMIT, "time_limit is inf s"),
    ],
)
def test_a_bad_request_gets_a_code_a_line_and_no_numbers(served, fields, code, text):
    answer = served(**fields)
    assert answer.error_code == code
    assert text in answer.message
    assert "\n" not in answer.message
    assert not answer.converged
    assert answer.method == ""
    assert (answer.iterations, answer.solve_time) == (0, 0.0)
    assert all(math.isnan(x) for x in (answer.jettison_time, answer.cutoff_time, answer.final_mass))
    lists = [name for name in answer.get_fields_and_field_types() if name.startswith(LISTS)]
    assert len(lists) == 13
    assert not any(len(getattr(answer, name)) for name in lists)


@pytest.mark.parametrize(
    ("status", "code"),
    [
        (Status.INFEASIBLE, Response.INFEASIBLE),
        (Status.ITERATION_LIMIT, Response.NOT_CONVERGED),
        (Status.TIME_LIMIT, Response.TIME_LIMIT),
    ],
)
def test_the_error_code_follows_from_the_status(served, monkeypatch, status, code):
    """Derive the code neither from the text of the reason nor from the duration."""
    cause = Cause(status, "it did not converge, they say")

    def late(*_args, **_options):
        time.sleep(0.05)
        return failed("direct11", cause)

    monkeypatch.setattr("ares_optimizer.messages.solve_once", late)
    answer = served(method="direct11", time_limit=0.01)
    assert answer.error_code == code
    assert answer.message == cause.reason
    assert not answer.converged


def test_every_failure_has_its_code():
    assert set(ERROR_CODES) == set(Status) - {Status.CONVERGED, Status.FEASIBLE}
    assert Response.NONE not in ERROR_CODES.values()


def test_the_own_file_is_read_again_when_it_has_changed_and_never_quoted(graph, tmp_path, capfd):
    path = tmp_path / "mine.yaml"
    text = load_mission_text("ares_v").replace("name: ares_v", "name: mine", 1)
    path.write_text(text)
    served = serve(graph, mission=str(path))
    before = served()
    assert before.error_code == Response.NONE, before.message
    assert served(mission="mine").final_mass == before.final_mass
    assert served(mission=str(path)).final_mass == before.final_mass
    path.write_text("secret: 1\n")
    answer = served()
    assert answer.error_code == Response.INVALID_MISSION
    assert answer.message == "the server's own mission cannot be read any more"
    assert "secret is not a known key" in capfd.readouterr().err
    path.write_text(text + "\n")
    assert served().final_mass == before.final_mass


def test_a_mission_is_served_by_its_text(served):
    answer = served(mission_text=load_mission_text("delta_iii"), method="direct11")
    assert answer.error_code == Response.NONE, answer.message
    assert answer.final_mass == served(mission="delta_iii", method="direct11").final_mass


def optimize(graph, **goal):
    """Call the action; return its result and feedback."""
    told = []
    client = ActionClient(graph.observer, OptimizeTrajectory, "optimize_trajectory")
    graph.spin(client.server_is_ready)
    asked = client.send_goal_async(
        OptimizeTrajectory.Goal(**goal), feedback_callback=lambda word: told.append(word.feedback)
    )
    graph.spin(asked.done)
    return asked.result(), told


def test_the_action_tells_how_it_goes_on_and_answers_as_the_service(graph):
    served = serve(graph)
    goal, told = optimize(graph, method="collocation", time_limit=240.0)
    assert goal.accepted
    answer = goal.get_result_async()
    graph.spin(answer.done)
    assert answer.result().status == GoalStatus.STATUS_SUCCEEDED
    result = answer.result().result
    assert result.error_code == Result.NONE
    assert result.final_mass == pytest.approx(served(method="direct11").final_mass, abs=0.5)
    graph.spin(lambda: bool(told))
    assert {word.method for word in told} <= {"collocation", "direct", "indirect"}


def test_goal_and_result_have_the_fields_of_the_service():
    service, action = SolveTrajectory, OptimizeTrajectory
    of = {
        kind: kind.get_fields_and_field_types()
        for kind in (service.Request, service.Response, action.Goal, action.Result)
    }
    assert of[service.Request] == of[action.Goal]
    assert of[service.Response] == of[action.Result]
    codes = [name for name in dir(type(Response)) if name.isupper() and name[0] != "_"]
    assert len(codes) == 11
    for name in codes:
        assert getattr(Response, name) == getattr(Result, name), name


#: Takes minutes: every start that there is, each to its end.
LONG = {"mission": "delta_iii_coast", "method": "collocation", "time_limit": 3600.0}


def test_a_search_is_cancelled(graph):
    serve(graph)
    goal, told = optimize(graph, **LONG)
    graph.spin(lambda: bool(told))
    canceled = goal.cancel_goal_async()
    answer = goal.get_result_async()
    graph.spin(answer.done)
    assert canceled.result().goals_canceling
    assert answer.result().status == GoalStatus.STATUS_CANCELED
    assert answer.result().result.error_code == Result.CANCELED
    assert not answer.result().result.converged


@pytest.mark.parametrize("by", ["service", "action"])
def test_a_manager_is_answered_while_a_search_runs(graph, by):
    """Call the manager's services during a search that would last an hour."""
    node = graph.start(OptimizerNode)
    states = graph.observer.create_client(GetState, "optimizer/get_state")
    change = graph.observer.create_client(ChangeState, "optimizer/change_state")
    client = graph.observer.create_client(SolveTrajectory, SOLVE)
    graph.spin(lambda: client.service_is_ready() and change.service_is_ready())
    begun = threading.Event()
    solve = node._answers.answer

    def slow(request, deadline, kind):
        begun.set()
        while not deadline.passed:
            time.sleep(0.001)
        stopped.wait(240.0)
        return solve(request, deadline, kind)

    stopped = threading.Event()
    node._answers.answer = slow
    if by == "service":
        asked = client.call_async(SolveTrajectory.Request(time_limit=3600.0))
    else:
        goal, _ = optimize(graph, time_limit=3600.0)
        asked = goal.get_result_async()
    graph.spin(begun.is_set)
    state = states.call_async(GetState.Request())
    graph.spin(state.done)
    assert state.result().current_state.label == "active"
    request = ChangeState.Request()
    request.transition.id = Transition.TRANSITION_DEACTIVATE
    changed = change.call_async(request)
    graph.spin(changed.done)
    # it is answered, and who asked too, while the search still runs
    assert changed.result().success
    graph.spin(asked.done)
    answer = asked.result() if by == "service" else asked.result().result
    assert answer.error_code == Response.NOT_ACTIVE
    assert not stopped.is_set()
    stopped.set()


def test_a_real_search_lets_a_manager_be_answered(graph):
    node = graph.start(OptimizerNode)
    change = graph.observer.create_client(ChangeState, "optimizer/change_state")
    goal, told = optimize(graph, **LONG)
    graph.spin(lambda: bool(told) and change.service_is_ready())
    request = ChangeState.Request()
    request.transition.id = Transition.TRANSITION_DEACTIVATE
    changed, answer = change.call_async(request), goal.get_result_async()
    graph.spin(lambda: changed.done() and answer.done())
    assert changed.result().success
    assert answer.result().status == GoalStatus.STATUS_ABORTED
    assert answer.result().result.error_code == Result.NOT_ACTIVE
    assert node._service is None
    goal, _ = optimize(graph)
    assert not goal.accepted
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert node.start(), node.failure


@pytest.mark.parametrize("method", ["direct11", "indirect"])
def test_there_is_no_thrust_direction_on_a_coast(served, method):
    answer = served(mission="ares_v_transients", method=method)
    assert answer.error_code == Response.NONE, answer.message
    coasts = np.array(answer.arc_delta_v) == 0.0
    assert coasts.any() and not coasts.all()
    steering = np.reshape(answer.steering_direction, (-1, 3))
    assert (np.isnan(steering).all(axis=1) == coasts).all()
    assert (np.isnan(answer.steering_reference_time) == coasts).all()
    times = np.array(answer.sample_time)
    silent = np.isnan(np.reshape(answer.sample_direction, (-1, 3))).all(axis=1)
    for begin, end, coast in zip(answer.arc_start_time, answer.arc_end_time, coasts, strict=True):
        inside = (times > begin + 1e-6) & (times < end - 1e-6)
        assert (silent[inside] == coast).all()


def test_the_service_is_listed_only_where_it_is_served(graph):
    def listed():
        found = graph.observer.get_service_names_and_types()
        return any(name.endswith(SOLVE) for name, _ in found)

    graph.start(GuidanceNode)
    node = graph.start(OptimizerNode)
    graph.spin(listed)
    node.trigger_deactivate()
    graph.spin(lambda: not listed())
    node.trigger_activate()
    graph.spin(listed)


def test_who_waits_for_an_optimizer_that_is_deactivated_is_told(graph):
    node = graph.start(OptimizerNode)
    client = graph.observer.create_client(SolveTrajectory, SOLVE)
    graph.spin(client.service_is_ready)
    # what has come and is not worked on yet is answered too
    calls = [client.call_async(SolveTrajectory.Request()) for _ in range(3)]
    time.sleep(0.5)
    node.trigger_deactivate()
    graph.spin(lambda: all(call.done() for call in calls))
    codes = {call.result().error_code for call in calls}
    assert codes <= {Response.NOT_ACTIVE, Response.NONE}
    graph.spin(lambda: not client.service_is_ready())
    node.trigger_activate()
    graph.spin(client.service_is_ready)
    last = client.call_async(SolveTrajectory.Request())
    graph.spin(last.done)
    assert last.result().converged


def test_requests_at_the_same_time_are_all_answered(served):
    answers = served(count=5, method="direct11")
    assert len(answers) == 5
    assert all(answer.converged for answer in answers)


def fly(graph, **parameters):
    statuses = []
    graph.observer.create_subscription(GuidanceStatus, "guidance_status", statuses.append, FLIGHT)
    graph.start(GuidanceNode, initial_guess="optimizer", **parameters)
    # a slow machine is not a lost command; navigation as often as guidance needs it
    graph.start(VehicleSimNode, command_timeout_s=60.0, navigation_period_s=1.0)
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    cutoff = next(event for event in graph.events if event.type == FlightEvent.CUTOFF)
    assert np.linalg.norm(cutoff.position) == pytest.approx(6_518_889.0, abs=1.0)
    assert np.linalg.norm(cutoff.velocity) == pytest.approx(7840.675, abs=0.01)
    return statuses


def test_guidance_starts_from_the_optimizers_guess(graph):
    graph.start(OptimizerNode)
    statuses = fly(graph, optimizer_timeout_s=60.0)
    # 8 from the navigation state alone
    assert statuses[0].iterations < 8
    assert graph.reports == ["ares/guidance: starting from the optimizer's answer"]


def test_guidance_flies_without_an_optimizer(graph):
    statuses = fly(graph, optimizer_timeout_s=0.3)
    assert statuses[0].converged
    graph.wait_for_report("optimizer: no such service on the graph; starting from the navigation")


@pytest.mark.parametrize(
    ("answer", "complaint"),
    [
        (None, "no answer within"),
        (Response(error_code=Response.INFEASIBLE, message="no way"), "optimizer: no way"),
        (Response(), "unusable answer"),
        (
            Response(
                arc_start_time=[155.9],
                arc_end_time=[760.0],
                arc_delta_v=[math.nan],
                steering_reference_time=[155.9],
                steering_direction=[1.0, 0.0, 0.0],
                steering_direction_rate=[0.0, 0.0, 0.0],
            ),
            "unusable answer",
        ),
        (
            Response(arc_delta_v=[1.0, 2.0], arc_start_time=[1.0]),
            "unusable answer",
        ),
    ],
    ids=["late", "refused", "empty", "nan", "lists of different length"],
)
def test_guidance_flies_without_a_late_or_wrong_answer(graph, answer, complaint):
    server = graph.observer
    if answer is None:
        # it is on the graph, but nobody spins it
        server = Node("optimizer", namespace="ares", context=graph.context)
    server.create_service(SolveTrajectory, "solve_trajectory", lambda _request, _response: answer)
    try:
        # an answer that comes is waited for; one that never comes is not
        statuses = fly(graph, optimizer_timeout_s=0.5 if answer is None else 60.0)
    finally:
        if server is not graph.observer:
            server.destroy_node()
    assert statuses[0].converged
    graph.wait_for_report(complaint)
