# SPDX-License-Identifier: Apache-2.0
"""Linear gravity: its table, its thrust integrals, and how far from the truth its arcs are."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from ares_models.mission import load_mission
from ares_optimizer.indirect.solver import TwoPointOptions, TwoPointSolver, navigation
from ares_optimizer.request import Heating
from ares_thesis.closed_form import ARC_LENGTHS_S, error_table, gravity_table, thrust_integrals


@pytest.fixture(scope="module")
def ares():
    mission = load_mission("ares_v")
    start = mission.start()
    return mission.arrays(), navigation(start.time_s, start.position, start.velocity)


@pytest.fixture(scope="module")
def free_root(ares):
    """The flight with the fairing gone at ignition: both burns in one piece."""
    arrays, start = ares
    return TwoPointSolver(arrays, TwoPointOptions(heating=Heating.IGNORED)).solve(start)


def test_gravity_table():
    """Reproduce Table 3.1: the inverse-square column as printed, the linear one corrected."""
    rows = gravity_table(3.986e14, (6415383.7, 6505700.0, 6518889.0))
    assert [round(row.inverse_square_m_s2, 3) for row in rows] == [9.685, 9.418, 9.380]
    assert [round(row.linear_m_s2, 3) for row in rows] == [9.685, 9.821, 9.841]


@pytest.mark.parametrize(("rule", "order"), [("simpson", 5), ("milne", 7)])
def test_thrust_integrals(rule, order):
    """Compare with adaptive quadrature; the error of an arc is of order degree + 2."""
    lambda_v, lambda_r = np.array([0.3, 0.9, -0.2]), np.array([-1e-3, 5e-4, 7e-4])
    omega, thrust, mass, flow = 1.2e-3, 1.3e6, 3.0e5, 297.0

    def integrand(t, axis, wave):
        p = lambda_v * math.cos(omega * t) - lambda_r / omega * math.sin(omega * t)
        return p[axis] / np.linalg.norm(p) * thrust / (mass - flow * t) * wave(omega * t)

    def error(duration):
        got = thrust_integrals(lambda_v, lambda_r, omega, (thrust, flow, mass), duration, rule)
        exact = [
            [quad(integrand, 0, duration, (axis, wave), epsabs=1e-13)[0] for axis in range(3)]
            for wave in (math.cos, math.sin)
        ]
        return np.abs(np.array(got) - exact).max()

    assert error(100.0) < {"simpson": 0.1, "milne": 2e-4}[rule]
    assert order - 0.7 < math.log2(error(200.0) / error(100.0)) < order + 1.2


class TestErrorOrder:
    """Check the order of the error in the arc length: first without correction, second with it."""

    def rows(self, ares, root, **choice):
        arrays, start = ares
        table = error_table(arrays, start, root.unknowns, heating=Heating.IGNORED, **choice)
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
        assert len(rows) == 4 * len(ARC_LENGTHS_S)
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
