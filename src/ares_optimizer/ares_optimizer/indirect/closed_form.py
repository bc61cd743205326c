"""The closed form beside the exact flight: errors of linear gravity, measured.

Table 3.1 of the thesis compares the two gravities (its linear column is not
omega0^2 r); :func:`gravity_table` does it right. What the linear field costs on a burn,
and what shorter arcs buy, is in :func:`error_table`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.kernels.environment import log_heating_gradient
from ares_optimizer.kernels.timetable import (
    HEATING_OPTIMAL,
    MAX_SEGMENTS,
    SEGMENT,
    build_timetable,
    heating_count,
)
from ares_optimizer.solution import OptimizerError
from ares_optimizer.two_point.arrays import MAX_COLUMNS, OPTIONS, WORK
from ares_optimizer.two_point.kernels import closed_form as kernels
from ares_optimizer.two_point.kernels.shooting import fly_segment

Array = NDArray[np.float64]

RULES = {"simpson": kernels.SIMPSON, "milne": kernels.MILNE}
ARC_LENGTHS_S = (430.0, 100.0, 50.0, 20.0, 10.0, 5.0)
_SUBSTEP_S = 1.0


@dataclass(frozen=True)
class GravityRow:
    """Gravity at one radius.

    Attributes:
        radius_m: the radius.
        inverse_square_m_s2: mu/r^2.
        linear_m_s2: omega0^2 r with omega0 = sqrt(mu/r0^3) of the first row.
    """

    radius_m: float
    inverse_square_m_s2: float
    linear_m_s2: float


def gravity_table(mu: float, radii: Sequence[float]) -> tuple[GravityRow, ...]:
    """Table 3.1 done right: both gravities along a flight.

    Printed: a linear column of 1e-8 m/s2. Both agree at the first radius; beyond it the
    linear field grows with r where the true one falls.

    Args:
        mu: m3/s2.
        radii: m, the first one is r0.
    """
    omega_square = mu / radii[0] ** 3
    return tuple(GravityRow(r, mu / r**2, omega_square * r) for r in radii)


@dataclass(frozen=True)
class ArcError:
    """End of a flight in closed form against the exact flight of the same steering.

    Attributes:
        arc_length_s: longest arc.
        rule: of the thrust integrals.
        correction: rest of gravity given as impulses.
        position_m: distance of the ends.
        velocity_m_s: difference of the velocities there.
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
    thrust: float,
    mass: float,
    flow: float,
    duration: float,
    rule: Literal["simpson", "milne"] = "milne",
) -> tuple[Array, Array]:
    """Ic and Is of Eqs. 3.22, 3.23 over one arc, the primer by Eq. 3.21.

    Args:
        lambda_v: at the arc's start, shape (3,).
        lambda_r: at the arc's start, shape (3,), 1/s.
        omega: 1/s.
        thrust: N, constant.
        mass: kg at the start.
        flow: kg/s, constant.
        duration: s.
        rule: ``simpson`` or ``milne``.

    Returns:
        Ic, Is, m/s, shape (3,) each.
    """
    segment = np.zeros(1, SEGMENT)
    segment["end"] = duration
    segment["thrust"] = thrust
    segment["mass"] = mass
    segment["flow"] = flow
    segment["start_column"] = -1
    segment["end_column"] = -1
    state = np.zeros(12)
    state[0] = 1.0
    state[6:9] = lambda_v
    state[9:] = -np.asarray(lambda_r)
    integrals = np.zeros(6)
    kernels.closed_form_segment(
        segment[0],
        1,
        1.0,
        omega**2,
        _rule(rule),
        False,
        0,
        state,
        np.zeros((MAX_COLUMNS, 12)),
        integrals,
        np.zeros((MAX_COLUMNS, 6)),
        np.zeros((4, MAX_COLUMNS)),
    )
    return integrals[:3].copy(), integrals[3:].copy()


def flight_errors(
    arrays: MissionArrays,
    start: NDArray[np.void],
    unknowns: Array,
    *,
    arc_length_s: float,
    rule: str = "milne",
    correction: bool = False,
    heating: int = HEATING_OPTIMAL,
    burn: int | None = None,
) -> ArcError:
    """Fly a two-point problem's unknowns in closed form, and its steering exactly beside it.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        unknowns: shape (7 + 2 drops,), see ``indirect.Root``.
        arc_length_s: longest arc.
        rule: ``simpson`` or ``milne``.
        correction: see ``indirect.TwoPointSolver``.
        heating: ``kernels.timetable.HEATING_*`` of the unknowns.
        burn: arc of the mission to compare on, both flights from the same state at its start;
            None: the whole flight.

    Raises:
        OptimizerError: the times make no flight, or the rule is not there.
    """
    code = _rule(rule)
    if not arc_length_s > 0.0:
        raise OptimizerError(f"arc_length_s is {arc_length_s:g}; expected more than 0")
    segments = np.zeros(MAX_SEGMENTS + 1, SEGMENT)
    drops = heating_count(start[0], arrays.jettisons, heating)
    times = np.zeros(8)
    times[:drops] = unknowns[7::2]
    count = build_timetable(
        start[0], arrays.arcs, arrays.jettisons, heating, times, unknowns[6], segments[:-1]
    )
    if count == 0:
        raise OptimizerError("the times make no flight")
    environment = arrays.environment[0]
    mu = float(environment["mu"])
    state = np.concatenate((start["position"][0], start["velocity"][0], unknowns[:6]))
    state[9:] *= -1.0
    exact = state[:6].copy()
    options = np.zeros(1, OPTIONS)
    options["step"] = _SUBSTEP_S
    work = np.zeros(1, WORK)
    scratch = (
        np.zeros((MAX_COLUMNS, 12)),
        np.zeros(6),
        np.zeros((MAX_COLUMNS, 6)),
        np.zeros((4, MAX_COLUMNS)),
    )
    for segment in segments[:count]:
        length = float(segment["end"] - segment["start"])
        if burn is None or segment["arc"] == burn:
            pieces = max(1, math.ceil(length / arc_length_s - 1e-9))
            kernels.exact_beside(
                segment,
                pieces,
                mu,
                code,
                correction,
                _SUBSTEP_S,
                segments[-1],
                state,
                exact,
                *scratch,
            )
        elif segment["arc"] < burn:
            # on the way there, the two-point problem's own flight
            work[0]["state"][:] = state
            fly_segment(segment, max(1, math.ceil(length)), mu, 0.0, options[0], 0, work[0])
            state[:] = work[0]["state"]
            exact[:] = state[:6]
        if segment["end_heating"] >= 0 and heating == HEATING_OPTIMAL:
            pi = unknowns[8 + 2 * segment["end_heating"]]
            _, by_r, by_v = log_heating_gradient(
                tuple(state[:3]), tuple(state[3:6]), environment, arrays.atmosphere
            )
            state[6:9] -= pi * np.array(by_v)
            state[9:] += pi * np.array(by_r)
    return ArcError(
        arc_length_s,
        rule,
        correction,
        float(np.linalg.norm(state[:3] - exact[:3])),
        float(np.linalg.norm(state[3:6] - exact[3:])),
    )


def error_table(
    arrays: MissionArrays,
    start: NDArray[np.void],
    unknowns: Array,
    *,
    arc_lengths_s: Sequence[float] = ARC_LENGTHS_S,
    heating: int = HEATING_OPTIMAL,
    burn: int | None = None,
) -> tuple[ArcError, ...]:
    """Errors of the closed form for every arc length, by both rules, with correction and without.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        unknowns: shape (7 + 2 drops,).
        arc_lengths_s: s.
        heating: see :func:`flight_errors`.
        burn: see :func:`flight_errors`.
    """
    return tuple(
        flight_errors(
            arrays,
            start,
            unknowns,
            arc_length_s=length,
            rule=rule,
            correction=correction,
            heating=heating,
            burn=burn,
        )
        for correction in (False, True)
        for rule in RULES
        for length in arc_lengths_s
    )


def _rule(rule: str) -> int:
    if rule not in RULES:
        raise OptimizerError(f"rule is {rule!r}; expected " + " or ".join(RULES))
    return RULES[rule]
