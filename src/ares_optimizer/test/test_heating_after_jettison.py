# SPDX-License-Identifier: Apache-2.0
"""Test the second rise of heating after the jettison: reported, and limited on request."""

from itertools import pairwise

import numpy as np
import pytest

from ares_models.arrays import COAST
from ares_models.mission import load_mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.kernels.evaluate import evaluate, make_point, make_scratch
from ares_optimizer.direct.kernels.heating import between_nodes, heating_peaks
from ares_optimizer.direct.kernels.scratch import N_COLUMNS, N_TIME, STORED
from ares_optimizer.direct.search import own_starts
from ares_optimizer.direct.transcription import transcribe
from ares_optimizer.solution import OptimizerError, Status
from ares_optimizer.solve import solve
from ares_trials.testing.samples import one_in

LIMIT = 1135.0


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def dense(mission, factor):
    arrays = mission.arrays()
    arrays.environment["density_factor"] = factor
    return arrays


def by_name(solution, name):
    return next(check for check in solution.constraints if check.name == name)


@pytest.mark.parametrize("method", ["direct11", "direct20"])
@pytest.mark.parametrize(
    ("factor", "peak", "price"),
    one_in(
        4, [(1.0, 1.0, 0.0), (1.2, 1.0, 0.0), (1.5, 1.0, 0.0), (1.8, 1.0, 0.0), (2.2, 1.11, 2230.0)]
    ),
)
def test_density_factors(ares_v, method, factor, peak, price):
    arrays, start = dense(ares_v, factor), ares_v.start().navigation()
    at_jettison = solve(arrays, method, state=start)
    assert at_jettison.converged
    seen = at_jettison.verification.peak_fmhr_after_jettison_w_m2 / LIMIT
    assert seen == pytest.approx(peak, abs=0.01)

    held = solve(arrays, method, state=start, heating="from_jettison")
    assert held.converged, held.reason
    assert held.verification.peak_fmhr_after_jettison_w_m2 <= LIMIT + 0.1
    assert by_name(held, "heating from the jettison on").satisfied
    assert at_jettison.m_f_kg - held.m_f_kg == pytest.approx(price, abs=10.0)


def test_the_mission_says_where_its_limit_holds(ares_v):
    dense_air = ares_v.environment.atmosphere.model_copy(update={"density_factor": 2.2})
    environment = ares_v.environment.model_copy(update={"atmosphere": dense_air})
    (fairing,) = ares_v.jettisons
    held = fairing.model_copy(update={"heating_limit_holds": "from_jettison"})
    mission = ares_v.model_copy(update={"environment": environment, "jettisons": (held,)})
    solution = solve(mission)
    assert solution.verification.peak_fmhr_after_jettison_w_m2 <= LIMIT + 0.1
    # and the caller otherwise
    other = solve(mission, heating="at_jettison")
    assert other.verification.peak_fmhr_after_jettison_w_m2 > 1.1 * LIMIT
    for method in ("indirect", "closed_form"):
        with pytest.raises(OptimizerError, match=r"^heating is 'from_jettison'; .* ignored$"):
            solve(mission, method)
        assert solve(mission, method, heating="at_jettison").converged


def test_a_touch_is_cheaper_than_keeping_the_fairing(ares_v):
    # at this density the flight lofts and touches the limit at the later peak
    arrays, start = dense(ares_v, 2.05), ares_v.start().navigation()
    held = solve(arrays, "direct20", state=start, heating="from_jettison")
    assert held.converged, held.reason
    assert held.t_plf_s < 445.0
    check = by_name(held, "heating from the jettison on")
    assert check.active
    assert check.multiplier > 0.0
    assert held.verification.peak_fmhr_after_jettison_w_m2 == pytest.approx(LIMIT, abs=0.2)
    free = solve(arrays, "direct20", state=start)
    assert 50.0 < free.m_f_kg - held.m_f_kg < 90.0

    # sensitivity to the limit, against a solution with a slightly higher one
    eased = dense(ares_v, 2.05)
    eased.jettisons["value"] += 1.0
    more = solve(eased, "direct20", state=start, heating="from_jettison")
    both = check.multiplier + by_name(held, "heating at jettison 0").multiplier
    assert more.m_f_kg - held.m_f_kg == pytest.approx(both, rel=0.1)


def test_a_limit_that_cannot_be_held_is_named(ares_v):
    # the heating exceeds the limit at cut-off only
    arrays, start = dense(ares_v, 2.6), ares_v.start().navigation()
    solution = solve(arrays, state=start, heating="from_jettison")
    assert not solution.converged
    assert "1,135 W/m2 cannot be held to cut-off" in solution.reason


def test_quintic_between_nodes_is_the_flight():
    mission = load_mission("ares_v")
    transcription = transcribe(mission.arrays(), mission.start().navigation()[0], "direct11")
    problem = transcription.problem
    p = own_starts(transcription, Deadline())[0]
    scratch = make_scratch(problem)
    evaluate(p, problem, scratch, make_point(problem))
    fine = problem._replace(longest_step=problem.longest_step / 8.0)
    other = make_scratch(fine)
    evaluate(p, fine, other, make_point(fine))
    coarse, dense_nodes = (
        scratch.nodes[: scratch.counts[STORED]],
        other.nodes[: other.counts[STORED]],
    )
    checked = 0
    for a, b in pairwise(coarse):
        times = dense_nodes[:, N_TIME]
        inside = dense_nodes[(times > a[N_TIME] + 1e-6) & (times < b[N_TIME] - 1e-6)]
        for node in inside:
            r, v, _ = between_nodes(a, b, (node[N_TIME] - a[N_TIME]) / (b[N_TIME] - a[N_TIME]))
            assert np.array(r) == pytest.approx(node[1:4], abs=2.0)
            assert np.array(v) == pytest.approx(node[4:7], abs=0.3)
            checked += 1
    assert checked > 100


def test_peaks_are_found_and_counted():
    mission = load_mission("ares_v")
    arrays = mission.arrays()
    solution = solve(arrays, state=mission.start().navigation())
    flown = solution.trajectory
    first = int(np.searchsorted(flown.time_s, solution.t_plf_s)) + 1
    rows = np.arange(first, len(flown.time_s), 8)
    nodes = np.zeros((len(rows), N_COLUMNS))
    nodes[: len(rows), 0] = flown.time_s[rows]
    nodes[: len(rows), 1:4] = flown.position[rows]
    nodes[: len(rows), 4:7] = flown.velocity[rows]
    acceleration = np.gradient(flown.velocity[first:], flown.time_s[first:], axis=0)
    nodes[: len(rows), 7:10] = acceleration[rows - first]
    peaks = np.full(4, np.nan)
    count = heating_peaks(
        nodes, len(rows), solution.t_plf_s, arrays.environment[0], arrays.atmosphere, peaks
    )
    # it falls after the jettison, rises to one later peak, and falls to the end
    assert count == 1
    after = flown.time_s > 500.0
    top = flown.time_s[after][np.argmax(flown.heating_rate[after])]
    assert peaks[0] == pytest.approx(top, abs=2.0)


@pytest.mark.trial
def test_a_plan_that_is_cool_anyway_is_the_optimum_of_the_limit_along_the_way():
    """Free coasts are planned for the limit at the jettison; `direct20` would coast nowhere."""
    arrays, start = with_parking_perigee(175e3)
    relaxed = solve(arrays, "auto", state=start)
    assert relaxed.verification.peak_fmhr_after_jettison_w_m2 <= LIMIT + 0.1
    held = solve(arrays, "auto", state=start, heating="from_jettison")
    assert held.converged
    assert held.m_f_kg == pytest.approx(relaxed.m_f_kg, abs=1e-3)
    assert by_name(held, "heating from the jettison on").satisfied


@pytest.mark.trial
def test_a_plan_that_heats_up_along_its_coast_is_not_called_infeasible():
    arrays, start = with_parking_perigee(120e3)
    solution = solve(arrays, "auto", state=start, heating="from_jettison")
    assert solution.status is Status.STALLED
    assert "limit 1,135" in solution.reason
    assert "raise min_perigee_altitude_m" in solution.reason


def with_parking_perigee(altitude_m):
    """Return falcon9_gto with another least perigee of its free coast."""
    mission = load_mission("falcon9_gto")
    arrays, start = mission.arrays(), mission.start().navigation()
    coast = (arrays.arcs["kind"] == COAST) & np.isinf(arrays.arcs["duration"])
    arrays.arcs["min_perigee_radius"][coast] = 6378137.0 + altitude_m
    return arrays, start
