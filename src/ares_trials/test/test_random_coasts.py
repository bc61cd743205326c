# SPDX-License-Identifier: Apache-2.0
"""Free coasts of random vehicles, planned by `indirect` from the mission alone."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from ares_models.judge import End
from ares_models.mission import Mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.free_arcs import reach_without, solve_direct_planned
from ares_optimizer.indirect.free_arcs import lengths_of, unknowns_of
from ares_optimizer.indirect.solver import TwoPointSolver
from ares_optimizer.plan import last_begin, length_bounds, spent, with_lengths
from ares_optimizer.request import Heating, Request
from ares_optimizer.rival import fixed_burns_fall_short
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled
from ares_trials.random_vehicles import random_coasting_mission
from ares_trials.testing.arrivals import judged

#: Of the last burn, s: what is left where the other burns reach the target by themselves.
NOTHING_S = 0.1


def taken(mission, solution):
    """Compute the propellant of the free burn, kg."""
    arrays, start = mission.arrays(), mission.start().navigation()[0]
    lengths = np.array(solution.lengths_s)
    return spent(arrays, start, lengths, solution.t_meco_s - last_begin(arrays, start, lengths))


@cache
def long_coast():
    """Return 43 min of coast between fixed burns and a last burn of 12 s, and the optimum."""
    mission = random_coasting_mission(50_043)
    return mission, solve(mission, "auto")


def request(mission, method, arrays=None):
    heating = Heating(mission.heating_limit_holds)
    arrays = mission.arrays() if arrays is None else arrays
    return Request(arrays, mission.start().navigation(), method, heating, Deadline())


@pytest.mark.parametrize(
    ("seed", "kg", "lengths"),
    [
        # a valley that bends on the way from either end of a bounded coast
        (103, 171.212, (0.0, 275.600)),
        # a length that hardly matters, long after the fairing has gone
        (229, 24.292, (2817.76,)),
        # what dips below the ground would take less
        (32, 468.742, (0.0, 692.650)),
        (36, 194.987, (0.0, 487.930)),
        # the fairing goes at once, and still does on a finer grid
        (628, 225.578, (0.0, 17.801)),
        # at its longest
        (476, 2676.655, (681.925,)),
    ],
)
def test_the_best_lengths(seed, kg, lengths):
    mission = random_coasting_mission(seed)
    solution = solve(mission, "indirect")
    assert solution.converged, solution.reason
    assert taken(mission, solution) == pytest.approx(kg, abs=2e-3)
    assert solution.lengths_s == pytest.approx(lengths, abs=0.02)


@pytest.mark.parametrize("seed", [0, 31, 186, 240, 572])
def test_fixed_burns_that_reach_the_target_leave_nothing_to_burn(seed):
    """Check a free burn of length zero, by descent or as `direct11` flies it."""
    mission = random_coasting_mission(seed)
    solution = solve(mission, "indirect")
    assert solution.converged, solution.reason
    assert "all that the free burns take" in solution.reason
    flow = float(mission.arrays().arcs[-1]["mass_flow"])
    assert 0.0 <= taken(mission, solution) < NOTHING_S * flow
    assert solution.verification.position_defect_m < 1.0
    assert not fixed_burns_fall_short(mission.arrays(), mission.start().navigation())


@pytest.mark.trial
def test_no_coast_at_all_may_be_the_best():
    """Solve a mission in which every start with a coast leads to 242 s of it, and to 6 kg less."""
    solution = solve(random_coasting_mission(50_046), "auto")
    assert solution.converged, solution.reason
    # 23,750.710 kg without any; collocation keeps coasts of 1 ms
    assert solution.m_f_kg == pytest.approx(23_750.710, abs=0.03)
    assert max(solution.lengths_s) < 0.01


@cache
def vanishing_coasts():
    mission = random_coasting_mission(95_000)
    return mission, solve(mission, "auto")


@pytest.mark.parametrize("law", ["peg", "igm", "optimal"])
@pytest.mark.trial
def test_coasts_that_vanish_are_flown(law):
    """Fly a mission of which both free coasts follow fixed ones, and are best left out."""
    mission, optimum = vanishing_coasts()
    assert optimum.converged, optimum.reason
    assert max(optimum.lengths_s) < 0.01
    plant = fly_compiled(mission, law=law).plant
    assert judged(mission, plant).end is End.TARGET
    assert float(plant["mass"]) == pytest.approx(optimum.m_f_kg, rel=1e-4)


@pytest.mark.parametrize(
    ("coast", "law"), list(product(["free", "fixed"], ["peg", "igm", "optimal"]))
)
@pytest.mark.trial
def test_a_burn_before_a_long_coast_ends_where_planned(law, coast):
    """Fly it: laws that aimed beyond the coast missed the orbit."""
    mission, optimum = long_coast()
    if coast == "fixed":
        data = mission.model_dump(exclude_unset=True, mode="json")
        data["stages"][2]["arcs"][0] = {"name": "coast", "coast_s": optimum.lengths_s[0]}
        mission = Mission.model_validate(data)
    assert mission.needs_plan
    plant = fly_compiled(mission, law=law).plant
    assert judged(mission, plant).end is End.TARGET
    assert float(plant["mass"]) == pytest.approx(optimum.m_f_kg, rel=1e-4)


def test_burns_that_lack_the_energy_are_not_tried():
    mission = random_coasting_mission(2)
    arrays, state = mission.arrays(), mission.start().navigation()
    assert fixed_burns_fall_short(arrays, state)
    assert reach_without(request(mission, "direct11")) is None
    # with the target's own velocity nothing falls short
    low = length_bounds(arrays, state[0])[0]
    end = solve(mission, "indirect").trajectory
    there = state.copy()
    there["position"], there["velocity"] = end.position[-1], end.velocity[-1]
    assert not fixed_burns_fall_short(with_lengths(arrays, state[0], low), there)


@pytest.mark.parametrize("seed", [45, 476])
def test_direct_solutions_of_a_grid_do_no_better(seed):
    mission = random_coasting_mission(seed)
    solution = solve(mission, "indirect")
    assert solution.converged, solution.reason
    low, high = length_bounds(mission.arrays(), mission.start().navigation()[0])
    axes = [a + np.minimum([0.0, 100.0, 400.0], b - a) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, low.size)
    other = solve_direct_planned(request(mission, "direct11"), list(points))
    assert other.converged, other.reason
    assert taken(mission, solution) <= taken(mission, other) + 1e-3
    assert taken(mission, solution) == pytest.approx(taken(mission, other), rel=0.01)


def test_a_search_that_burns_the_vehicle_up_is_a_failure():
    """Search beyond the last kilogram: there is no trajectory."""
    mission = random_coasting_mission(6)
    arrays, start = mission.arrays(), mission.start().navigation()
    planned = with_lengths(arrays, start[0], np.array([193.00736451, 55.29397062]))
    solution = solve(planned, "direct11", state=start)
    assert not solution.converged
    assert solution.trajectory is None


def test_a_direct_flight_through_the_ground_is_no_solution():
    """Try lengths that all lead through the ground."""
    mission = random_coasting_mission(139)
    deep = [np.array([2600.0, 623.96871956])]
    asked = replace(request(mission, "direct11"), verify=False)
    solution = solve_direct_planned(asked, deep)
    assert not solution.converged
    assert "goes through the ground" in solution.reason


def test_lengths_of_unknowns():
    mission = random_coasting_mission(3)
    start = mission.start().navigation()
    solver = TwoPointSolver(mission.arrays())
    lengths = np.array([12.0, 340.0])
    unknowns = unknowns_of(solver, start, lengths, 50.0)
    assert lengths_of(solver, start, unknowns) == pytest.approx(lengths)


def test_a_flight_without_free_burns_is_proven_in_any_case():
    mission = random_coasting_mission(31)
    flown = reach_without(replace(request(mission, "indirect"), verify=False))
    assert flown.verification.position_defect_m < 1.0
    assert taken(mission, flown) < NOTHING_S * float(mission.arrays().arcs[-1]["mass_flow"])
