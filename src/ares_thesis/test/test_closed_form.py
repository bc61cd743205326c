# SPDX-License-Identifier: Apache-2.0
"""Linear gravity: its table and its thrust integrals."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from ares_thesis.closed_form import gravity_table, thrust_integrals


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
