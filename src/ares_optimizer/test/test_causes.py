# SPDX-License-Identifier: Apache-2.0
"""Check that outcomes are statuses and subjects of checks are keys, without parsing prose."""

import math

import pytest

from ares_models.mission import load_mission
from ares_optimizer.direct.search import Guess
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.indirect.solver import TwoPointOptions, TwoPointSolver
from ares_optimizer.solution import Check, Status
from ares_optimizer.solve import solve


@pytest.fixture(scope="module")
def ares_v():
    mission = load_mission("ares_v")
    return mission, mission.arrays(), mission.start().navigation()


@pytest.mark.parametrize("method", ["direct11", "indirect"])
def test_an_optimum_is_converged(ares_v, method):
    solution = solve(ares_v[0], method)
    assert solution.status is Status.CONVERGED
    assert solution.converged
    assert solution.to_json()["converged"]


@pytest.mark.parametrize("method", ["direct11", "indirect"])
def test_no_time_is_a_time_limit(ares_v, method):
    solution = solve(ares_v[0], method, time_limit_s=0.0)
    assert solution.status is Status.TIME_LIMIT
    assert not solution.converged


@pytest.mark.parametrize("method", ["direct11", "indirect"])
def test_a_target_underground_is_infeasible(ares_v, method):
    _, arrays, start = ares_v
    target = arrays.target.copy()
    target["radius"] = 6.0e6
    solution = solve(arrays._replace(target=target), method, state=start)
    assert solution.status is Status.INFEASIBLE


def test_a_limit_that_costs_too_much_propellant_is_infeasible(ares_v):
    """Need 127,424 kg without the limit, 127,817 kg with it."""
    _, arrays, start = ares_v
    arcs = arrays.arcs.copy()
    arcs["propellant"][1] = 127_600.0
    short = arrays._replace(arcs=arcs)
    direct = solve(short, "direct11", state=start)
    assert direct.status is Status.INFEASIBLE
    assert direct.reason.startswith("heating limit of jettison 0")
    assert solve(short, "indirect", state=start).status is Status.INFEASIBLE


def test_iterations_used_up_are_no_obstacle(ares_v):
    """Report used-up iterations as such, not as an infeasible mission."""
    _, arrays, start = ares_v
    options = TwoPointOptions(max_iterations=1)
    assert not TwoPointSolver(arrays, options).solve(start).converged
    solution = solve_indirect(arrays, start, options)
    assert solution.status is Status.ITERATION_LIMIT


def test_no_flight_to_lay_out_is_an_illegal_start(ares_v):
    _, arrays, start = ares_v
    late = arrays.arcs.copy()
    late["duration"][0] = 3e6
    late["propellant"][0] = 1e12
    solution = solve_indirect(arrays._replace(arcs=late), start)
    assert solution.status is Status.ILLEGAL_START


def test_every_check_has_a_key_of_its_own(ares_v):
    mission, _, _ = ares_v
    solution = solve(mission, "direct11", heating="from_jettison", guess=None)
    keys = [(check.key, check.number) for check in solution.constraints]
    assert len(set(keys)) == len(keys)
    assert (Check.HEATING_AT_JETTISON, 0) in keys
    assert {Check.RADIUS, Check.HEATING_FROM_JETTISON, Check.PROPELLANT} < {key for key, _ in keys}
    for check in solution.constraints:
        if check.active:
            assert math.isfinite(check.multiplier), check.name


def test_a_bad_guess_that_leads_on_is_converged(ares_v):
    guess = Guess((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 400.0, 300.0)
    assert solve(ares_v[0], "direct11", guess=guess).status is Status.CONVERGED
