# SPDX-License-Identifier: Apache-2.0
"""Measure the errors of linear gravity: the closed form against the exact flight.

Table 3.1 of the thesis compares the two gravities, but its linear column is not omega0^2 r;
:func:`gravity_table` corrects it. :func:`error_table` has the errors on a burn for several arc
lengths.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.kernels.environment import log_heating_gradient
from ares_optimizer.indirect.kernels.beside import exact_beside
from ares_optimizer.indirect.solver import Rule, TwoPointOptions
from ares_optimizer.kernels.timetable import MAX_UNKNOWNS, SEGMENT
from ares_optimizer.request import Heating
from ares_optimizer.solution import OptimizerError
from ares_optimizer.two_point.arrays import LINEAR, PIS, WORK, Gravity
from ares_optimizer.two_point.kernels.closed_form import closed_form_segment
from ares_optimizer.two_point.kernels.shooting import begin_flight, fly_segment

Array = NDArray[np.float64]

ARC_LENGTHS_S = (430.0, 100.0, 50.0, 20.0, 10.0, 5.0)
_SUBSTEP_S = 1.0


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


@dataclass(frozen=True)
class ArcError:
    """Hold the end of a flight in closed form minus that of the exact flight.

    Attributes:
        arc_length_s: longest arc.
        rule: quadrature of the thrust integrals.
        correction: true if the nonlinear part of gravity is applied as impulses.
        position_m: distance of the end points.
        velocity_m_s: size of the difference of the velocities.
    """

    arc_length_s: float
    rule: str
    correction: bool
    position_m: float
    velocity_m_s: float


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


def flight_errors(
    arrays: MissionArrays,
    start: NDArray[np.void],
    unknowns: Array,
    options: TwoPointOptions,
    burn: int | None = None,
) -> ArcError:
    """Fly unknowns in closed form, and the same steering in the exact field.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        unknowns: shape (7 + 2 drops,), see ``solver.Root``.
        options: arcs and rule of the closed form; ``heating``.
        burn: arc of the mission on which the flights are compared, from one state at its start;
            None: the whole flight.

    Raises:
        OptimizerError: the times are not possible.
    """
    closed = replace(options, propagator="closed_form").record()
    closed["step"] = _SUBSTEP_S
    exactly = replace(options, propagator="runge_kutta", step_s=_SUBSTEP_S).record()
    work = np.zeros(1, WORK)
    padded = np.zeros(MAX_UNKNOWNS)
    padded[: unknowns.size] = unknowns
    field = begin_flight(start[0], arrays.records(), exactly[0], padded, work[0])
    state = work["state"][0]
    exact = state[:6].copy()
    count = int(work["segment_count"][0])
    if count == 0:
        raise OptimizerError("no flight is possible with these times")
    for segment in work["segments"][0, :count]:
        length = float(segment["end"] - segment["start"])
        if burn is None or segment["arc"] == burn:
            parts = max(1, math.ceil(length / options.arc_length_s - 1e-9))
            exact_beside(segment, parts, field, closed[0], exact, work[0])
        elif segment["arc"] < burn:
            # before that arc, the exact flight of the two-point problem
            fly_segment(segment, max(1, math.ceil(length)), field, exactly[0], work[0])
            exact[:] = state[:6]
        if segment["end_heating"] >= 0 and options.heating is Heating.AT_JETTISON:
            pi = unknowns[PIS][segment["end_heating"]]
            _, by_r, by_v = log_heating_gradient(
                tuple(state[:3]), tuple(state[3:6]), arrays.environment[0], arrays.atmosphere
            )
            state[6:9] -= pi * np.array(by_v)
            state[9:] += pi * np.array(by_r)
    return ArcError(
        options.arc_length_s,
        options.rule,
        options.correction,
        float(np.linalg.norm(state[:3] - exact[:3])),
        float(np.linalg.norm(state[3:6] - exact[3:])),
    )


def error_table(
    arrays: MissionArrays,
    start: NDArray[np.void],
    unknowns: Array,
    *,
    arc_lengths_s: Sequence[float] = ARC_LENGTHS_S,
    heating: Heating = Heating.AT_JETTISON,
    burn: int | None = None,
) -> tuple[ArcError, ...]:
    """Tabulate errors of the closed form by arc length, rule and correction.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        unknowns: shape (7 + 2 drops,).
        arc_lengths_s: s.
        heating: where the limit holds.
        burn: see :func:`flight_errors`.
    """
    rules: tuple[Rule, ...] = ("simpson", "milne")
    choices = [
        TwoPointOptions(heating=heating, arc_length_s=length, rule=rule, correction=correction)
        for correction in (False, True)
        for rule in rules
        for length in arc_lengths_s
    ]
    return tuple(flight_errors(arrays, start, unknowns, chosen, burn) for chosen in choices)
