# SPDX-License-Identifier: Apache-2.0
"""Test thrust and mass of a phase of collocation that is known from its begin or from its end."""

import numpy as np
import pytest

from ares_optimizer.collocation.air import net_thrust
from ares_optimizer.collocation.arrays import PHASE
from ares_optimizer.collocation.thrust import acceleration_terms, mass_after

LENGTH, MASS, STEP = 3.0, 100.0, 1e-5
FRACTIONS = (0.0, 0.3, 1.0)


def phase(from_end):
    """Return a phase of 3 s in which thrust falls from 16 to 10, and flow from 1.6 to 1."""
    record = np.zeros(1, PHASE).view(np.recarray)[0]
    record.from_end = from_end
    record.thrust, record.thrust_slope = (10.0 if from_end else 16.0), -2.0
    record.flow, record.flow_slope = (1.0 if from_end else 1.6), -0.2
    return record


@pytest.mark.parametrize("fraction", FRACTIONS)
def test_both_ends_describe_the_same_phase(fraction):
    s = fraction * LENGTH
    left = MASS - 1.6 * s + 0.1 * s * s
    for from_end in (0, 1):
        known = phase(from_end)
        assert mass_after(known, fraction, LENGTH, MASS)[0] == pytest.approx(left, rel=1e-14)
        a = acceleration_terms(known, fraction, LENGTH, MASS)[0]
        assert a == pytest.approx((16.0 - 2.0 * s) / left, rel=1e-14)


@pytest.mark.parametrize("fraction", FRACTIONS)
@pytest.mark.parametrize("from_end", [0, 1])
def test_derivatives_are_those_of_differences(fraction, from_end):
    known = phase(from_end)

    def terms(length, mass):
        return np.array(acceleration_terms(known, fraction, length, mass)[:3])

    by_length = (terms(LENGTH + STEP, MASS) - terms(LENGTH - STEP, MASS)) / (2.0 * STEP)
    by_mass = (terms(LENGTH, MASS + STEP) - terms(LENGTH, MASS - STEP)) / (2.0 * STEP)
    _, a_l, a_m, a_ll, a_lm, a_mm = acceleration_terms(known, fraction, LENGTH, MASS)
    assert by_length == pytest.approx([a_l, a_ll, a_lm], rel=1e-6, abs=1e-9)
    assert by_mass == pytest.approx([a_m, a_lm, a_mm], rel=1e-6, abs=1e-9)
    masses = [mass_after(known, fraction, LENGTH + h, MASS)[0] for h in (STEP, -STEP)]
    change = (masses[0] - masses[1]) / (2.0 * STEP)
    assert mass_after(known, fraction, LENGTH, MASS)[1] == pytest.approx(change, abs=1e-8)


def test_thrust_less_pressure_fades_and_never_points_backwards():
    full, lost = 1000.0, 20.0
    assert net_thrust(500.0, lost, full) == (480.0, 1.0)
    assert net_thrust(0.0, 0.0, full) == (0.0, 1.0)
    for thrust in (21.5, 21.0, 20.0, 10.0, 0.0):
        net, slope = net_thrust(thrust, lost, full)
        ends = [net_thrust(thrust + h, lost, full)[0] for h in (STEP, -STEP)]
        assert 0.0 < net <= max(1.0, thrust - lost)
        assert slope == pytest.approx((ends[0] - ends[1]) / (2.0 * STEP), rel=1e-4)
