# SPDX-License-Identifier: Apache-2.0
"""Test the bounds on memory, time and work of the searches, for any mission."""

import math
from itertools import product

import numpy as np
import pytest

from ares_models.arrays import COAST, LONGEST_FLIGHT
from ares_models.mission import load_mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.kernels import sqp
from ares_optimizer.direct.kernels.evaluate import evaluate, make_point, make_scratch, most_breaks
from ares_optimizer.direct.kernels.scratch import BREAKS, STORED
from ares_optimizer.direct.search import MOST_CUTS, own_starts, run, splits_for
from ares_optimizer.direct.transcription import transcribe
from ares_optimizer.indirect.solver import TwoPointSolver
from ares_optimizer.registry import METHODS
from ares_optimizer.solution import OUT_OF_TIME, OptimizerError
from ares_optimizer.solve import solve
from ares_optimizer.two_point.kernels import newton

ALSO = pytest.mark.trial
DIRECT = ("direct11", "direct14", "direct20", "jump")


def with_long_coast(seconds):
    """Return Apollo's Saturn V with a last coast of given length."""
    mission = load_mission("saturn_v_as506")
    arrays = mission.arrays()
    coasts = np.flatnonzero(arrays.arcs["kind"] == COAST)
    arrays.arcs["duration"][coasts[-1]] = seconds
    return arrays, mission.start().navigation()


#: Methods that take long for a coast of this length.
SLOW = {("collocation", 1e5), ("auto", 1e5)}


@pytest.mark.parametrize(
    ("method", "seconds"),
    [
        # auto tries collocation, and each takes 5 s or more
        pytest.param(
            *each,
            marks=[] if each[1] in (1e5, 1e300) and each not in SLOW else [ALSO],
        )
        for each in product(METHODS, (1e5, 1e300, 4e3, 4e4, 1e9))
    ],
)
def test_a_coast_of_any_length_is_answered(method, seconds):
    """Replay a coast of 1e5 s: 222 laws once overran 128 events."""
    arrays, start = with_long_coast(seconds)
    if seconds > LONGEST_FLIGHT and method in DIRECT:
        with pytest.raises(
            OptimizerError, match=r"^(the last burn begins|no flight can be computed)"
        ):
            solve(arrays, method, state=start)
        return
    solution = solve(arrays, method, state=start, time_limit_s=1.0)
    assert not solution.converged
    assert solution.reason
    assert "\n" not in solution.reason


@pytest.mark.trial
def test_a_flight_through_the_centre_is_answered():
    """Replay an IndexError: the proof had no states beyond the centre."""
    mission = load_mission("falcon9_gto")
    state = mission.start().navigation()
    state["velocity"][0] *= 285.7393 / np.linalg.norm(state["velocity"][0])
    solution = solve(mission, "direct20", state=state, time_limit_s=60.0)
    assert not solution.converged
    assert solution.reason and "\n" not in solution.reason


def test_an_overlong_flight_has_few_cuts():
    arrays, start = with_long_coast(4e4)
    transcription = transcribe(arrays, start[0], "direct11")
    found = run(transcription, own_starts(transcription, Deadline())[0], 1.0, Deadline())
    found.variables[-1] = 500.0
    assert 0 < len(splits_for(found)) <= MOST_CUTS


@pytest.mark.parametrize("method", DIRECT)
@pytest.mark.parametrize("cuts", [0, 300])
def test_there_is_room_for_every_event_and_step(method, cuts):
    """Allocate as many events and steps as the problem needs, without a fixed maximum."""
    arrays, start = with_long_coast(4e3)
    now = float(start["time"][0])
    splits = tuple(now + 1.0 + 10.0 * k for k in range(cuts))
    problem = transcribe(arrays, start[0], method, splits=splits).problem
    scratch, point = make_scratch(problem), make_point(problem)
    p = np.full(problem.variables, 0.1)
    p[-1] = (problem.latest_cutoff - problem.start_time) / 100.0
    evaluate(p, problem, scratch, point)
    count, nodes = int(scratch.counts[BREAKS]), int(scratch.counts[STORED])
    steps = scratch.breaks[:count, 3]
    assert count <= most_breaks(problem) == len(scratch.times)
    assert nodes == steps.sum() + np.count_nonzero(steps)
    assert nodes <= len(scratch.nodes)
    assert scratch.nodes[nodes - 1, 0] == pytest.approx(scratch.final[0])


def test_a_flag_ends_a_direct_search():
    mission = load_mission("ares_v")
    transcription = transcribe(mission.arrays(), mission.start().navigation()[0], "direct11")
    guess = own_starts(transcription, Deadline())[0]
    stopped = Deadline()
    stopped.flag[0] = 1
    assert run(transcription, guess, 1.0, stopped).end == sqp.STOPPED
    assert run(transcription, guess, 1.0, Deadline()).converged


def test_a_flag_or_spent_work_ends_a_two_point_search():
    mission = load_mission("ares_v")
    start = mission.start().navigation()
    solver = TwoPointSolver(mission.arrays())
    assert solver.solve(start).converged
    solver.work["stop"] = 1
    assert solver.solve(start).status == newton.STOPPED
    solver.work["stop"] = 0
    solver.options["max_steps"] = 200
    assert solver.solve(start).status == newton.STOPPED
    assert 200 <= solver.work["spent"][0] < 5000
    solver.options["max_steps"] = 0
    assert solver.solve(start).converged


def test_a_failed_search_leaves_finite_unknowns():
    arrays, start = with_long_coast(1e9)
    root = TwoPointSolver(arrays).solve(start)
    assert not root.converged
    assert np.isfinite(root.unknowns).all()


def test_a_deadline_sets_the_flags_of_kernels():
    flag = np.zeros(1, np.int64)
    with Deadline(0.0) as deadline:
        deadline.watch(flag)
        while not (deadline.flag[0] and flag[0]):
            pass
    assert deadline.passed


def test_a_deadline_left_in_time_sets_none():
    with Deadline(1e-2) as deadline:
        pass
    while not deadline.passed:
        pass
    assert deadline.flag[0] == 0


@pytest.mark.parametrize("seconds", [None, math.inf, 1e300])
def test_a_deadline_far_away_needs_no_thread(seconds):
    with Deadline(seconds) as deadline:
        assert not deadline.passed
        assert deadline.within(3600.0).end <= deadline.end


def test_a_nearer_deadline_cuts_no_search_short():
    with Deadline(3600.0) as deadline:
        nearer = deadline.within(0.0)
        assert nearer.passed
        assert nearer.flag is deadline.flag
        assert nearer.flag[0] == 0


@pytest.mark.parametrize("method", ["collocation", "direct11", "direct20", "indirect"])
def test_a_search_tells_how_it_goes_on(method):
    told = []
    solution = solve(load_mission("ares_v"), method, deadline=Deadline(60.0, told.append))
    assert solution.converged
    assert {word.method for word in told} >= {method.rstrip("0123456789")}
    assert all(word.iterations >= 0 and word.violation >= 0.0 for word in told)
    known = [word.m_f_kg for word in told if not math.isnan(word.m_f_kg)]
    assert method == "indirect" or known[-1] == pytest.approx(solution.m_f_kg, abs=1.0)


def test_a_search_ends_when_another_thread_says_so():
    deadline = Deadline(3600.0)
    deadline.report = lambda _progress: deadline.end_now()
    solution = solve(load_mission("delta_iii_coast"), "collocation", deadline=deadline)
    assert deadline.passed
    assert not solution.converged


@pytest.mark.parametrize("method", METHODS)
def test_no_time_at_all(method):
    solution = solve(load_mission("ares_v"), method, time_limit_s=0.0)
    assert not solution.converged
    assert solution.reason == OUT_OF_TIME.reason
