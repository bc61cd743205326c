# SPDX-License-Identifier: Apache-2.0
"""Free arcs through the nodes: guidance requests its plan, and flies it."""

import re
import time
from contextlib import ExitStack
from threading import Event, Thread

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ares_bringup import shared_plans
from ares_bringup.facts import facts_of
from ares_bringup.monitor import FlightMonitor
from ares_bringup.summary import FlightSummary
from ares_guidance.node import GuidanceNode
from ares_models.mission import load_mission
from ares_msgs.msg import FlightEvent, ThrustCommand
from ares_msgs.srv import SolveTrajectory
from ares_node.qos import FLIGHT
from ares_optimizer import kept
from ares_optimizer.messages import RequestServer
from ares_optimizer.registry import SHARED_SOLUTIONS
from ares_optimizer.solve import solve
from ares_studies.closed_loop import offline_trajectory
from ares_trials.testing.laws import RESTART
from ares_vehicle_sim.node import VehicleSimNode

Response = SolveTrajectory.Response
BURN, COAST = 153.252950, 450.0


def answer_of(mission):
    """Return the optimum of a mission as the service does."""
    solution = offline_trajectory(solve(mission, "indirect", verify=False))
    fields = {
        name: np.ravel(value).tolist() if isinstance(value, np.ndarray) else value
        for name, value in vars(solution).items()
    }
    return Response(**fields)


@pytest.fixture(scope="module")
def missions(tmp_path_factory):
    """Return the mission with a free burn and coast, and the same with the lengths of a plan."""
    folder = tmp_path_factory.mktemp("missions")
    paths = {}
    for name, times in (("fixed", (BURN, COAST)), ("free", ("free", "free"))):
        paths[name] = folder / f"{name}.yaml"
        paths[name].write_text(RESTART.format(burn=times[0], coast=times[1]))
    return {name: str(path) for name, path in paths.items()}


@pytest.fixture(scope="module")
def plan(missions):
    return answer_of(load_mission(missions["fixed"]))


def distorted(plan, **values):
    """Replace some fields of an answer."""
    fields = {name: getattr(plan, name) for name in plan.get_fields_and_field_types()}
    return Response(**{**fields, **values})


def no_plan(code=Response.NOT_CONVERGED, message="not yet"):
    return Response(error_code=code, message=message)


class Optimizer:
    """Answer in a thread of its own, while the flight goes on.

    Attributes:
        answers: one after the other, the last repeated; a function gets the request.
        requests: requests received.
        free: answer if set, else wait.
    """

    def __init__(self, context, *answers):
        self.answers = answers
        self.requests = []
        self.free = Event()
        self.free.set()
        self._node = Node("optimizer", namespace="ares", context=context)
        self._node.create_service(SolveTrajectory, "solve_trajectory", self._serve)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._thread = Thread(target=self._executor.spin)
        self._thread.start()

    def _serve(self, request, _response):
        self.requests.append(request)
        self.free.wait(60.0)
        answer = self.answers[min(len(self.requests), len(self.answers)) - 1]
        return answer(request) if callable(answer) else answer

    def close(self):
        self.free.set()
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()


@pytest.fixture
def optimizer(ros_context):
    with ExitStack() as held:

        def start(*answers):
            made = Optimizer(ros_context, *answers)
            held.callback(made.close)
            return made

        yield start


def flown(graph):
    return any(event.type == FlightEvent.FLIGHT_COMPLETE for event in graph.events)


def wait(graph, seconds):
    begun = time.monotonic()
    graph.spin(lambda: time.monotonic() - begun > seconds)


def is_refused(graph, simulator):
    """Spin until the flight is refused, before ignition and with one line; return the line."""
    graph.spin(lambda: simulator.done)
    assert simulator.exit_code == 2
    assert not graph.events
    assert "\n" not in simulator.failure
    return simulator.failure


def test_the_flight_waits_for_its_plan(graph, missions, plan, optimizer):
    """Delay the plan: the first state is published, and nothing ignites."""
    asked = optimizer(plan)
    asked.free.clear()
    commands = []
    graph.observer.create_subscription(ThrustCommand, "thrust_command", commands.append, FLIGHT)
    graph.start(GuidanceNode, mission=missions["free"])
    simulator = graph.start(
        VehicleSimNode, mission=missions["free"], navigation_period_s=1.0, command_timeout_s=0.05
    )
    graph.spin(lambda: asked.requests and graph.states)
    # ten times the patience of a flight that has begun
    wait(graph, 0.5)
    assert [state.sequence for state in graph.states] == [0]
    assert not graph.events
    assert not commands
    # no answer is missed on a busy machine
    simulator._flight.link.timeout_s = 60.0
    asked.free.set()
    graph.spin(lambda: flown(graph))
    assert simulator.simulator.ended_well
    assert np.linalg.norm(graph.events[-1].position) == pytest.approx(6556000.0, abs=1.0)
    assert [request.method for request in asked.requests] == [""]
    assert [state.sequence for state in graph.states] == list(range(len(graph.states)))
    assert commands[0].nav_stamp == graph.states[0].stamp
    kinds = {event.type for event in graph.events}
    assert not kinds & {FlightEvent.GUIDANCE_LOST, FlightEvent.GUIDANCE_BACK}
    # one entry per arc: stage one, burn, coast, burn
    first, last = commands[0], commands[-1]
    assert len(first.arc_end_times) == 4
    assert np.isnan(first.arc_end_times).tolist() == [True, False, False, True]
    assert np.all(np.isnan(last.arc_end_times))
    ended = [event for event in graph.events if event.type == FlightEvent.ARC_ENDED]
    assert ended[2].time - ended[1].time == pytest.approx(COAST, abs=1e-6)


def test_a_paced_flight_counts_its_pace_from_the_plan(graph, missions, plan, optimizer):
    asked = optimizer(plan)
    asked.free.clear()
    graph.start(GuidanceNode, mission=missions["free"])
    graph.start(VehicleSimNode, mission=missions["free"], pace=1.0, command_timeout_s=60.0)
    graph.spin(lambda: asked.requests)
    wait(graph, 1.0)
    assert len(graph.states) == 1
    begun = time.monotonic()
    asked.free.set()
    graph.spin(lambda: len(graph.states) > 5)
    # the wait is not made up for
    assert time.monotonic() - begun > 0.5 * (len(graph.states) - 1) * 0.1
    assert not graph.reported("behind its pace")


def test_the_plan_is_told_before_the_flight(graph, missions, plan, optimizer):
    optimizer(distorted(plan, method="indirect", final_mass=7123.46))
    said = []
    summary = FlightSummary(facts_of(load_mission(missions["free"])), "peg", None, 77)
    monitor = FlightMonitor(graph.observer, summary, said.append)
    graph.start(GuidanceNode, mission=missions["free"], flight_id=77)
    graph.start(VehicleSimNode, mission=missions["free"], flight_id=77, expected_judges=1)
    graph.spin(lambda: said and summary.started)
    (line,) = said
    start = "plan taken, by method indirect: 7,123.5 kg after the last cut-off, no coast below "
    assert line.startswith(start)
    # no lower than the ground, no higher than where it begins and ends
    lowest = float(line.removeprefix(start).removesuffix(" km"))
    at_ends = [
        np.linalg.norm(plan.sample_position[3 * k : 3 * k + 3]) - 6.2e6
        for k in (
            int(np.argmin(np.abs(np.array(plan.sample_time) - time_s)))
            for time_s in (plan.flown_start_time[2], plan.flown_end_time[2])
        )
    ]
    assert 0.0 < lowest <= min(at_ends) / 1e3 + 0.05
    monitor.leave()


@pytest.mark.parametrize("pace", [0.0, 1.0])
@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (Response.NOT_CONVERGED, "the search stalled"),
        (Response.INFEASIBLE, "the target is 300 m/s beyond the propellant"),
        (Response.UNFIT_METHOD, "the method holds no free coasts"),
        (Response.TIME_LIMIT, "no solution within 120 s"),
        (Response.INTERNAL, "ValueError: what nobody thought of"),
    ],
)
def test_nothing_is_lit_without_a_plan(graph, missions, optimizer, code, reason, pace):
    optimizer(no_plan(code, reason))
    guidance = graph.start(GuidanceNode, mission=missions["free"])
    simulator = graph.start(VehicleSimNode, mission=missions["free"], pace=pace)
    why = is_refused(graph, simulator)
    free = r"law peg needs one for what the mission leaves free, arc 1 \(.+\) and arc 2 \(.+\)"
    assert re.search(f"no plan was found: {reason}; {free}", why)
    # it can fly another
    assert not guidance.done


def test_guidance_without_a_plan_flies_the_next_flight(graph, missions, plan, optimizer):
    optimizer(no_plan(), plan)
    graph.start(GuidanceNode, mission=missions["free"])
    first = graph.start(VehicleSimNode, mission=missions["free"])
    is_refused(graph, first)
    first.stop()
    graph.executor.remove_node(first)
    graph.start(VehicleSimNode, mission=missions["free"], navigation_period_s=1.0)
    graph.spin(lambda: flown(graph))


def test_an_answer_that_cannot_be_used_is_no_plan(graph, missions, plan, optimizer):
    optimizer(distorted(plan, cutoff_time=-1.0))
    graph.start(GuidanceNode, mission=missions["free"])
    simulator = graph.start(VehicleSimNode, mission=missions["free"])
    assert "unusable answer: cutoff_time is -1.0" in is_refused(graph, simulator)


def test_a_plan_through_the_ground_is_not_flown(graph, missions, plan, optimizer):
    """Distort a plan: its samples are above the ground, the coast between them is not."""
    position, velocity = (
        np.reshape(getattr(plan, f"sample_{name}"), (-1, 3)) for name in ("position", "velocity")
    )
    coasts = np.abs(np.array(plan.sample_time) - plan.flown_end_time[1]) < 1e-3
    radius = np.linalg.norm(position, axis=1)
    assert np.min(radius) > 6.2e6
    falling = velocity - 1500.0 * position / radius[:, None]
    velocity = np.where(coasts[:, None], falling, velocity)
    optimizer(distorted(plan, sample_velocity=velocity.ravel().tolist()))
    graph.start(GuidanceNode, mission=missions["free"])
    simulator = graph.start(VehicleSimNode, mission=missions["free"])
    assert "arc 2 (stage 2), a coast, goes through the ground, " in is_refused(graph, simulator)


def test_an_optimizer_that_never_comes_ends_the_count(graph, missions):
    graph.start(GuidanceNode, mission=missions["free"], plan_timeout_s=0.3)
    simulator = graph.start(VehicleSimNode, mission=missions["free"])
    assert "no such service on the graph" in is_refused(graph, simulator)


def test_an_optimizer_that_hangs_ends_the_count(graph, missions, plan, optimizer):
    asked = optimizer(plan)
    asked.free.clear()
    graph.start(GuidanceNode, mission=missions["free"], plan_timeout_s=0.5)
    simulator = graph.start(VehicleSimNode, mission=missions["free"])
    assert "no answer within 0." in is_refused(graph, simulator)
    assert [request.time_limit for request in asked.requests] == [0.5]


def test_the_count_is_not_held_for_ever(graph, missions, plan, optimizer):
    asked = optimizer(plan)
    asked.free.clear()
    graph.start(GuidanceNode, mission=missions["free"])
    simulator = graph.start(VehicleSimNode, mission=missions["free"], start_timeout_s=1.0)
    assert "guidance has no plan after" in is_refused(graph, simulator)


def test_guidance_that_leaves_while_it_plans_ends_the_count(graph, missions, plan, optimizer):
    asked = optimizer(plan)
    asked.free.clear()
    guidance = graph.start(GuidanceNode, mission=missions["free"])
    simulator = graph.start(VehicleSimNode, mission=missions["free"])
    graph.spin(lambda: asked.requests)
    guidance.stop()
    assert "/ares/guidance has left while it planned" in is_refused(graph, simulator)


def restarted(graph, first, missions, **parameters):
    """Replace the first guidance by another."""
    first.stop()
    graph.executor.remove_node(first)
    graph.start(GuidanceNode, mission=missions["free"], **parameters)


def test_guidance_restarted_in_flight_asks_until_it_has_a_plan(graph, missions, optimizer, plan):
    """Restart guidance: it requests a plan while the flight goes on by the last command."""
    first = graph.start(GuidanceNode, mission=missions["free"])
    asked = optimizer(plan, no_plan())
    simulator = graph.start(
        VehicleSimNode, mission=missions["free"], navigation_period_s=1.0, command_timeout_s=2.0
    )
    graph.spin(lambda: len(graph.states) > 320)
    assert graph.states[-1].arc == 2
    restarted(graph, first, missions, optimizer_timeout_s=0.01)
    graph.spin(lambda: flown(graph))
    assert graph.reported("optimizer: not yet; law peg needs its plan: asking again")
    begins = [request.nav_state.sequence for request in asked.requests]
    assert len(begins) > 2
    assert begins[0] == 0
    assert begins[1] > 320
    assert begins[-1] > begins[1]
    assert simulator.simulator.ended_well
    ended = [event for event in graph.events if event.type == FlightEvent.ARC_ENDED]
    assert ended[2].time - ended[1].time == pytest.approx(COAST, abs=1e-6)


def test_a_flight_without_pace_waits_for_a_restarted_guidance_that_plans(
    graph, missions, optimizer, plan
):
    first = graph.start(GuidanceNode, mission=missions["free"])
    planner = RequestServer(missions["fixed"], "indirect", 60.0)

    def from_here(request):
        request.mission, request.mission_text = missions["fixed"], ""
        return planner.answer(request)

    asked = optimizer(plan, from_here)
    simulator = graph.start(
        VehicleSimNode, mission=missions["free"], navigation_period_s=1.0, command_timeout_s=1.0
    )
    graph.spin(lambda: len(graph.states) > 200)
    assert graph.states[-1].arc == 1
    asked.free.clear()
    restarted(graph, first, missions)
    graph.spin(lambda: len(asked.requests) > 1)
    # what was on its way has come
    wait(graph, 0.5)
    held = len(graph.states)
    # longer than for an answer
    wait(graph, 1.5)
    assert len(graph.states) == held
    asked.free.set()
    graph.spin(lambda: flown(graph))
    assert simulator.simulator.ended_well
    assert np.linalg.norm(graph.events[-1].position) == pytest.approx(6556000.0, abs=1.0)


@pytest.mark.trial
def test_a_flight_takes_one_search(ares, monkeypatch, tmp_path):
    searches = []
    search = kept.solve
    monkeypatch.setattr(kept, "_kept", type(kept._kept)())
    monkeypatch.setattr(kept, "solve", lambda *a, **k: searches.append(a[1]) or search(*a, **k))
    monkeypatch.delenv(SHARED_SOLUTIONS, raising=False)
    monkeypatch.setattr(shared_plans, "plans_folder", lambda: tmp_path / "plans")
    words = ("fly", "--in-process", "--no-record", "--nav-period", "1")
    done = ares(*words, "--mission", "ariane5_eca")
    assert done.returncode == 0, done.stderr
    assert searches == ["auto"]
    # flights that share a folder find what another process has found
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path / "shared"))
    for _ in range(2):
        kept._kept.clear()
        assert ares(*words, "--mission", "ariane5_eca").returncode == 0
    assert searches == ["auto"] * 2
