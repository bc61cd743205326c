# SPDX-License-Identifier: Apache-2.0
"""Solve from states within the flight: the optimum, or a failure with its cause."""

from dataclasses import replace

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.indirect.solver import TwoPointSolver, navigation
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.registry import DIRECT_METHODS, INDIRECT_METHODS
from ares_optimizer.request import Heating, Request
from ares_optimizer.rival import ample_delta_v, beside_rival, find_rival
from ares_optimizer.solution import OUT_OF_TIME, Cause, OptimizerError, Status, failed
from ares_optimizer.solve import solve

SAME_KG = 0.2
LAST_SECOND = (1.0, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05)
TO_GO = (
    600.0,
    500.0,
    430.0,
    429.8,
    400.0,
    355.0,
    350.9,
    350.0,
    250.0,
    150.0,
    50.0,
    20.0,
    10.0,
    3.0,
)
IN_THE_COAST = (530.0, 147.1, 146.9, 146.6, 146.4, 146.1, 142.0)  # of AS-506, and around it


class Optimum:
    """Hold a mission's optimum by direct11 and the states on it."""

    def __init__(self, name):
        self.mission = load_mission(name)
        self.arrays = self.mission.arrays()
        self.solution = solve(self.mission, "direct11")
        arcs = self.solution.arcs
        self.flight = fly(
            self.arrays,
            self.mission.start().navigation()[0],
            steering_of(arcs),
            self.solution.jettison_times_s,
            self.solution.t_meco_s,
            [arc.start_s for arc in arcs],
        )

    def state(self, to_go, error=(0.0,) * 6):
        """Return the state some seconds before cut-off, displaced by ``error`` (m, m/s)."""
        now = self.solution.t_meco_s - to_go
        (y,) = [x.state(now) for x in self.flight.pieces if x.begin <= now < x.end]
        begins = self.mission.start().time_s + np.concatenate(
            ([0.0], np.cumsum(self.arrays.arcs["duration"])[:-1])
        )
        arc = int(np.searchsorted(begins, now, side="right")) - 1
        done = sum(1 << j for j, t in enumerate(self.solution.jettison_times_s) if t <= now)
        return navigation(
            now,
            y[:3] + np.asarray(error[:3]),
            y[3:6] + np.asarray(error[3:]),
            y[6],
            arc=arc,
            arc_start_time_s=begins[arc],
            jettisoned=done,
        )


@pytest.fixture(scope="module")
def ares_v():
    return Optimum("ares_v")


@pytest.fixture(scope="module")
def saturn():
    return Optimum("saturn_v_as506")


def errors(count, metres, seed=1):
    """Return random errors of ``metres`` and a hundredth of that in m/s, per axis."""
    rng = np.random.default_rng(seed)
    scale = np.repeat([metres, 0.01 * metres], 3)
    return rng.normal(size=(count, 6)) * scale


@pytest.mark.parametrize(
    ("method", "to_go"),
    [("direct11", t) for t in TO_GO + LAST_SECOND[:-2]]
    + [("indirect", t) for t in TO_GO + LAST_SECOND],
)
def test_remainder_of_the_optimum(ares_v, method, to_go):
    """Start before and after staging and jettison, 350.3 s to 0.05 s before cut-off."""
    rest = solve(ares_v.arrays, method, state=ares_v.state(to_go), verify=to_go < 1.0)
    assert rest.converged, rest.reason
    assert rest.m_f_kg == pytest.approx(ares_v.solution.m_f_kg, abs=SAME_KG)


@pytest.mark.parametrize(
    ("method", "to_go"),
    [("direct11", t) for t in (*IN_THE_COAST, 10.0)]
    + [("indirect", t) for t in (*IN_THE_COAST, 10.0, 2.0, 0.2)],
)
def test_remainder_with_coasts_ramps_and_a_tail_off(saturn, method, to_go):
    """Start in the coast with the S-II's tail-off, 147.03 to 146.52 s before cut-off."""
    rest = solve(saturn.arrays, method, state=saturn.state(to_go))
    assert rest.converged, rest.reason
    assert rest.m_f_kg == pytest.approx(saturn.solution.m_f_kg, abs=SAME_KG)


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506"])
@pytest.mark.trial
def test_no_wrong_success_close_to_cut_off(ares_v, saturn, name):
    """Start a few metres off close to cut-off: a loop of 420 s is an extremal, not the optimum."""
    optimum = {"ares_v": ares_v, "saturn_v_as506": saturn}[name]
    solved = 0
    states = 0
    for to_go in (15.0, 5.0, 2.0, 0.5, 0.05):
        for error in errors(3, 10.0, seed=int(100 * to_go)):
            state = optimum.state(to_go, error)
            both = [solve(optimum.arrays, m, state=state) for m in ("direct11", "indirect")]
            states += 1
            solved += both[1].converged
            for solution in both:
                if solution.converged:
                    late = solution.t_meco_s - optimum.solution.t_meco_s
                    # ten metres sideways and back: 2 sqrt(10 m / a) and a turn
                    assert late < 8.0
            if both[0].converged and both[1].converged:
                assert both[1].m_f_kg == pytest.approx(both[0].m_f_kg, abs=1.0)
    assert solved >= states // 3


@pytest.mark.trial
def test_the_short_burn_is_found_where_a_loop_is_an_extremal_too(ares_v):
    """Start 2 ms before cut-off, off by 3 m per axis: a loop of 5 km/s is an extremal as well."""
    found = 0
    for error in errors(40, 3.0):
        state = ares_v.state(0.002, error)
        solution = solve(ares_v.arrays, "indirect", state=state)
        # near the root rounding decides, which differs between processors
        assert not solution.converged or sum(arc.delta_v_m_s for arc in solution.arcs) < 1.0
        found += solution.converged
    assert found >= 3


def test_early_states_are_solved_however_dispersed(ares_v):
    """Disperse by 1 km and 10 m/s per axis: both methods find the optimum."""
    for to_go in (600.0, 431.0, 355.0, 200.0, 100.0):
        for error in errors(2, 1000.0, seed=int(to_go)):
            state = ares_v.state(to_go, error)
            direct = solve(ares_v.arrays, "direct20", state=state, verify=False)
            indirect = solve(ares_v.arrays, "indirect", state=state)
            assert indirect.converged, indirect.reason
            assert indirect.m_f_kg == pytest.approx(direct.m_f_kg, abs=1.0)


def test_impossible_states_end_in_a_reason(ares_v):
    """Start hundreds of metres off just before cut-off: one line, no exception."""
    for to_go in (1.0, 0.5, 0.05):
        for error in errors(8, 1500.0, seed=int(100 * to_go)):
            solution = solve(ares_v.arrays, "direct11", state=ares_v.state(to_go, error))
            assert not solution.converged
            assert solution.reason and "\n" not in solution.reason


def test_short_flights_take_few_iterations(ares_v):
    """Scale times and rates by the time left: as many iterations at 5 s as at 300 s."""
    solver = TwoPointSolver(ares_v.arrays)
    long, short = (solver.solve(ares_v.state(to_go)) for to_go in (300.0, 5.0))
    assert long.converged and short.converged
    assert short.iterations <= 2 * long.iterations


def indirect(flight, state, deadline=None):
    """Return a request of the indirect method."""
    deadline = deadline or Deadline()
    return Request(flight.arrays, state, "indirect", Heating.AT_JETTISON, deadline)


class TestRival:
    def test_is_told_in_the_notes(self, ares_v):
        solution = solve(ares_v.mission, "indirect")
        assert solution.notes["direct11_m_f_kg"] == pytest.approx(174_183.08, abs=0.05)

    @pytest.mark.trial
    def test_leads_a_failed_search(self, ares_v):
        """Give a failed indirect search the guess of its rival."""
        start = ares_v.mission.start().navigation()

        def again(guess):
            solver = TwoPointSolver(ares_v.arrays)
            assert solver.solve(start, guess.unknowns(1), restart=False).converged
            return ares_v.solution

        nothing = failed("indirect", Cause(Status.STALLED, "not found"), iterations=7)
        end = beside_rival(indirect(ares_v, start), nothing, again)
        assert end.converged
        assert end.iterations > 7 + ares_v.solution.iterations
        assert end.restarts == 1

    def test_beats_what_is_no_optimum(self, ares_v):
        start = ares_v.mission.start().navigation()
        worse = replace(ares_v.solution, t_meco_s=800.0, m_f_kg=164_000.0)
        end = beside_rival(indirect(ares_v, start), worse, lambda _: worse)
        assert not end.converged
        assert end.reason == (
            "no optimum found: the extremal that was found reaches 164,000.0 kg, "
            "direct11 174,183.1 kg"
        )

    def test_has_no_time_after_the_deadline(self, ares_v):
        start = ares_v.mission.start().navigation()
        end = beside_rival(
            indirect(ares_v, start, Deadline(0.0)),
            ares_v.solution,
            lambda _: pytest.fail("no further start"),
        )
        assert end is ares_v.solution

    def test_cannot_begin_without_a_flight(self, ares_v):
        state = ares_v.state(1.0)
        state["velocity"] = 0.0
        assert find_rival(indirect(ares_v, state)) is None

    def test_ample_velocity(self, ares_v):
        """Exceed the velocity of the optimum at the start, and fall towards its end."""
        start = ares_v.mission.start().navigation()
        spent = sum(arc.delta_v_m_s for arc in ares_v.solution.arcs)
        assert spent < ample_delta_v(ares_v.arrays, start) < 2.0 * spent
        assert ample_delta_v(ares_v.arrays, ares_v.state(0.01)) < 50.0


class TestTimeLimit:
    @pytest.mark.parametrize("method", DIRECT_METHODS + INDIRECT_METHODS)
    def test_no_time_at_all(self, ares_v, method):
        solution = solve(ares_v.mission, method, time_limit_s=0.0)
        assert not solution.converged
        assert solution.reason == OUT_OF_TIME.reason
        assert solution.iterations == 0

    @pytest.mark.parametrize("method", ["direct11", "indirect"])
    def test_cuts_a_search_short(self, ares_v, method, monkeypatch):
        """Pass the limit during the first start: no second start, and that reason."""
        asked = iter([False])
        monkeypatch.setattr(Deadline, "passed", property(lambda _: next(asked, True)))
        arrays = ares_v.mission.arrays()
        arrays.target["radius"] = 2.0e7
        solution = solve(
            arrays, method, state=ares_v.mission.start().navigation(), time_limit_s=60.0
        )
        assert not solution.converged
        assert solution.reason == OUT_OF_TIME.reason

    def test_stops_a_continuation(self, ares_v):
        from ares_optimizer.indirect.continuation import from_light_drops

        solver = TwoPointSolver(ares_v.arrays, deadline=Deadline(0.0))
        assert from_light_drops(solver, ares_v.mission.start().navigation()) is None

    @pytest.mark.parametrize("limit", [-1.0, float("nan")])
    def test_bad_limits(self, ares_v, limit):
        with pytest.raises(OptimizerError, match=f"^time_limit_s is {limit} s; expected 0 or more"):
            solve(ares_v.mission, time_limit_s=limit)
