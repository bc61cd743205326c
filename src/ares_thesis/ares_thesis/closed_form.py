# SPDX-License-Identifier: Apache-2.0
"""Measure linear gravity, chapter 3 of the thesis: its table and its thrust integrals.

Table 3.1 of the thesis compares the two gravities, but its linear column is not omega0^2 r;
:func:`gravity_table` corrects it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_optimizer.indirect.solver import Rule, TwoPointOptions
from ares_optimizer.kernels.timetable import SEGMENT
from ares_optimizer.two_point.arrays import LINEAR, WORK, Gravity
from ares_optimizer.two_point.kernels.closed_form import closed_form_segment

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GravityRow:
    """Hold gravity at one radius.

    Attributes:
        radius_m: the radius.
        inverse_square_m_s2: mu/r^2.
        linear_m_s2: omega0^2 r with omega0 = sqrt(mu/r0^3) of the first row.
    """

    radius_m: float
    inverse_square_m_s2: float
    linear_m_s2: float


def gravity_table(mu: float, radii: Sequence[float]) -> tuple[GravityRow, ...]:
    """Tabulate both gravities along a flight: Table 3.1, corrected.

    Printed: a linear column of 1e-8 m/s2. Both agree at the first radius; beyond it the linear
    field grows with r while inverse-square gravity falls.

    Args:
        mu: m3/s2.
        radii: m, the first one is r0.
    """
    omega_square = mu / radii[0] ** 3
    return tuple(GravityRow(r, mu / r**2, omega_square * r) for r in radii)


def thrust_integrals(
    lambda_v: Sequence[float],
    lambda_r: Sequence[float],
    omega: float,
    engine: tuple[float, float, float],
    duration: float,
    rule: Rule = "milne",
) -> tuple[Array, Array]:
    """Compute Ic and Is of Eqs. 3.22, 3.23 over one arc, the primer by Eq. 3.21.

    Args:
        lambda_v: at the start of the arc, shape (3,).
        lambda_r: at the start of the arc, shape (3,), 1/s.
        omega: 1/s.
        engine: constant thrust, N, and mass flow, kg/s; mass at the start, kg.
        duration: s.
        rule: ``simpson`` or ``milne``.

    Returns:
        Ic, Is, m/s, shape (3,) each.
    """
    segment = np.zeros(1, SEGMENT)
    segment["end"] = duration
    segment["thrust"], segment["flow"], segment["mass"] = engine
    options = TwoPointOptions(propagator="closed_form", rule=rule, correction=False)
    work = np.zeros(1, WORK)
    state = work["state"][0]
    state[0] = 1.0
    state[6:9] = lambda_v
    state[9:] = -np.asarray(lambda_r)
    field = Gravity(1.0, omega**2, LINEAR, 0.0)
    closed_form_segment(segment[0], 1, field, options.record()[0], work[0])
    integrals = work["stage"][0, 0]
    return integrals[:3].copy(), integrals[3:].copy()
