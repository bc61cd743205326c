# SPDX-License-Identifier: Apache-2.0
"""Test the closed form: exact in linear gravity, with measured errors otherwise."""

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.indirect.closed_form import flight_errors
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.indirect.solver import TwoPointOptions, TwoPointSolver, navigation
from ares_optimizer.request import Heating
from ares_optimizer.solution import OptimizerError

EIGHTH_ORDER = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


@pytest.fixture(scope="module")
def ares():
    mission = load_mission("ares_v")
    start = mission.start()
    return mission.arrays(), navigation(start.time_s, start.position, start.velocity)


@pytest.fixture(scope="module")
def free_root(ares):
    """Return the root with the fairing dropped at ignition: both burns in one piece."""
    arrays, start = ares
    return TwoPointSolver(arrays, TwoPointOptions(heating=Heating.IGNORED)).solve(start)


@pytest.mark.parametrize("rule", ["simpson", "milne"])
def test_linear_gravity_is_met_exactly(ares, rule):
    """Solve the same linear problem by Eqs. 3.20-3.29 and by Runge-Kutta."""
    arrays, start = ares
    numeric = TwoPointSolver(arrays, TwoPointOptions(gravity="linear")).solve(start)
    closed = TwoPointSolver(
        arrays,
        TwoPointOptions(gravity="linear", propagator="closed_form", rule=rule, arc_length_s=2.0),
    ).solve(start)
    assert numeric.converged and closed.converged
    np.testing.assert_allclose(closed.unknowns, numeric.unknowns, rtol=2e-7)


class TestErrors:
    """Check the order of the error in the arc length: first without correction, second with it."""

    def rows(self, ares, root, burn=None):
        arrays, start = ares
        choices = [
            TwoPointOptions(
                heating=Heating.IGNORED, arc_length_s=length, rule=rule, correction=correction
            )
            for correction in (False, True)
            for rule in ("simpson", "milne")
            for length in (430.0, 20.0, 10.0, 5.0)
        ]
        table = [flight_errors(arrays, start, root.unknowns, chosen, burn) for chosen in choices]
        return {(row.correction, row.rule, row.arc_length_s): row for row in table}

    def test_burns_in_one_piece(self, ares, free_root):
        first = self.rows(ares, free_root, burn=0)[False, "milne", 430.0]
        assert first.position_m == pytest.approx(1171.0, abs=5.0)
        assert first.velocity_m_s == pytest.approx(18.1, abs=0.2)
        second = self.rows(ares, free_root, burn=1)[False, "milne", 430.0]
        assert second.position_m == pytest.approx(13.7e3, abs=0.2e3)
        assert second.velocity_m_s == pytest.approx(72.0, abs=1.0)

    def test_short_arcs(self, ares, free_root):
        rows = self.rows(ares, free_root)
        plain = [rows[False, "milne", length].position_m for length in (20.0, 10.0, 5.0)]
        assert plain[0] / plain[1] == pytest.approx(2.0, abs=0.25)
        assert plain[1] / plain[2] == pytest.approx(2.0, abs=0.25)
        corrected = [rows[True, "milne", length].position_m for length in (20.0, 10.0, 5.0)]
        assert corrected[0] / corrected[1] == pytest.approx(4.0, abs=0.5)
        assert corrected[1] / corrected[2] == pytest.approx(4.0, abs=0.5)
        assert corrected[2] < 0.02 * plain[2]

    def test_milne_is_the_better_rule(self, ares, free_root):
        rows = self.rows(ares, free_root, burn=0)
        far = rows[True, "simpson", 430.0].velocity_m_s
        assert rows[True, "milne", 430.0].velocity_m_s < far

    def test_jump_on_the_way(self, ares):
        arrays, start = ares
        root = TwoPointSolver(arrays).solve(start)
        error = flight_errors(
            arrays, start, root.unknowns, TwoPointOptions(arc_length_s=5.0, correction=True)
        )
        assert error.position_m < 5.0

    def test_bad_requests(self, ares, free_root):
        arrays, start = ares
        with pytest.raises(OptimizerError, match="rule is 'gauss'; expected simpson or milne"):
            flight_errors(
                arrays, start, free_root.unknowns, TwoPointOptions(arc_length_s=5.0, rule="gauss")
            )
        with pytest.raises(OptimizerError, match="arc_length_s is 0"):
            flight_errors(arrays, start, free_root.unknowns, TwoPointOptions(arc_length_s=0.0))
        early = free_root.unknowns.copy()
        early[6] = 300.0
        with pytest.raises(OptimizerError, match="no flight is possible"):
            flight_errors(
                arrays, start, early, TwoPointOptions(arc_length_s=5.0, heating=Heating.IGNORED)
            )


class TestAsPropagator:
    def test_corrected_arcs_lead_to_the_optimum(self, ares):
        exact = solve_indirect(*ares)
        cutoffs = []
        for length in (10.0, 5.0):
            solution = solve_indirect(
                *ares, TwoPointOptions(propagator="closed_form", arc_length_s=length), finish=False
            )
            cutoffs.append(solution.t_meco_s - exact.t_meco_s)
            assert solution.method == "closed_form"
        assert cutoffs[0] / cutoffs[1] == pytest.approx(4.0, abs=0.6)
        assert abs(cutoffs[1]) < 1e-3

    def test_finished_numerically(self, ares):
        exact = solve_indirect(*ares)
        solution = solve_indirect(*ares, TwoPointOptions(propagator="closed_form"))
        assert solution.converged, solution.reason
        assert solution.m_f_kg == pytest.approx(exact.m_f_kg, abs=1e-5)
        assert solution.notes["closed_form_m_f_kg"] == pytest.approx(exact.m_f_kg, abs=0.2)
        assert solution.notes["closed_form_position_error_m"] < 10.0

    def test_unfinished_is_not_called_verified(self, ares):
        # arcs so long that the error at the end exceeds the tolerance
        options = TwoPointOptions(propagator="closed_form", arc_length_s=40.0)
        solution = solve_indirect(*ares, options, finish=False)
        assert not solution.converged
        assert solution.reason.startswith("optimal in closed form, but flown exactly")

    def test_costates_of_the_thesis_are_not_those_of_the_true_field(self, ares):
        """Use Eqs. 3.20, 3.21 on short arcs: the gradient keeps only its isotropic part.

        omega of the arcs follows the radius, but the costates ignore that: their flight is worse
        than the optimum at any arc length.
        """
        exact = solve_indirect(*ares)
        late = []
        for length in (10.0, 5.0, 2.5):
            solution = solve_indirect(
                *ares,
                TwoPointOptions(propagator="closed_form", correction=False, arc_length_s=length),
                finish=False,
            )
            late.append(solution.t_meco_s - exact.t_meco_s)
        limit = 2.0 * late[2] - late[1]
        assert late[0] > late[1] > late[2] > 0.0
        assert limit == pytest.approx(0.14, abs=0.02)
        finished = solve_indirect(
            *ares, TwoPointOptions(propagator="closed_form", correction=False)
        )
        assert finished.converged
        assert finished.t_meco_s == pytest.approx(exact.t_meco_s, abs=1e-7)


@pytest.mark.trial
@pytest.mark.parametrize("gravity", ["inverse_square", "linear"])
@pytest.mark.parametrize("rule", ["simpson", "milne"])
@pytest.mark.parametrize("correction", [False, True])
def test_jacobian(gravity, rule, correction):
    """Check the exact derivative of the discrete map, the linearisation of each arc included."""
    mission = load_mission("delta_iii")
    first = mission.start()
    start = navigation(first.time_s, first.position, first.velocity)
    solver = TwoPointSolver(
        mission.arrays(),
        TwoPointOptions(
            gravity=gravity,
            propagator="closed_form",
            rule=rule,
            correction=correction,
            arc_length_s=21.0,
        ),
    )
    unknowns = solver.solve(start).unknowns * (1.0 + 1e-3 * np.sin(np.arange(7)))
    _, jacobian, _ = solver.shoot(start, unknowns)
    unit = np.array([1.0] * 3 + [1e-3] * 3 + [100.0])
    for c in range(7):
        h = 2e-3 * unit[c]
        column = np.zeros(7)
        for k, weight in EIGHTH_ORDER:
            for sign in (1.0, -1.0):
                moved = unknowns.copy()
                moved[c] += sign * k * h
                column += sign * weight / h * solver.shoot(start, moved)[0]
        scale = np.abs(jacobian * unit).max(axis=1)
        np.testing.assert_array_less(
            np.abs(column - jacobian[:, c]) * unit[c], 1e-8 * scale + 1e-30
        )
