# SPDX-License-Identifier: Apache-2.0
"""Test missions with free arcs: published answers, exact derivatives, bounds, minima."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.indirect.free_arcs import find_planned, is_minimum
from ares_optimizer.indirect.solver import TwoPointSolver
from ares_optimizer.kept import solve_once
from ares_optimizer.plan import free_arcs, length_bounds, trial_lengths, with_lengths
from ares_optimizer.solution import Check, Status, UnfitMethod
from ares_optimizer.solve import solve
from ares_optimizer.two_point.arrays import AT_LONGEST, NOT_HELD

MISSIONS = Path(__file__).parent / "missions"
#: Each found by two independent programs: sum of burns in m/s, lengths of arcs in s.
PUBLISHED = {
    "titan2_coast": (8476.5717, {"coast": 46.177}),
    "titan2_restart": (
        8101.8936,
        {"first burn": 153.2530, "coast": 450.0, "second burn": 9.1581},
    ),
    "two_burn": (
        # 0.3994878 of the circular speed at the start
        0.3994878 * math.sqrt(3.986004418e14 / 6678137.0),
        {"first burn": 1931.756, "coast": 6378.034, "second burn": 1099.822},
    ),
}


def mission(name):
    return load_mission(MISSIONS / f"{name}.yaml")


def edited(tmp_path, name, *changes):
    text = (MISSIONS / f"{name}.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / f"{name}.yaml"
    path.write_text(text)
    return load_mission(path)


@pytest.fixture(scope="module")
def solved():
    found = {}
    for name in PUBLISHED:
        flight = mission(name)
        begin, heating = flight.start().navigation(), flight.heating_limit_holds
        # test_optimal_plans.py flies them
        found[name] = solve_once(flight.arrays(), "indirect", begin, heating, Deadline())
    return found


class TestPublished:
    @pytest.mark.parametrize("name", PUBLISHED)
    def test_sum_of_burns_and_lengths(self, solved, name):
        delta_v, lengths = PUBLISHED[name]
        solution = solved[name]
        assert solution.delta_v_m_s == pytest.approx(delta_v, abs=5e-4)
        names = mission(name).arc_names
        found = {names[arc.arc]: arc.end_s - arc.start_s for arc in solution.flown}
        for arc, length in lengths.items():
            assert found[arc] == pytest.approx(length, abs=1e-3)

    def test_circular(self):
        solution = solve(mission("titan2_circular"), "indirect")
        assert solution.converged
        assert solution.m_f_kg == pytest.approx(7672.214, abs=1e-3)
        assert solution.t_meco_s == pytest.approx(318.0089, abs=1e-4)

    def test_proven(self, solved):
        for name in ("titan2_coast", "two_burn"):
            assert solved[name].converged, solved[name].reason
            assert solved[name].verification.position_defect_m < 0.01

    def test_a_dip_below_the_ground_is_named_and_solved_all_the_same(self, solved):
        solution = solved["titan2_restart"]
        assert solution.status is Status.INFEASIBLE
        assert "goes through the ground" in solution.reason

    def test_a_coast_at_its_bound_has_a_price(self, solved):
        """Compare the value of a second of coast with the neighbouring problem."""
        checks = [c for c in solved["titan2_restart"].constraints if c.key is Check.ARC_LENGTH]
        burn, coast = checks
        assert (burn.active, coast.active) == (False, True)
        assert coast.limit == 450.0
        assert coast.value == pytest.approx(450.0, abs=1e-6)

    def test_json(self, solved):
        data = solved["titan2_coast"].to_json(mission("titan2_coast").arc_names)
        assert [arc["name"] for arc in data["arcs"]] == ["stage 1", "coast", "burn"]
        assert data["arcs"][0]["start_s"] == 0.0
        assert data["arcs"][2]["end_s"] == data["t_meco_s"]
        assert data["delta_v_m_s"] == pytest.approx(8476.5717, abs=5e-4)


def price_of_a_second(tmp_path):
    masses = []
    for longest in (449.0, 451.0):
        changed = edited(tmp_path, "titan2_restart", ("max_s: 450.0", f"max_s: {longest}"))
        masses.append(solve(changed, "indirect").m_f_kg)
    return 0.5 * (masses[1] - masses[0])


def test_the_multiplier_of_a_bound(tmp_path, solved):
    (coast,) = [c for c in solved["titan2_restart"].constraints if c.active and c.unit == "s"]
    assert coast.multiplier == pytest.approx(price_of_a_second(tmp_path), rel=1e-3)


def assert_jacobian(solver, start, base, rtol, atol):
    """Compare each column with central differences; ``atol`` is relative to its greatest entry."""
    _, jacobian, _ = solver.shoot(start, base)
    for c, step in enumerate([1e-6] * 3 + [1e-9] * 3 + [1e-3] * (base.size - 6)):
        move = np.zeros(base.size)
        move[c] = step
        ahead, behind = (solver.shoot(start, base + side)[0] for side in (move, -move))
        column = jacobian[:, c]
        size = np.abs(column).max()
        difference = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(difference, column, rtol=rtol, atol=atol * size)


@pytest.mark.parametrize(
    ("name", "held"),
    [
        ("titan2_coast", []),
        ("titan2_restart", []),
        ("titan2_restart", [1]),
        ("titan2_restart", [0, 1]),
        ("two_burn", []),
    ],
)
def test_jacobian_is_exact(solved, name, held):
    """Compare switching conditions and held lengths with differences."""
    flight = mission(name)
    start = flight.start().navigation()
    solver = TwoPointSolver(flight.arrays())
    lengths = np.array(solved[name].lengths_s)
    base = solved[name].parameters.copy()
    solver.hold(start, {f: float(lengths[f]) + 3.0 for f in held})
    assert_jacobian(solver, start, base, rtol=2e-5, atol=2e-6)


def test_a_length_is_worth_what_its_change_costs(solved):
    """Compare the switching function with the mission at another length."""
    flight = mission("titan2_restart")
    start = flight.start().navigation()
    solver = TwoPointSolver(flight.arrays())
    root = solved["titan2_restart"].parameters
    lengths = {0: 150.0, 1: 400.0}

    def cost(change):
        held = {f: length + change * (f == 0) for f, length in lengths.items()}
        solver.hold(start, held)
        there = solver.solve(start, root, restart=False)
        assert there.converged
        return there.propellant_kg

    cost(0.0)
    worth = float(solver.work["switches"]["worth"][0, 0] / solver.work["price"][0])
    assert -worth == pytest.approx((cost(0.02) - cost(-0.02)) / 0.04, rel=1e-4)


class TestBounds:
    def test_a_coast_that_must_be_longer(self, tmp_path):
        changed = edited(
            tmp_path, "titan2_coast", ("coast_s: free", "coast_s: free\n        min_s: 60.0")
        )
        solution = solve(changed, "indirect")
        assert solution.converged, solution.reason
        assert solution.lengths_s == pytest.approx((60.0,), abs=1e-6)
        (check,) = [c for c in solution.constraints if c.key is Check.ARC_LENGTH]
        assert check.active
        assert check.multiplier < 0.0

    def test_holds_are_those_of_the_bounds(self):
        flight = mission("titan2_restart")
        start = flight.start().navigation()
        solver = TwoPointSolver(flight.arrays())
        root = find_planned(solver, start)
        assert root.holds == (NOT_HELD, AT_LONGEST)

    def test_no_coast_where_none_pays(self, tmp_path):
        """Hold a coast at its shortest where it costs propellant."""
        changed = edited(
            tmp_path,
            "two_burn",
            ("radius_m: 20034411.0", "radius_m: 6778137.0"),
            ("speed_m_s: 4460.469749684", "speed_m_s: 7668.557"),
            ("thrust_n: 89377.2786685", "thrust_n: 9937.2786685"),
        )
        start = changed.start().navigation()
        low, high = length_bounds(changed.arrays(), start[0])
        assert (low > 0.0).all()
        assert (high >= low).all()


def test_a_saddle_is_no_minimum(solved):
    """Refuse lengths that meet the conditions but have a better neighbour."""
    flight = mission("titan2_coast")
    start = flight.start().navigation()
    solver = TwoPointSolver(flight.arrays())
    root = solver.solve(start, solved["titan2_coast"].parameters, restart=False)
    assert is_minimum(solver, start, root)
    solver.hold(start, {0: 20.0})
    off = solver.solve(start, solved["titan2_coast"].parameters, restart=False)
    assert off.converged
    # pretend that 20 s was found
    assert not is_minimum(solver, start, replace(off, holds=(NOT_HELD,)))


def test_last_burn_of_fixed_length(tmp_path):
    """End with a solid motor: the free burn before it compensates."""
    changed = edited(
        tmp_path,
        "titan2_restart",
        (
            "burn_time_s: free\n\ntarget",
            "burn_time_s: 12.0\n\ntarget",
        ),
    )
    solution = solve(changed, "indirect")
    last = solution.flown[-1]
    assert last.end_s - last.start_s == pytest.approx(12.0, abs=1e-6)
    free = solve(mission("titan2_restart"), "indirect")
    assert solution.delta_v_m_s > free.delta_v_m_s
    # a solid as long as in the optimum loses nothing
    length = free.flown[-1].end_s - free.flown[-1].start_s
    same = edited(
        tmp_path,
        "titan2_restart",
        ("burn_time_s: free\n\ntarget", f"burn_time_s: {length!r}\n\ntarget"),
    )
    assert solve(same, "indirect").delta_v_m_s == pytest.approx(free.delta_v_m_s, abs=1e-3)


@pytest.mark.parametrize("name", ["titan2_coast", "titan2_restart"])
def test_direct_agrees(solved, name):
    solution = solve(mission(name), "direct11")
    assert solution.delta_v_m_s >= solved[name].delta_v_m_s - 1e-3
    assert solution.delta_v_m_s == pytest.approx(solved[name].delta_v_m_s, abs=0.1)
    assert solution.lengths_s == pytest.approx(solved[name].lengths_s, abs=0.1)


def test_a_method_that_plans_no_arcs_says_so():
    with pytest.raises(
        UnfitMethod, match="expected auto or collocation or indirect: arc 1 is free"
    ):
        solve(mission("titan2_coast"), "closed_form")


def test_trials_stay_between_the_bounds():
    flight = mission("titan2_restart")
    arrays, start = flight.arrays(), flight.start().navigation()
    low, high = length_bounds(arrays, start[0])
    trials = list(trial_lengths(arrays, start))
    assert len(trials) > 5
    for lengths in trials:
        assert (low <= lengths).all()
        assert (lengths <= high).all()
    planned = with_lengths(arrays, start[0], trials[0])
    assert planned.arcs["duration"][free_arcs(arrays, start[0])] == pytest.approx(trials[0])


#: Throttled to 25 m/s2, but not below half of the thrust; or to 40.
THROTTLES = {
    "25 to half": ("max_acceleration_m_s2: 25.0", "min_throttle: 0.5"),
    "40": ("max_acceleration_m_s2: 40.0", "min_throttle: 0.0"),
}


def throttled(tmp_path, name, throttle):
    indent = "    " if name == "titan2_circular" else "        "
    keys = "".join(f"{indent}{key}\n" for key in THROTTLES[throttle])
    old = "isp_s: 315.000112652779\n"
    text = (MISSIONS / f"{name}.yaml").read_text()
    path = tmp_path / "throttled.yaml"
    path.write_text(text.replace(old, old + keys))
    return load_mission(path)


class TestThrottledBurns:
    @pytest.mark.parametrize("throttle", THROTTLES)
    @pytest.mark.parametrize("name", ["titan2_circular", "titan2_coast", "titan2_restart"])
    def test_flown_again(self, tmp_path, name, throttle):
        """Verify by the engine of the proof; the acceleration stays below its limit."""
        flight = throttled(tmp_path, name, throttle)
        solution = solve(flight, "indirect")
        assert solution.converged or "through the ground" in solution.reason
        assert solution.verification.position_defect_m < 0.01
        assert solution.verification.mass_defect_kg < 1e-3
        track = solution.trajectory
        second = track.mass < 32758.7
        limit = float(flight.arrays().arcs[-1]["max_acceleration"])
        least = float(flight.arrays().arcs[-1]["min_throttle"])
        acceleration = track.thrust[second] / track.mass[second]
        above = acceleration > limit * (1.0 + 1e-6)
        assert np.all(track.thrust[second][above] <= least * 456100.0061 * (1.0 + 1e-6))
        assert acceleration.max() > 0.99 * limit

    @pytest.mark.parametrize("name", ["titan2_circular", "titan2_restart"])
    def test_jacobian_is_exact(self, tmp_path, name):
        flight = throttled(tmp_path, name, "25 to half")
        start = flight.start().navigation()
        solver = TwoPointSolver(flight.arrays())
        base = solve(flight, "indirect").parameters.copy()
        base[6:] += np.linspace(0.3, 1.1, base.size - 6)
        assert_jacobian(solver, start, base, rtol=1e-6, atol=1e-7)

    def test_a_limit_that_is_never_met_costs_nothing(self, tmp_path):
        flight = edited(
            tmp_path,
            "titan2_circular",
            ("isp_s: 315.000112652779", "isp_s: 315.000112652779\n    max_acceleration_m_s2: 90.0"),
        )
        assert solve(flight, "indirect").m_f_kg == pytest.approx(7672.2142685, abs=1e-5)

    def test_direct_methods_say_that_they_cannot(self, tmp_path):
        with pytest.raises(
            UnfitMethod,
            match=r"expected auto or collocation or indirect: arc \d has max_acceleration",
        ):
            solve(throttled(tmp_path, "titan2_circular", "40"), "direct11")


class TestOblateness:
    """Solve the two-point problem with J2, in burns and coasts."""

    @pytest.fixture
    def oblate(self, tmp_path):
        def make(name):
            return edited(tmp_path, name, ("g0_m_s2", "j2: 1.08263e-3\n  g0_m_s2"))

        return make

    @pytest.mark.parametrize("name", ["titan2_circular", "titan2_coast", "two_burn"])
    def test_flown_again(self, oblate, solved, name):
        solution = solve(oblate(name), "indirect")
        assert solution.converged, solution.reason
        assert solution.verification.position_defect_m < 0.05
        if name in solved:
            # it moves the optimum, and not by much
            change = solution.delta_v_m_s - solved[name].delta_v_m_s
            assert 0.01 < abs(change) < 30.0

    def test_direct_agrees(self, oblate):
        flight = oblate("titan2_circular")
        assert solve(flight, "indirect").m_f_kg == pytest.approx(
            solve(flight, "direct20").m_f_kg, abs=0.2
        )

    @pytest.mark.parametrize("name", ["titan2_coast", "two_burn"])
    def test_jacobian_is_exact(self, oblate, solved, name):
        flight = oblate(name)
        start = flight.start().navigation()
        solver = TwoPointSolver(flight.arrays())
        base = solved[name].parameters
        assert_jacobian(solver, start, base, rtol=2e-5, atol=2e-6)
