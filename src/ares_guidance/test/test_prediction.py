# SPDX-License-Identifier: Apache-2.0
"""Predicted effect of thrust, and primer, against integration."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ares_guidance.arrays import SOLUTION
from ares_guidance.kernels.prediction.burn import LinearTangent, primer

GRADIENT = 1.1e-3
REFERENCE = 700.0


def solution(turning):
    record = np.zeros(1, SOLUTION)[0]
    axes, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    field = record["primer"]
    field["gradient"] = GRADIENT
    field["turning"] = turning
    field["axis"], field["normal"] = axes[0], np.cross(axes[0], axes[1])
    return record


def integrated(field, direction, rate, t):
    side = np.cross(field["normal"], field["axis"])

    def slope(time, y):
        angle = field["turning"] * time
        up = math.cos(angle) * field["axis"] + math.sin(angle) * side
        return np.concatenate([y[3:], GRADIENT**2 * (3.0 * (y[:3] @ up) * up - y[:3])])

    start = np.concatenate([direction, rate])
    return solve_ivp(slope, (REFERENCE, t), start, rtol=1e-12, atol=1e-14).y[:, -1]


# at the last but one both modes are one
@pytest.mark.parametrize("ratio", [0.0, 0.3, 1.0, math.sqrt(9.0 / 8.0), 1.2])
@pytest.mark.parametrize("t", [0.0, 1900.0, -500.0])
def test_the_primer_follows_the_gradient_that_turns(ratio, t):
    record = solution(ratio * GRADIENT)
    direction, rate = np.array([0.3, -0.8, 0.5]), np.array([1e-3, 4e-4, -7e-4])
    expected = integrated(record["primer"], direction, rate, t)
    p, q = primer(record, LinearTangent(tuple(direction), tuple(rate), REFERENCE), t)
    assert np.array(p) == pytest.approx(expected[:3], abs=3e-9)
    assert np.array(q) == pytest.approx(expected[3:], abs=3e-12)


def test_a_small_turn_is_a_line():
    record = solution(0.0)
    record["primer"]["gradient"] = 0.0
    p, q = primer(record, LinearTangent((1.0, 0.0, 0.0), (0.0, 1e-3, 0.0), 10.0), 30.0)
    assert p == pytest.approx((1.0, 0.02, 0.0))
    assert q == (0.0, 1e-3, 0.0)
