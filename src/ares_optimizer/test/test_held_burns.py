# SPDX-License-Identifier: Apache-2.0
"""Test burns in held attitude: exact derivatives, the optimum by two methods, their cost."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ares_models.judge import End
from ares_models.mission import load_mission
from ares_optimizer.indirect.solver import TwoPointSolver
from ares_optimizer.kernels.timetable import MAX_UNKNOWNS
from ares_optimizer.plan import held_ahead
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.proof.held import held_checks, held_obstacle, held_offsets
from ares_optimizer.registry import HELD_METHODS, METHODS
from ares_optimizer.solution import NOTHING_SAVED, Check, Status, UnfitMethod
from ares_optimizer.solve import solve
from ares_optimizer.two_point.kernels.guess import OwnStart
from ares_optimizer.two_point.kernels.newton import CONVERGED
from ares_optimizer.two_point.kernels.search import _solve_timed_first

MISSIONS = Path(__file__).parent / "missions"
MIDDLE = "solid_middle"
KICK = "solid_kick"


def text_of(name, *changes):
    text = (MISSIONS / f"{name}.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


@pytest.fixture
def edited(tmp_path):
    def make(name, *changes):
        path = tmp_path / f"{name}.yaml"
        path.write_text(text_of(name, *changes))
        return load_mission(path)

    return make


def mission(name):
    return load_mission(MISSIONS / f"{name}.yaml")


def guided(flight):
    """Return the same mission with all burns guided."""
    arrays = flight.arrays()
    arrays.arcs["held"] = 0
    return arrays


@pytest.fixture(scope="module")
def solved():
    return {name: solve(mission(name), "indirect") for name in (MIDDLE, KICK)}


@pytest.fixture(scope="module")
def unheld():
    return {
        name: solve(guided(mission(name)), "indirect", state=mission(name).start().navigation())
        for name in (MIDDLE, KICK)
    }


OBLATE = ("g0_m_s2", "j2: 1.08263e-3\n  g0_m_s2")
#: The solid is throttled in proportion to its mass, and no further than to half of its thrust.
THROTTLED = (
    "attitude: held",
    "attitude: held\n        max_acceleration_m_s2: 40.0\n        min_throttle: 0.5",
)
#: A shroud dropped during the burn of the solid.
SHROUD = (
    ("density_factor: 1.0e-12", "density_factor: 1.0"),
    (
        "target:",
        (
            "jettisons:\n  - name: shroud\n    mass_kg: 60.0\n    stage: stage 2\n"
            "    heating_limit_w_m2: 100.0\n\ntarget:"
        ),
    ),
)
#: The solid burns out slowly, in the coast before the next ignition.
TAIL = (
    "attitude: held",
    "attitude: held\n        tail_off: [[0.0, 0.6], [2.0, 0.2], [5.0, 0.0]]\n      - coast_s: 12.0",
)


class TestHeldJacobian:
    """Compare with five-point differences."""

    def check(self, flight, name, solved, longer=1.5):
        start = flight.start().navigation()
        solver = TwoPointSolver(flight.arrays())
        known = solved[name].parameters
        base = np.zeros(solver.size(start))
        held = 3 * len(held_ahead(solver.arrays, start[0]))
        base[:7] = known[:7]
        base[base.size - held :] = known[known.size - held :]
        drops = solver.drops(start)
        base[7 : 7 + 2 * drops : 2] = 157.3
        base[8 : 8 + 2 * drops : 2] = -0.03
        base[solver.ends(start)] = known[7 : known.size - held]
        # away from the root, where nothing is 0
        base[:6] *= np.linspace(1.01, 0.98, 6)
        base[base.size - held :] += 0.02
        # no segment is a whole number of steps long, so its number of steps does not change
        base[6] += longer
        _, jacobian, _ = solver.shoot(start, base)
        steps = np.full(base.size, 2e-2)
        steps[:3] = 1e-4
        steps[3:6] = 1e-7
        steps[8 : 8 + 2 * drops : 2] = 1e-3
        steps[base.size - held :] = 1e-3
        for c, step in enumerate(steps):
            move = np.zeros(base.size)
            move[c] = step
            near, far = (
                solver.shoot(start, base + k * move)[0] - solver.shoot(start, base - k * move)[0]
                for k in (1, 2)
            )
            difference = (8.0 * near - far) / (12.0 * step)
            size = np.abs(jacobian[:, c]).max()
            np.testing.assert_allclose(difference, jacobian[:, c], rtol=1e-7, atol=1e-9 * size)

    @pytest.mark.parametrize("name", [MIDDLE, KICK])
    def test_is_exact(self, solved, name):
        self.check(mission(name), name, solved)

    @pytest.mark.parametrize("name", [MIDDLE, KICK])
    def test_with_oblateness(self, edited, solved, name):
        self.check(edited(name, OBLATE), name, solved)

    @pytest.mark.parametrize("name", [MIDDLE, KICK])
    def test_throttled(self, edited, solved, name):
        self.check(edited(name, THROTTLED), name, solved)

    def test_a_drop_within_the_burn(self, edited, solved):
        self.check(edited(MIDDLE, *SHROUD), MIDDLE, solved)

    def test_with_a_tail_off(self, edited, solved):
        self.check(edited(MIDDLE, TAIL), MIDDLE, solved, longer=13.5)


class TestSameOptimum:
    """Compare the two-point problem with the direct methods, which have no costates."""

    def test_held_in_the_middle(self, solved):
        flight = mission(MIDDLE)
        assert solved[MIDDLE].converged, solved[MIDDLE].reason
        coarse, fine = (solve(flight, method) for method in ("direct11", "direct20"))
        assert fine.m_f_kg == pytest.approx(solved[MIDDLE].m_f_kg, abs=1e-4)
        assert coarse.m_f_kg == pytest.approx(solved[MIDDLE].m_f_kg, abs=5e-3)
        assert coarse.m_f_kg < solved[MIDDLE].m_f_kg
        (ours,), (theirs,) = (
            [arc for arc in s.arcs if not any(arc.direction_rate) and arc.delta_v_m_s > 0.0]
            for s in (solved[MIDDLE], fine)
        )
        assert theirs.direction == pytest.approx(ours.direction, abs=1e-4)

    def test_a_kick_after_a_free_coast(self, solved):
        solution = solved[KICK]
        assert solution.converged, solution.reason
        direct = solve(mission(KICK), "direct11")
        assert direct.converged, direct.reason
        assert direct.delta_v_m_s == pytest.approx(solution.delta_v_m_s, abs=2e-3)
        assert direct.lengths_s[0] == pytest.approx(solution.lengths_s[0], abs=0.01)
        # there a second of coast costs almost nothing
        assert direct.lengths_s[1] == pytest.approx(solution.lengths_s[1], abs=1.0)
        assert direct.flown[-1].end_s - direct.flown[-1].start_s == pytest.approx(40.0, abs=1e-3)
        assert direct.arcs[-1].direction == pytest.approx(solution.arcs[-1].direction, abs=1e-3)

    @pytest.mark.parametrize("name", ["titan2_circular", "titan2_coast"])
    def test_held_from_the_start(self, edited, name):
        """Hold the first burn, before a guided burn and before a free coast."""
        burn = "burn_time_s: 148.102380138703"
        flight = edited(name, (burn, f"{burn}\n    attitude: held"))
        solution = solve(flight, "indirect")
        assert solution.converged, solution.reason
        direct = solve(flight, "direct11")
        assert direct.converged, direct.reason
        assert direct.delta_v_m_s == pytest.approx(solution.delta_v_m_s, abs=2e-3)
        assert direct.lengths_s == pytest.approx(solution.lengths_s, abs=0.05)
        assert direct.arcs[0].direction == pytest.approx(solution.arcs[0].direction, abs=1e-3)

    @pytest.mark.parametrize("change", [OBLATE, TAIL], ids=["oblate", "tail-off"])
    def test_in_other_missions(self, edited, change):
        flight = edited(MIDDLE, change)
        solution = solve(flight, "indirect")
        assert solution.converged, solution.reason
        direct = solve(flight, "direct20")
        assert direct.converged, direct.reason
        assert direct.m_f_kg == pytest.approx(solution.m_f_kg, abs=5e-4)

    def test_a_shroud_dropped_within_the_burn(self, edited):
        flight = edited(MIDDLE, *SHROUD)
        solution = solve(flight, "indirect")
        assert solution.converged, solution.reason
        solid = flight.arc_names.index("solid")
        (burn,) = [arc for arc in solution.flown if arc.arc == solid]
        assert burn.start_s + 1.0 < solution.t_plf_s < burn.end_s - 1.0
        direct = solve(flight, "direct20")
        assert direct.converged, direct.reason
        assert direct.t_plf_s == pytest.approx(solution.t_plf_s, abs=0.1)
        assert direct.m_f_kg == pytest.approx(solution.m_f_kg, abs=2e-3)


class TestHeldProof:
    @pytest.mark.parametrize("name", [MIDDLE, KICK])
    def test_flown_again(self, solved, name):
        """Verify the target, one direction throughout the burn, and that it is optimal."""
        solution = solved[name]
        assert solution.verification.position_defect_m < 0.01
        assert solution.verification.velocity_defect_m_s < 1e-5
        assert all(check.satisfied for check in solution.constraints)
        (off,) = solution.costates.held_off_deg
        assert off < 1e-5
        assert max(solution.costates.hamiltonian_spread) < 1e-6
        assert solution.notes["pole_turn_spread_m_s"] < 1e-4
        arcs = mission(name).arrays().arcs
        (burn,) = [arc for arc in solution.flown if arcs["held"][arc.arc]]
        track = solution.trajectory
        within = (track.time_s >= burn.start_s) & (track.time_s <= burn.end_s) & (track.thrust > 0)
        begins = np.isclose(track.time_s, burn.start_s) | np.isclose(track.time_s, burn.end_s)
        directions = track.direction[within & ~begins]
        assert len(directions) > 30
        assert np.ptp(directions, axis=0).max() < 1e-12
        assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0, abs=1e-12)

    def test_the_solvers_own_samples_have_the_direction_too(self, solved):
        own = solve(mission(MIDDLE), "indirect", verify=False).trajectory
        flown = solved[MIDDLE].trajectory
        middle = 70.0 + 60.0 + 5.0 + 25.0
        ours, theirs = (t.direction[np.searchsorted(t.time_s, middle)] for t in (own, flown))
        assert ours == pytest.approx(theirs, abs=1e-9)

    def test_the_laws_of_a_solution(self, solved):
        """Return a constant direction without a primer rate to guidance."""
        laws = {arc.start_s: arc for arc in solved[MIDDLE].arcs}
        held = laws[135.0]
        assert held.direction_rate == (0.0, 0.0, 0.0)
        assert np.isnan(held.primer_rate).all()
        assert np.isfinite(laws[185.0].primer_rate).all()

    def test_another_direction_is_found_out(self, solved):
        solution = solved[MIDDLE]
        (check,) = [c for c in solution.constraints if c.key is Check.HELD_DIRECTION]
        assert check.satisfied
        arrays = mission(MIDDLE).arrays()
        start = mission(MIDDLE).start().navigation()[0]
        best = steering_of(solution.arcs)
        begins = [arc.start_s for arc in solution.arcs]
        flight = fly(arrays, start, best, (), solution.t_meco_s, begins)
        turned = math.radians(0.2)

        def off(begin, end):
            w = best(begin, end)(begin)
            aside = np.cross(w, [0.0, 0.0, 1.0])
            return lambda _: math.cos(turned) * w + math.sin(turned) * aside / math.hypot(*aside)

        # two events at once leave a piece of no length
        times = solution.costates.time_s
        at = float(next(t for t in times[1:] if flight.plan.arc_at(t - 0.01) == 2))
        vanished = flight.pieces[0]._replace(begin=at, end=at + 1e-9)
        flight = replace(flight, pieces=(vanished, *flight.pieces))
        offsets = held_offsets(arrays, flight, off, solution.costates)
        assert offsets == pytest.approx((0.2,), abs=1e-5)
        cause = held_obstacle(held_checks(arrays, flight, offsets))
        assert cause.status is Status.NOT_OPTIMAL
        assert "direction of held arc 2 is 0.2 deg off" in cause.reason

    @pytest.mark.parametrize("name", [MIDDLE, KICK])
    def test_throttled(self, edited, name):
        solution = solve(edited(name, THROTTLED), "indirect")
        assert solution.converged, solution.reason
        assert solution.verification.position_defect_m < 0.01
        assert solution.costates.held_off_deg[0] < 1e-5
        track = solution.trajectory
        acceleration = track.thrust / track.mass
        assert np.isclose(acceleration, 40.0, rtol=1e-9).sum() > 5


class TestLoss:
    @pytest.mark.parametrize("name", [MIDDLE, KICK])
    def test_is_small_and_no_gain(self, solved, unheld, name):
        loss = solved[name].delta_v_m_s - unheld[name].delta_v_m_s
        assert 0.0 < loss < 5.0

    def test_vanishes_with_the_length(self, edited, unheld):
        """Check that the cost is of third order in the length of the burn."""
        losses = []
        for length in (20.0, 10.0, 5.0):
            flight = edited(
                MIDDLE,
                (
                    "      - name: solid\n",
                    (
                        "      - name: begin\n        thrust_n: 102400.0\n        isp_s: 290.0\n"
                        f"        burn_time_s: {50.0 - length}\n      - name: solid\n"
                    ),
                ),
                ("burn_time_s: 50.0", f"burn_time_s: {length}"),
            )
            solution = solve(flight, "indirect")
            assert solution.converged, solution.reason
            losses.append(unheld[MIDDLE].m_f_kg - solution.m_f_kg)
        assert losses[-1] > 0.0
        assert losses[0] / losses[1] == pytest.approx(8.0, rel=0.15)
        assert losses[1] / losses[2] == pytest.approx(8.0, rel=0.15)


def test_what_a_second_of_coast_is_worth(solved):
    """Compare the Hamiltonian before a held burn with missions of other lengths."""
    flight = mission(KICK)
    start = flight.start().navigation()
    solver = TwoPointSolver(flight.arrays())
    root = solved[KICK].parameters

    def taken(coast):
        solver.hold(start, {1: coast})
        there = solver.solve(start, root, restart=False)
        assert there.converged
        return there.propellant_kg

    taken(240.0)
    worth = float(solver.work["switches"]["worth"][0, 1] / solver.work["price"][0])
    assert -worth == pytest.approx((taken(240.1) - taken(239.9)) / 0.2, rel=1e-4)


class TestRefusals:
    @pytest.mark.parametrize("method", [m for m in METHODS if m not in HELD_METHODS])
    def test_by_other_methods(self, method):
        with pytest.raises(
            UnfitMethod, match=r"expected auto or collocation or .*: arc 2 has attitude: held"
        ):
            solve(mission(MIDDLE), method)

    def test_within_the_burn(self):
        flight = mission(MIDDLE)
        start = flight.start().navigation()
        start["arc"] = 2
        start["arc_start_time"] = 135.0
        start["time"] = 140.0
        with pytest.raises(UnfitMethod, match="arc 2 has attitude: held and burns already"):
            solve(flight, "indirect", state=start)

    def test_within_its_tail(self, edited):
        flight = edited(MIDDLE, TAIL)
        start = flight.start().navigation()
        start["arc"] = 3
        start["arc_start_time"] = 185.0
        start["time"] = 188.0
        with pytest.raises(UnfitMethod, match="arc 2 has attitude: held and burns already"):
            solve(flight, "indirect", state=start)

    def test_nothing_guided_ahead(self):
        flight = mission(KICK)
        start = flight.start().navigation()
        start["arc"] = 3
        start["arc_start_time"] = start["time"]
        start["mass"] = 600.0
        with pytest.raises(UnfitMethod, match="expected a guided burn too"):
            solve(flight, "indirect", state=start)

    def test_more_than_there_is_room_for(self, edited):
        part = (
            "      - name: solid {}\n        thrust_n: 102400.0\n        isp_s: 290.0\n"
            "        burn_time_s: 10.0\n        attitude: held\n"
        )
        text = text_of(MIDDLE)
        begin = text.index("      - name: solid\n")
        end = text.index("  - name: stage 3")
        flight = edited(MIDDLE, (text[begin:end], "".join(part.format(k) for k in range(5))))
        with pytest.raises(UnfitMethod, match="5 burns have attitude: held; expected at most 4"):
            solve(flight, "indirect")
        assert math.isclose(flight.arrays().arcs["duration"][2], 10.0)


def test_several_held_burns(edited, solved):
    """Rank two directions: better than one, worse than a guided burn."""
    half = "        burn_time_s: 25.0\n        attitude: held\n"
    engine = "        thrust_n: 102400.0\n        isp_s: 290.0\n"
    flight = edited(
        MIDDLE,
        (
            "        burn_time_s: 50.0\n        attitude: held\n",
            f"{half}      - name: second half\n{engine}{half}",
        ),
    )
    solution = solve(flight, "indirect")
    assert solution.converged, solution.reason
    assert len(solution.costates.held_off_deg) == 2
    direct = solve(flight, "direct20")
    assert direct.m_f_kg == pytest.approx(solution.m_f_kg, abs=5e-4)
    assert solution.m_f_kg > solved[MIDDLE].m_f_kg + 0.1


def test_a_free_length_of_a_held_burn():
    """Check H with lambda_v . w = 0 at a free end, which no mission file has."""
    flight = mission("two_burn")
    start = flight.start().navigation()
    arrays = flight.arrays()
    arrays.arcs["held"][0] = 1
    solution = solve(arrays, "indirect", state=start)
    assert solution.converged, solution.reason
    solver = TwoPointSolver(arrays)

    def taken(change):
        solver.hold(start, {0: solution.lengths_s[0] + change})
        there = solver.solve(start, solution.parameters, restart=False)
        assert there.converged
        return there.propellant_kg

    least = taken(0.0)
    # 7.7 kg/s flow; a second off costs 1.5 kg
    assert abs(taken(0.1) - taken(-0.1)) / 0.2 < 1e-3
    assert taken(2.0) > least + 1.0
    assert taken(-2.0) > least + 1.0


class TestGuesses:
    def test_of_either_kind(self, solved):
        flight = mission(MIDDLE)
        start = flight.start().navigation()
        direct = solve(flight, "direct11")
        for guess in (solved[MIDDLE], solved[MIDDLE].parameters, direct):
            again = solve(flight, "indirect", state=start, guess=guess)
            assert again.converged, again.reason
            assert again.m_f_kg == pytest.approx(solved[MIDDLE].m_f_kg, abs=1e-6)
        again = solve(flight, "direct14", guess=solved[MIDDLE])
        assert again.m_f_kg == pytest.approx(solved[MIDDLE].m_f_kg, abs=5e-3)

    @pytest.mark.trial
    def test_without_a_direction_the_solver_aims(self, solved):
        """Treat zeros as unknown: a guided flight gives the first direction."""
        flight = mission(MIDDLE)
        start = flight.start().navigation()
        solver = TwoPointSolver(flight.arrays())
        guess = solved[MIDDLE].parameters.copy()
        guess[-3:] = 0.0
        root = solver.solve(start, guess, restart=False)
        assert root.converged
        assert root.unknowns == pytest.approx(solved[MIDDLE].parameters, rel=1e-6, abs=1e-9)

    @pytest.mark.parametrize("method", ["indirect", "direct20"])
    def test_from_a_state_before_the_burn(self, solved, method):
        track = solved[MIDDLE].trajectory
        k = int(np.searchsorted(track.time_s, 100.0))
        start = mission(MIDDLE).start().navigation()
        start["time"] = track.time_s[k]
        start["position"] = track.position[k]
        start["velocity"] = track.velocity[k]
        start["mass"] = track.mass[k]
        start["arc_start_time"] = 70.0
        rest = solve(mission(MIDDLE), method, state=start)
        assert rest.converged, rest.reason
        assert rest.m_f_kg == pytest.approx(solved[MIDDLE].m_f_kg, abs=1e-3)


@pytest.mark.trial
def test_drops_at_fixed_times_first_leave_the_other_unknowns(edited, solved):
    """Keep ends and directions as limits return to the unknowns."""
    flight = edited(KICK, SHROUD[0], (SHROUD[1][0], SHROUD[1][1].replace("100.0", "20.0")))
    start = flight.start().navigation()
    solver = TwoPointSolver(flight.arrays())
    burn, coast = solved[KICK].lengths_s
    solver.hold(start, {1: coast})
    unknowns = np.zeros(MAX_UNKNOWNS)
    unknowns[7:9] = np.cumsum((130.0 + burn, coast))
    own = OwnStart(6, 30.0, 1.0)
    _, _, status = _solve_timed_first(
        start[0], flight.arrays().records(), solver.options[0], own, unknowns, solver.work[0]
    )
    assert status == CONVERGED
    root = unknowns[: solver.size(start)]
    assert root[7] > 130.0
    assert root[8] < 0.0
    assert np.diff(root[solver.ends(start)]) == pytest.approx(coast, abs=1e-6)
    assert np.linalg.norm(root[-3:]) == pytest.approx(1.0, abs=1e-9)


def test_collocation_saves_what_the_last_stage_with_a_free_burn_takes(solved):
    found = solve(mission(KICK), "collocation")
    assert found.converged, found.reason
    assert found.lengths_s == pytest.approx(solved[KICK].lengths_s, abs=0.05)
    saved = next(c for c in found.constraints if c.key is Check.SAVED_PROPELLANT)
    stages = mission(KICK).arrays().arcs["stage"]
    times = [(f.start_s, f.end_s) for f in found.flown if stages[f.arc] == stages[-1] - 1]
    begin, end = times[0][0], times[-1][1]
    own = [arc for arc in found.arcs if begin <= 0.5 * (arc.start_s + arc.end_s) <= end]
    burnt = sum(arc.start_mass_kg - arc.end_mass_kg for arc in own)
    assert saved.value == pytest.approx(burnt, abs=0.1)
    assert not saved.active


@pytest.mark.trial
def test_a_flight_in_which_no_burn_is_free_is_no_optimum():
    arrays = mission(KICK).arrays()
    # longer than the shortest, to have excess energy
    arrays.arcs["duration"][1] = 139.0
    start = mission(KICK).start().navigation()
    found = solve(arrays, "auto", state=start)
    assert found.status is Status.FEASIBLE, found.reason
    assert found.reason == NOTHING_SAVED
    assert found.verification.end is End.TARGET
    with pytest.raises(UnfitMethod, match="no burn is free"):
        solve(arrays, "indirect", state=start)
