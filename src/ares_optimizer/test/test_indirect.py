# SPDX-License-Identifier: Apache-2.0
"""Test the indirect method: published optima, exact derivatives and invariants."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from ares_models.arrays import (
    ALTITUDE_SPHERICAL,
    COAST,
    HEATING_LIMIT,
    MISSION_TIME,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    TIME_AFTER_IGNITION,
)
from ares_models.atmosphere import pra63_data, pra63_exponential
from ares_models.kernels.environment import heating_rate, log_heating_gradient
from ares_models.mission import load_mission
from ares_optimizer.indirect.continuation import (
    from_high_limits,
    from_light_drops,
    from_linear_gravity,
)
from ares_optimizer.indirect.kernels import sample
from ares_optimizer.indirect.report import failure_cause
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.indirect.solver import (
    IndirectGuess,
    TwoPointOptions,
    TwoPointSolver,
    navigation,
)
from ares_optimizer.kernels.timetable import MAX_SEGMENTS, SEGMENT, Times, build_timetable
from ares_optimizer.request import Heating
from ares_optimizer.solution import OptimizerError, Status
from ares_optimizer.two_point.arrays import INVERSE_SQUARE, WORK, Gravity
from ares_optimizer.two_point.kernels import newton
from ares_optimizer.two_point.kernels.costates import (
    altitude_hessian_product,
    integrate_segment,
    log_heating_hessian_product,
)

FLOW = 1306665.0 / (448.0 * 9.80665)

# the thesis-form table, altitude km and density kg/m3
THESIS_FORM = (
    (60, 3.3049e-4),
    (66, 1.5353e-4),
    (90, 3.1698e-6),
    (95, 1.2110e-6),
    (100, 4.9735e-7),
    (105, 2.1166e-7),
    (110, 9.8290e-8),
    (115, 4.6227e-8),
    (120, 2.4357e-8),
    (125, 1.2752e-8),
    (130, 7.5890e-9),
    (140, 3.3937e-9),
    (150, 1.8354e-9),
    (160, 1.1587e-9),
)


def mission(name="ares_v"):
    loaded = load_mission(name)
    start = loaded.start()
    return loaded.arrays(), navigation(start.time_s, start.position, start.velocity)


@pytest.fixture
def ares():
    return mission()


def spline_table():
    """Return the points of the thesis joined by a cubic spline of log density."""
    h = np.array([1e3 * row[0] for row in THESIS_FORM])
    spline = CubicSpline(h, np.log([row[1] for row in THESIS_FORM]))
    table = np.zeros((h.size, 5))
    table[:, 0] = h
    table[:-1, 1:] = spline.c[::-1].T
    table[-1, 1] = spline(h[-1])
    table[-1, 2] = spline(h[-1], 1)
    return table


def smooth_table():
    """Return a table of one cubic, without knots that disturb differences."""
    c = (math.log(3.3e-4), -1.0 / 7.0e3, 1.2e-10, 2e-16)
    x = 340e3
    end = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    slope = c[1] + x * (2.0 * c[2] + 3.0 * x * c[3])
    return np.array([[60e3, *c], [400e3, end, slope, 0.0, 0.0]])


def mass_at(cutoff):
    """Return the mass left of the upper stage, kg (Table 2.2)."""
    return 307837.0 - 5837.0 - FLOW * (cutoff - 337.15)


class TestPublishedOptima:
    def test_default_mission(self, ares):
        solution = solve_indirect(*ares)
        assert solution.converged, solution.reason
        assert solution.m_f_kg == pytest.approx(174183.1, abs=0.1)
        assert solution.t_plf_s == pytest.approx(416.64, abs=0.01)
        assert solution.t_meco_s == pytest.approx(766.907, abs=0.001)
        assert solution.m_f_kg == pytest.approx(mass_at(solution.t_meco_s), abs=1e-6)

    def test_density_of_the_reference(self, ares):
        arrays, start = ares
        solution = solve_indirect(arrays._replace(atmosphere=spline_table()), start)
        assert solution.m_f_kg == pytest.approx(174183.114, abs=0.005)
        assert solution.t_plf_s == pytest.approx(416.642, abs=0.001)
        assert solution.t_meco_s == pytest.approx(766.9067, abs=0.0001)

    def test_other_densities_move_the_jettison_by_a_tenth_of_a_second(self, ares):
        """Compare pra63 as dense data and as exponential layers: 0.3 % of density."""
        arrays, start = ares
        for table, jettison, mass in (
            (pra63_data().table, 416.514, 174183.615),
            (pra63_exponential().table, 416.782, 174182.508),
        ):
            solution = solve_indirect(arrays._replace(atmosphere=table), start)
            assert solution.t_plf_s == pytest.approx(jettison, abs=0.02)
            assert solution.m_f_kg == pytest.approx(mass, abs=0.1)

    def test_spherical_altitude(self, ares):
        arrays, start = ares
        arrays.environment["altitude_model"] = ALTITUDE_SPHERICAL
        solution = solve_indirect(arrays._replace(atmosphere=spline_table()), start)
        assert solution.converged, solution.reason
        assert solution.m_f_kg == pytest.approx(174087.3, abs=0.5)
        assert solution.t_plf_s == pytest.approx(433.40, abs=0.01)
        assert solution.t_meco_s == pytest.approx(767.229, abs=0.001)

    def test_jettison_held(self, ares):
        arrays, start = ares
        arrays.jettisons["criterion"] = MISSION_TIME
        arrays.jettisons["value"] = 441.02
        solution = solve_indirect(arrays, start)
        assert solution.converged, solution.reason
        assert solution.m_f_kg == pytest.approx(174088.9, abs=0.1)
        assert solution.t_meco_s == pytest.approx(767.22, abs=0.005)
        assert solution.jettison_times_s == (441.02,)

    def test_passive_jettison(self, ares):
        solution = solve_indirect(*ares, TwoPointOptions(heating=Heating.PASSIVE))
        assert solution.converged, solution.reason
        assert solution.m_f_kg == pytest.approx(174151.0, abs=5.0)
        assert solution.t_plf_s == pytest.approx(428.6, abs=0.6)
        assert solution.verification.fmhr_w_m2 == pytest.approx(1135.0, rel=1e-6)

    def test_no_fairing_constraint_is_above_all(self, ares):
        solution = solve_indirect(*ares, TwoPointOptions(heating=Heating.IGNORED))
        assert solution.converged, solution.reason
        assert solution.m_f_kg == pytest.approx(174576.55, abs=0.1)
        assert solution.t_plf_s == pytest.approx(337.15)

    def test_delta_iii(self):
        solution = solve_indirect(*mission("delta_iii"))
        assert solution.converged, solution.reason
        assert solution.m_f_kg == pytest.approx(7529.712, abs=0.01)
        assert solution.t_meco_s == pytest.approx(924.139, abs=0.001)

    def test_saturn_v(self):
        """Solve with coasts, ramps, tail-offs, three drops at fixed times, a fixed plane."""
        solution = solve_indirect(*mission("saturn_v_as506"))
        assert solution.converged, solution.reason
        assert solution.jettison_times_s == (167.0, 192.3, 197.9)
        # flown: insertion at 709.33 s, by a law that is not optimal
        assert 690.0 < solution.t_meco_s < 709.33


class TestProof:
    def test_verification(self, ares):
        solution = solve_indirect(*ares)
        proof = solution.verification
        assert proof.radius_m == pytest.approx(6518889.0, abs=1e-3)
        assert proof.speed_m_s == pytest.approx(7840.675, abs=1e-6)
        assert proof.flight_path_angle_deg == pytest.approx(1.0064, abs=1e-7)
        assert proof.inclination_deg == pytest.approx(28.5, abs=1e-7)
        assert proof.fmhr_w_m2 == pytest.approx(1135.0, rel=1e-6)
        assert proof.position_defect_m < 1e-3
        assert proof.velocity_defect_m_s < 1e-5

    def test_without_verification(self, ares):
        arrays, start = ares
        solution = solve_indirect(arrays, start, verify=False)
        assert solution.converged
        assert solution.verification is None and solution.costates is None
        assert [arc.start_s for arc in solution.arcs] == pytest.approx(
            [155.9, 337.15, 416.5], abs=0.2
        )
        again = solve_indirect(arrays, start, guess=solution)
        assert again.t_meco_s == pytest.approx(solution.t_meco_s, abs=1e-8)

    @pytest.mark.parametrize("name", ["ares_v", "delta_iii", "saturn_v_as506"])
    def test_hamiltonian_is_constant_on_every_arc(self, name):
        solution = solve_indirect(*mission(name))
        assert max(solution.costates.hamiltonian_spread) < 5e-9
        assert solution.notes["final_hamiltonian_m_s2"] > 0.0

    def test_turn_about_the_pole_is_kept(self, ares):
        """Keep C . z = 0 under gravity, thrust along the primer and the jump."""
        solution = solve_indirect(*ares)
        assert solution.notes["pole_turn_spread_m_s"] < 1e-9

    def test_jump(self, ares):
        """Check Eqs. 3.44-3.51 in full: the costates before and after the drop."""
        arrays, start = ares
        solution = solve_indirect(arrays, start)
        costates = solution.costates
        (at,) = np.flatnonzero(np.isclose(costates.time_s, solution.t_plf_s, atol=1e-9))[:1]
        environment = arrays.environment[0]
        flight = TwoPointSolver(arrays).sample(start, solution.parameters)
        r = tuple(flight[at, sample.POSITION : sample.POSITION + 3])
        v = tuple(flight[at, sample.VELOCITY : sample.VELOCITY + 3])
        _, by_r, by_v = log_heating_gradient(r, v, environment, arrays.atmosphere)
        pi = costates.jump_pi[0] * heating_rate(r, v, environment, arrays.atmosphere)
        change_r = costates.lambda_r[at] - costates.lambda_r[at + 1]
        change_v = costates.lambda_v[at] - costates.lambda_v[at + 1]
        np.testing.assert_allclose(change_r, pi * np.array(by_r), rtol=1e-6)
        np.testing.assert_allclose(change_v, pi * np.array(by_v), rtol=1e-6)
        assert costates.hamiltonian[at] == pytest.approx(costates.hamiltonian[at + 1], rel=1e-9)
        # the jump of the thrust direction is small, that of its rate is not
        before, after = costates.lambda_v[at], costates.lambda_v[at + 1]
        turn = np.linalg.norm(np.cross(before, after))
        assert math.degrees(turn / np.linalg.norm(before) ** 2) < 0.1
        assert np.linalg.norm(change_r) > 0.2 * np.linalg.norm(costates.lambda_r[at])

    def test_multipliers_foretell_neighbouring_optima(self, ares):
        arrays, start = ares
        base = solve_indirect(arrays, start)
        worth = {check.name: check.multiplier for check in base.constraints}
        changes = {
            "radius at cut-off": ("radius", 200.0, 1.0),
            "speed at cut-off": ("speed", 0.5, 1.0),
            "flight-path angle at cut-off": ("flight_path_angle", 0.01, math.pi / 180.0),
            "inclination": ("inclination", 0.001, math.pi / 180.0),
        }
        for name, (field, step, unit) in changes.items():
            masses = []
            for sign in (-1.0, 1.0):
                other, _ = mission()
                other.target[field] += sign * step * unit
                masses.append(solve_indirect(other, start).m_f_kg)
            assert worth[name] == pytest.approx((masses[1] - masses[0]) / (2 * step), rel=2e-3)
        masses = []
        for limit in (1134.0, 1136.0):
            other, _ = mission()
            other.jettisons["value"] = limit
            masses.append(solve_indirect(other, start).m_f_kg)
        slope = 0.5 * (masses[1] - masses[0])
        assert worth["heating at jettison 0"] == pytest.approx(slope, rel=2e-3)


EIGHTH_ORDER = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


def assert_jacobian_exact(solver, start, unknowns):
    _, jacobian, _ = solver.shoot(start, unknowns)
    n = unknowns.size
    unit = np.array([1.0] * 3 + [1e-3] * 3 + [100.0] + [100.0, 5.0] * ((n - 7) // 2))
    for c in range(n):
        h = 2e-3 * unit[c]
        column = np.zeros(n)
        for k, weight in EIGHTH_ORDER:
            for sign in (1.0, -1.0):
                moved = unknowns.copy()
                moved[c] += sign * k * h
                column += sign * weight / h * solver.shoot(start, moved)[0]
        scale = np.abs(jacobian * unit).max(axis=1)
        np.testing.assert_array_less(
            np.abs(column - jacobian[:, c]) * unit[c], 1e-8 * scale + 1e-30
        )


class TestJacobian:
    @pytest.mark.parametrize("gravity", ["inverse_square", "linear"])
    @pytest.mark.parametrize("heating", ["at_jettison", "passive"])
    def test_ares(self, ares, gravity, heating):
        arrays, start = ares
        arrays = arrays._replace(atmosphere=smooth_table())
        solver = TwoPointSolver(arrays, TwoPointOptions(gravity=gravity, heating=heating))
        unknowns = np.array([-0.05, -0.96, 0.25, -1.1e-3, -5e-4, 7e-4, 766.7, 416.3, -2.3])
        assert_jacobian_exact(solver, start, unknowns)

    @pytest.mark.parametrize("step_s", [10.0, 40.0])
    def test_keplerian_target(self, step_s):
        """Check the derivative of the discrete map, exact with coarse steps too."""
        arrays, start = mission("delta_iii")
        solver = TwoPointSolver(arrays, TwoPointOptions(step_s=step_s))
        unknowns = solver.solve(start).unknowns * (1.0 + 1e-3 * np.sin(np.arange(7)))
        assert_jacobian_exact(solver, start, unknowns)

    def test_ramps_tails_coasts_and_two_heating_drops(self):
        arrays, start = mission("saturn_v_as506")
        arrays.jettisons["criterion"][1:] = HEATING_LIMIT
        arrays.jettisons["value"][1:] = [2e5, 2e4]
        solver = TwoPointSolver(arrays._replace(atmosphere=smooth_table()))
        root = solver.solve(start)
        assert root.converged
        unknowns = root.unknowns * (1.0 + 1e-3 * np.sin(np.arange(11)))
        assert_jacobian_exact(solver, start, unknowns)

    def test_log_heating_hessian(self, ares):
        arrays, start = ares
        environment = arrays.environment[0]
        atmosphere = smooth_table()
        rng = np.random.default_rng(5)
        r = start["position"][0] * 1.015
        v = start["velocity"][0] * 2.5
        for _ in range(5):
            dr, dv = rng.normal(size=3) * 1e3, rng.normal(size=3) * 10.0
            got = log_heating_hessian_product(
                tuple(r), tuple(v), tuple(dr), tuple(dv), environment, atmosphere
            )
            total = np.zeros((2, 3))
            for k, weight in EIGHTH_ORDER:
                for sign in (1.0, -1.0):
                    x = r + sign * k * 0.02 * dr
                    y = v + sign * k * 0.02 * dv
                    gradient = log_heating_gradient(tuple(x), tuple(y), environment, atmosphere)
                    total += sign * weight / 0.02 * np.array(gradient[1:])
            np.testing.assert_allclose(got, total, rtol=1e-8, atol=1e-9 * np.abs(total).max())

    def test_altitude_hessian_is_symmetric(self, ares):
        arrays, start = ares
        r = tuple(start["position"][0])
        rows = [altitude_hessian_product(r, tuple(e), arrays.environment[0]) for e in np.eye(3)]
        np.testing.assert_allclose(rows, np.transpose(rows), rtol=1e-12, atol=1e-22)


def test_runge_kutta_nystroem_is_of_order_six():
    segment = np.zeros(1, SEGMENT)
    segment["end"] = 400.0
    segment["thrust"], segment["flow"], segment["mass"] = 1.3e6, 297.0, 302000.0
    first = np.array([6.5e6, 1e5, 2e5, 100.0, 4e3, 50.0, 0.3, 0.9, 0.1, 1e-4, -1e-3, 5e-4])

    def end(steps):
        work = np.zeros(1, WORK)
        work["state"] = first
        integrate_segment(segment[0], steps, Gravity(3.986e14, 0.0, INVERSE_SQUARE, 0.0), work[0])
        return work["state"][0].copy()

    exact = end(400)
    errors = [np.linalg.norm(end(k)[:3] - exact[:3]) for k in (10, 20)]
    assert 5.5 < math.log2(errors[0] / errors[1]) < 7.5


def test_a_step_in_which_the_thrust_flips_is_divided():
    """Pass zero at 1e-4 s: the integral of p / |p| is known."""
    segment = np.zeros(1, SEGMENT)
    segment["end"] = 40.0
    segment["thrust"], segment["mass"] = 5000.0, 1000.0
    away, rate, begin = 1e-4, 1.0, -13.0

    def gained(t):
        return np.array([math.hypot(away, rate * t) / rate, away * math.asinh(rate * t / away)])

    for steps in (1, 7):
        work = np.zeros(1, WORK)
        work["state"][0, 0] = 1e12
        work["state"][0, 6:] = rate * begin, away, 0.0, rate, 0.0, 0.0
        integrate_segment(segment[0], steps, Gravity(1e-9, 0.0, INVERSE_SQUARE, 0.0), work[0])
        wanted = 5.0 * (gained(begin + 40.0) - gained(begin))
        np.testing.assert_allclose(work["state"][0, 3:5], wanted, atol=1e-5)


class TestConvergence:
    def test_thesis_guess(self, ares):
        """Start from Eq. 3.41: thrust along V0, rates 1e-4, t_PLF 420 s, 330 s of burn after it."""
        arrays, start = ares
        velocity = start["velocity"][0]
        guess = IndirectGuess(tuple(velocity), (-0.189644,) * 3, 750.0, (420.0,))
        alone = TwoPointSolver(arrays).solve(start, guess.unknowns(1), restart=False)
        assert alone.converged
        assert alone.unknowns[6] == pytest.approx(766.905, abs=0.01)
        assert solve_indirect(arrays, start, guess=guess).converged

    def test_random_guesses(self, ares):
        """Disperse B by 60 deg from V0, A by 2e-3, times by 30 %: always one optimum."""
        arrays, start = ares
        solver = TwoPointSolver(arrays, TwoPointOptions(step_s=40.0))
        reference = solver.solve(start).unknowns[6]
        axis = start["velocity"][0] / np.linalg.norm(start["velocity"][0])
        rng = np.random.default_rng(2)
        alone = 0
        for _ in range(200):
            across = np.cross(axis, rng.normal(size=3))
            angle = math.radians(60.0) * math.sqrt(rng.random())
            direction = math.cos(angle) * axis + math.sin(angle) * across / np.linalg.norm(across)
            drop = 155.9 + 264.1 * rng.uniform(0.7, 1.3)
            unknowns = np.array(
                [
                    *direction,
                    *rng.uniform(-2e-3, 2e-3, 3),
                    drop + 330.0 * rng.uniform(0.7, 1.3),
                    drop,
                    0.0,
                ]
            )
            root = solver.solve(start, unknowns, restart=False)
            if root.converged:
                # never a success elsewhere
                assert root.unknowns[6] == pytest.approx(reference, abs=1e-3)
                alone += 1
            root = solver.solve(start, unknowns)
            assert root.converged
            assert FLOW * abs(root.unknowns[6] - reference) < 1.0
        assert alone > 40

    @pytest.mark.parametrize(("scale", "least"), [(1.0, 100), (10.0, 100), (30.0, 98)])
    def test_dispersed_starts(self, ares, scale, least):
        """Solve from the state alone, with 1 km and 10 m/s per axis times ``scale``."""
        arrays, start = ares
        solver = TwoPointSolver(arrays, TwoPointOptions(step_s=40.0, tolerance=1e-6))
        rng = np.random.default_rng(7)
        done = 0
        for _ in range(100):
            moved = start.copy()
            moved["position"] += scale * 1e3 * rng.normal(size=3)
            moved["velocity"] += scale * 10.0 * rng.normal(size=3)
            done += solver.solve(moved).converged
        assert done >= least

    def test_warm_start_takes_one_jacobian(self, ares):
        arrays, start = ares
        solver = TwoPointSolver(arrays, TwoPointOptions(step_s=40.0, tolerance=1e-6))
        root = solver.solve(start)
        kicked = start.copy()
        kicked["position"] += 30.0
        kicked["velocity"] -= 0.3
        warm = solver.solve(kicked, root.unknowns, restart=False)
        assert warm.converged and warm.iterations == 1
        again = solver.solve(kicked)
        np.testing.assert_allclose(warm.unknowns[6:8], again.unknowns[6:8], atol=1e-4)

    @pytest.mark.parametrize("time_s", [250.0, 337.15, 380.0, 416.0, 500.0, 700.0])
    def test_remainder_of_an_optimum_is_optimal(self, ares, time_s):
        """Reach the same end from any state on the optimum (Bellman)."""
        arrays, start = ares
        solver = TwoPointSolver(arrays)
        root = solver.solve(start)
        flight = solver.sample(start, root.unknowns, 0.25)
        row = flight[np.searchsorted(flight[:, sample.TIME], time_s, side="right") - 1]
        dropped = bool(row[sample.TIME] > root.unknowns[7])
        late = navigation(
            row[sample.TIME],
            row[sample.POSITION : sample.POSITION + 3],
            row[sample.VELOCITY : sample.VELOCITY + 3],
            row[sample.MASS],
            arc=1 if row[sample.TIME] >= 337.15 else 0,
            arc_start_time_s=337.15 if row[sample.TIME] >= 337.15 else 155.9,
            jettisoned=int(dropped),
        )
        rest = solver.solve(late)
        assert rest.converged
        assert rest.unknowns.size == (7 if dropped else 9)
        assert rest.unknowns[6] == pytest.approx(root.unknowns[6], abs=1e-5)
        if not dropped:
            assert rest.unknowns[7] == pytest.approx(root.unknowns[7], abs=1e-3)

    @pytest.mark.parametrize("ladder", [from_linear_gravity, from_light_drops, from_high_limits])
    def test_continuations_lead_there_too(self, ares, ladder):
        arrays, start = ares
        solver = TwoPointSolver(arrays)
        root = ladder(solver, start)
        assert root.converged
        assert root.unknowns[6] == pytest.approx(766.907, abs=0.001)
        # the mission is left as it was
        assert arrays.jettisons["mass"].tolist() == [5837.0]
        assert arrays.jettisons["value"].tolist() == [1135.0]

    @settings(max_examples=25)
    @given(
        mass=st.floats(500.0, 12000.0),
        limit=st.floats(200.0, 20000.0),
        thrust=st.floats(0.85, 1.1),
    )
    def test_vehicles_of_all_sorts(self, mass, limit, thrust):
        arrays, start = mission()
        arrays.jettisons["mass"] = mass
        arrays.jettisons["value"] = limit
        arrays.arcs["thrust"] *= thrust
        arrays.arcs["mass_flow"] *= thrust
        arrays.arcs["duration"][0] /= thrust
        root = TwoPointSolver(arrays, TwoPointOptions(step_s=40.0)).solve(start)
        assert root.converged
        assert root.unknowns[8] < 0.0


class TestHeatingLimit:
    def test_later_with_a_denser_atmosphere(self, ares):
        arrays, start = ares
        solver = TwoPointSolver(arrays)
        times, masses = [], []
        for factor in (0.5, 1.0, 1.2, 1.5, 1.8, 2.2, 5.0):
            arrays.environment["density_factor"] = factor
            root = solver.solve(start)
            assert root.converged
            times.append(root.unknowns[7])
            masses.append(-root.unknowns[6])
        assert np.all(np.diff(times) > 0.0) and np.all(np.diff(masses) < 0.0)

    def test_limit_met_from_the_start_does_not_bind(self, ares):
        arrays, start = ares
        arrays.jettisons["value"] = 1e6
        solution = solve_indirect(arrays, start)
        assert solution.converged, solution.reason
        assert solution.t_plf_s == pytest.approx(337.15)
        assert solution.costates.jump_pi == (0.0,)
        free = solve_indirect(arrays, start, TwoPointOptions(heating=Heating.IGNORED))
        assert solution.m_f_kg == pytest.approx(free.m_f_kg, abs=1e-6)
        worth = {check.name: check.multiplier for check in solution.constraints}
        assert worth["heating at jettison 0"] == 0.0
        for check in free.constraints[:4]:
            assert worth[check.name] == pytest.approx(check.multiplier, rel=1e-6)

    def test_drop_held_at_its_earliest_time(self, ares):
        """Set the limit just below the heating at the earliest drop: its time is fixed."""
        arrays, start = ares
        free = solve_indirect(arrays, start, TwoPointOptions(heating=Heating.IGNORED))
        at = free.trajectory.time_s.searchsorted(337.15)
        arrays.jettisons["value"] = 0.97 * free.trajectory.heating_rate[at]
        solution = solve_indirect(arrays, start)
        assert solution.converged, solution.reason
        assert solution.t_plf_s == pytest.approx(337.15, abs=1e-5)
        assert solution.costates.jump_pi[0] < 0.0
        assert solution.verification.fmhr_w_m2 <= arrays.jettisons["value"][0] * (1 + 1e-6)

    def test_two_heating_drops(self, ares):
        arrays, start = ares
        arrays = arrays._replace(jettisons=np.repeat(arrays.jettisons, 2))
        arrays.jettisons["mass"] = [2000.0, 3837.0]
        arrays.jettisons["value"] = [5000.0, 1135.0]
        solution = solve_indirect(arrays, start)
        assert solution.converged, solution.reason
        first, second = solution.jettison_times_s
        assert first < second
        assert all(pi < 0.0 for pi in solution.costates.jump_pi)
        # part of the fairing is dropped earlier than in the default mission
        assert 174183.2 < solution.m_f_kg < 174576.5


class TestObstacles:
    def test_too_little_propellant(self, ares):
        arrays, start = ares
        arrays.arcs["propellant"][1] = 100000.0
        solution = solve_indirect(arrays, start)
        assert not solution.converged
        assert solution.reason.startswith("propellant of the last stage: 27,817 kg short")
        assert solution.m_f_kg == pytest.approx(174183.1, abs=0.1)

    def test_target_below_the_surface(self, ares):
        arrays, start = ares
        arrays.target["radius"] = 6.3e6
        solution = solve_indirect(arrays, start)
        assert not solution.converged
        assert "target radius 6,300,000 m is 56,750 m below the surface" in solution.reason

    def test_limit_that_is_never_met(self, ares):
        arrays, start = ares
        arrays.jettisons["value"] = 1e-2
        solution = solve_indirect(arrays, start)
        assert not solution.converged
        assert "heating limit of jettison 0, 0.01 W/m2" in solution.reason
        assert solution.iterations < 2000

    def test_weak_engine(self, ares):
        arrays, start = ares
        arrays.arcs["thrust"][1] /= 10.0
        arrays.arcs["mass_flow"][1] /= 10.0
        solution = solve_indirect(arrays, start)
        assert not solution.converged
        assert solution.reason.startswith("the root found is not a flight: below ground")
        assert solution.iterations < 200

    def test_only_what_is_off_is_said_to_be(self, ares, monkeypatch):
        """Report no target error for a root that meets its target but fails otherwise."""
        arrays, start = ares
        solver = TwoPointSolver(arrays, TwoPointOptions(heating=Heating.IGNORED))
        root = solver.solve(start)
        assert root.converged
        unsound = replace(root, status=newton.UNSOUND)
        monkeypatch.setattr(solver, "solve", lambda _start: unsound)
        cause = failure_cause(solver, start, unsound)
        assert cause.status is Status.NOT_OPTIMAL
        assert cause.reason.startswith("the root found is not a flight: below ground")
        solver.arrays.target["radius"] += 200.0
        cause = failure_cause(solver, start, unsound)
        assert cause.status is Status.INFEASIBLE
        assert cause.reason == "no flight to the target found: radius off by -200 m, allowed 100 m"

    def test_linear_gravity_is_no_proof(self, ares):
        """Refuse a root of the linear field by the independent flight."""
        solution = solve_indirect(*ares, TwoPointOptions(gravity="linear"))
        assert not solution.converged
        assert solution.reason.startswith("optimal in the linear field, but")
        assert solution.notes["residual_norm"] < 1e-8
        assert max(solution.costates.hamiltonian_spread) < 5e-9
        assert solution.t_meco_s == pytest.approx(778.075, abs=0.01)

    def test_bad_choices(self):
        for key, value in (
            ("gravity", "cubic"),
            ("propagator", "euler"),
            ("heating", "off"),
            ("rule", "trapezoid"),
        ):
            with pytest.raises(OptimizerError, match=f"^{key} is '{value}'; expected "):
                TwoPointOptions(**{key: value})
        with pytest.raises(OptimizerError, match="step_s is 0; expected more than 0"):
            TwoPointOptions(step_s=0.0)

    def test_bad_guesses(self, ares):
        arrays, start = ares
        for guess, text in (
            (IndirectGuess((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 760.0, (420.0,)), "lambda_v"),
            (IndirectGuess((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 760.0), "jettison_times_s has 0"),
            (
                IndirectGuess((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 760.0, (420.0,), (0.0, 0.0)),
                "pi has 2",
            ),
            (IndirectGuess((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), math.nan, (420.0,)), "finite"),
            (np.zeros(7), "shape"),
        ):
            with pytest.raises(OptimizerError, match=text):
                solve_indirect(arrays, start, guess=guess)

    def test_missions_that_the_method_cannot_take(self, ares):
        arrays, start = ares
        arrays.environment["j2"] = 1.0826e-3
        with pytest.raises(OptimizerError, match=r"environment\.j2 is 0\.0010826"):
            solve_indirect(arrays, start, TwoPointOptions(propagator="closed_form"))
        arrays.environment["j2"] = 0.0
        arrays.arcs["kind"][1] = COAST
        with pytest.raises(OptimizerError, match="the last arc is a coast"):
            solve_indirect(arrays, start)


class TestOtherTargets:
    @pytest.mark.parametrize("inclination", [29.0, 35.0, 60.0])
    def test_either_plane_is_tried(self, ares, inclination):
        """Try both planes of one inclination; the nearer one is better."""
        arrays, start = ares
        arrays.target["inclination"] = math.radians(inclination)
        solution = solve_indirect(arrays, start, TwoPointOptions(heating=Heating.IGNORED))
        assert solution.converged, solution.reason
        expected = {29.0: 766.0, 35.0: 790.39, 60.0: 911.42}[inclination]
        assert solution.t_meco_s == pytest.approx(expected, abs=0.6)

    def test_node_fixed_where_the_free_one_is(self, ares):
        arrays, start = ares
        free = solve_indirect(arrays, start)
        arrays.target["kind"] = TARGET_RADIUS_SPEED_ANGLE_PLANE
        arrays.target["ascending_node"] = math.radians(free.verification.ascending_node_deg)
        fixed = solve_indirect(arrays, start)
        assert fixed.converged, fixed.reason
        assert fixed.m_f_kg == pytest.approx(free.m_f_kg, abs=1e-4)
        (node,) = [check for check in fixed.constraints if check.name == "ascending node"]
        # a free node is worth nothing
        assert abs(node.multiplier) < 0.1

    def test_equatorial_orbit(self, ares):
        """Fix the plane at inclination 0, where the node is undefined."""
        arrays, start = ares
        arrays.target["inclination"] = 0.0
        arrays.jettisons["value"] = 1e6
        root = TwoPointSolver(arrays).solve(start)
        assert root.converged


class TestTimetable:
    def build(self, arrays, start, cutoff, heating=2, times=(0.0,) * 8):
        segments = np.zeros(MAX_SEGMENTS, SEGMENT)
        count = build_timetable(
            start[0],
            arrays.arcs,
            arrays.jettisons,
            Times(heating, np.array(times), np.zeros(0), cutoff),
            segments,
        )
        return segments[:count]

    def test_masses_of_table_2_2(self, ares):
        segments = self.build(*ares, 769.45, heating=0, times=(441.02,) * 8)
        assert segments["start"].tolist() == [155.9, 337.15, 441.02]
        last = segments[-1]
        length = last["end"] - last["start"]
        assert last["mass"] - last["flow"] * length == pytest.approx(173427.0, abs=1.0)
        assert segments[1]["end_heating"] == 0

    def test_drop_after_cut_off_never_comes(self, ares):
        segments = self.build(*ares, 760.0, heating=0, times=(900.0,) * 8)
        assert len(segments) == 2
        assert segments[-1]["end_heating"] == -1

    def test_burn_ends_when_its_propellant_is_gone(self, ares):
        arrays, start = ares
        arrays.arcs["propellant"][0] = 100.0 * arrays.arcs["mass_flow"][0]
        assert self.build(arrays, start, 700.0)["start"][1] == pytest.approx(255.9)

    def test_cut_off_before_the_last_burn(self, ares):
        assert len(self.build(*ares, 300.0)) == 0

    def test_impulse_of_curves(self):
        """Compare the loss of mass with the area under ramps and tail-offs."""
        arrays, start = mission("saturn_v_as506")
        segments = self.build(arrays, start, 700.0)
        last_stage = segments[segments["arc"] >= len(arrays.arcs) - 1]
        lengths = last_stage["end"] - last_stage["start"]
        burnt = np.sum(lengths * (last_stage["flow"] + 0.5 * lengths * last_stage["flow_slope"]))
        arc = arrays.arcs[-1]
        seconds = 700.0 - last_stage["start"][0] - arc["start_loss"] + arc["tail_gain"]
        assert burnt == pytest.approx(seconds * arc["mass_flow"], rel=1e-9)

    def test_time_after_ignition(self, ares):
        arrays, start = ares
        arrays.jettisons["criterion"] = TIME_AFTER_IGNITION
        arrays.jettisons["value"] = 30.0
        assert self.build(arrays, start, 700.0)["start"].tolist() == pytest.approx(
            [155.9, 337.15, 367.15]
        )


def test_failure_statuses_are_told_apart(ares):
    arrays, start = ares
    solver = TwoPointSolver(arrays, TwoPointOptions(max_iterations=1))
    root = solver.solve(
        start, np.array([0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 760.0, 420.0, 0.0]), restart=False
    )
    assert root.status == newton.ITERATION_LIMIT and not root.converged
