# SPDX-License-Identifier: Apache-2.0
"""Measure the errors of linear gravity: the closed form against the exact flight."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.kernels.environment import log_heating_gradient
from ares_optimizer.indirect.kernels.beside import exact_beside
from ares_optimizer.indirect.solver import TwoPointOptions
from ares_optimizer.kernels.timetable import MAX_UNKNOWNS
from ares_optimizer.request import Heating
from ares_optimizer.solution import OptimizerError
from ares_optimizer.two_point.arrays import PIS, WORK
from ares_optimizer.two_point.kernels.shooting import begin_flight, fly_segment

Array = NDArray[np.float64]

_SUBSTEP_S = 1.0


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
