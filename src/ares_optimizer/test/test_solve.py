# SPDX-License-Identifier: Apache-2.0
"""Test the one call: its results, summary and refusals."""

import json
import math

import numpy as np
import pytest
import yaml

from ares_models.mission import load_mission, parse_mission
from ares_optimizer.direct.search import Guess
from ares_optimizer.direct.solve import guess_from
from ares_optimizer.registry import DIRECT_METHODS, INDIRECT_METHODS
from ares_optimizer.solution import OptimizerError
from ares_optimizer.solve import solve
from ares_trials.testing.flights import short_burn


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


@pytest.mark.parametrize("method", DIRECT_METHODS + INDIRECT_METHODS)
def test_every_optimum_is_proven(ares_v, method):
    solution = solve(ares_v, method)
    assert solution.method == method
    assert solution.converged, solution.reason
    assert solution.m_f_kg == pytest.approx(174_183.1, abs=1.0)
    proof = solution.verification
    assert proof.radius_m == pytest.approx(6_518_889.0, abs=1.0)
    assert proof.speed_m_s == pytest.approx(7840.675, abs=1e-2)
    assert proof.flight_path_angle_deg == pytest.approx(1.0064, abs=1e-4)
    assert proof.inclination_deg == pytest.approx(28.5, abs=1e-4)
    assert proof.position_defect_m < 0.1
    assert max(solution.costates.hamiltonian_spread) < 1e-3


def test_json_has_the_published_keys(ares_v):
    text = json.dumps(solve(ares_v).to_json())
    summary = json.loads(text)
    assert list(summary) == [
        "method",
        "status",
        "converged",
        "search",
        "reason",
        "t_plf_s",
        "t_meco_s",
        "m_f_kg",
        "delta_v_m_s",
        "arcs",
        "iterations",
        "solve_ms",
        "verification",
    ]
    assert list(summary["verification"]) == [
        "radius_m",
        "speed_m_s",
        "flight_path_angle_deg",
        "inclination_deg",
        "fmhr_w_m2",
        "end",
    ]
    assert summary["converged"] is True
    assert summary["reason"] == "optimal"


def test_json_of_a_failure_has_no_nan(ares_v):
    arrays = ares_v.arrays()
    arrays.target["radius"] = 6.2e6
    summary = solve(arrays, state=ares_v.start().navigation()).to_json()
    assert summary["m_f_kg"] is None
    assert summary["t_plf_s"] is None
    assert summary["verification"] is None
    json.dumps(summary, allow_nan=False)


def test_prices_are_those_of_another_solution(ares_v):
    # kg of final mass per unit of each limit, against solving for a shifted limit
    solution = solve(ares_v, "direct14")
    table = {check.name: check for check in solution.constraints}
    for name, field, step in (
        ("radius at cut-off", "radius", 500.0),
        ("speed at cut-off", "speed", 0.5),
        ("flight-path angle at cut-off", "flight_path_angle", math.radians(0.01)),
        ("inclination", "inclination", math.radians(0.01)),
    ):
        masses = []
        for sign in (1.0, -1.0):
            arrays = ares_v.arrays()
            arrays.target[field] += sign * step
            masses.append(
                solve(arrays, "direct14", state=ares_v.start().navigation(), verify=False).m_f_kg
            )
        unit = math.degrees(step) if table[name].unit == "deg" else step
        slope = (masses[0] - masses[1]) / (2 * unit)
        assert table[name].multiplier == pytest.approx(slope, rel=0.02, abs=0.02)
    arrays = ares_v.arrays()
    arrays.jettisons["value"] += 5.0
    more = solve(arrays, "direct14", state=ares_v.start().navigation(), verify=False).m_f_kg
    slope = (more - solution.m_f_kg) / 5.0
    assert table["heating at jettison 0"].multiplier == pytest.approx(slope, rel=0.02)


def test_without_verification_there_is_the_flight_plan_only(ares_v):
    solution = solve(ares_v, verify=False)
    assert solution.converged
    assert solution.arcs
    assert solution.verification is None
    assert solution.trajectory is None


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"method": "direct12"}, "method is 'direct12'; expected one of auto, collocation"),
        ({"heating": "never"}, "heating is 'never'; expected at_jettison"),
        ({"guess": 3}, "guess is a int; expected a Guess or a Solution for direct11"),
        ({"jettison_times": {1: 400.0}}, "jettison 1 does not exist; the mission has 1"),
        ({"jettison_times": {0: math.nan}}, "jettison 0 is held at nan s"),
        (
            {"guess": Guess((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 400.0, 300.0)},
            "guess.direction is zero",
        ),
        (
            {"guess": Guess((1.0, 0.0, math.inf), (0.0, 0.0, 0.0), 400.0, 300.0)},
            "guess.direction is [1.0, 0.0, inf]",
        ),
        (
            {"guess": Guess((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), math.nan, 300.0)},
            "guess times are nan and 300.0 s",
        ),
        (
            {"method": "indirect", "heating": "from_jettison"},
            "heating is 'from_jettison'; indirect takes",
        ),
    ],
)
def test_bad_requests(ares_v, arguments, text):
    with pytest.raises(OptimizerError) as error:
        solve(ares_v, **arguments)
    assert str(error.value).startswith(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("position", math.nan, "state.position is"),
        ("position", 1.0, "state.position is 2 m from the Earth's centre"),
        ("velocity", math.inf, "state.velocity is"),
        ("mass", 0.0, "state.mass is 0 kg; expected more than 0"),
        ("arc", 2, "state.arc is 2; expected 0 to 1"),
        ("time", math.nan, "state.time is nan"),
    ],
)
def test_bad_states(ares_v, field, value, text):
    state = ares_v.start().navigation()
    state[field] = value
    with pytest.raises(OptimizerError) as error:
        solve(ares_v, state=state)
    assert str(error.value).startswith(text)


def test_arrays_need_a_state(ares_v):
    with pytest.raises(OptimizerError, match="state is missing"):
        solve(ares_v.arrays())
    with pytest.raises(OptimizerError, match="shape"):
        solve(ares_v.arrays(), state=np.zeros(2, ares_v.start().navigation().dtype))


def test_a_guess_without_jettison_time_drops_where_the_heating_allows(ares_v):
    first = solve(ares_v, verify=False)
    guess = guess_from(first)
    free = Guess(guess.direction, guess.direction_rate, None, first.t_meco_s - 155.9, None)
    solution = solve(ares_v, guess=free, verify=False)
    assert solution.converged
    assert solution.m_f_kg == pytest.approx(first.m_f_kg, abs=0.01)


def test_a_part_that_drops_at_the_start_is_no_defect():
    solution = solve(parse_mission(yaml.safe_dump(short_burn()), "a test"), "auto")
    assert solution.converged, solution.reason
    assert solution.jettison_times_s == pytest.approx([1000.0])
    assert solution.verification.mass_defect_kg < 1e-6


def test_guess_from_a_failure_is_refused(ares_v):
    arrays = ares_v.arrays()
    arrays.target["radius"] = 6.2e6
    nothing = solve(arrays, state=ares_v.start().navigation())
    with pytest.raises(OptimizerError, match="no steering arcs"):
        solve(ares_v, guess=nothing)


def test_the_methods_seed_each_other(ares_v):
    direct = solve(ares_v, "direct11")
    indirect = solve(ares_v, "indirect", guess=direct)
    assert indirect.converged
    for method in DIRECT_METHODS:
        again = solve(ares_v, method, guess=indirect, verify=False)
        assert again.converged
        assert again.m_f_kg == pytest.approx(indirect.m_f_kg, abs=1.0)
    with pytest.raises(OptimizerError, match="no costates"):
        solve(ares_v, "indirect", guess=solve(ares_v, verify=False))


def test_mission_arrays_are_left_alone(ares_v):
    arrays = ares_v.arrays()
    before = [a.copy() for a in arrays]
    solve(
        arrays,
        state=ares_v.start().navigation(),
        jettison_times={0: 430.0},
        heating="from_jettison",
    )
    assert all(np.array_equal(a, b) for a, b in zip(before, arrays, strict=True))
