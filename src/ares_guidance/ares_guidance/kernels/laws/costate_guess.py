# SPDX-License-Identifier: Apache-2.0
"""First guesses of law `optimal`: by the plan, the last solution, or the steering in force."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import Onboard
from ares_guidance.kernels.laws.onboard_problem import REFRESH, drop_past_ends, plans_whole
from ares_models.arrays import BURN, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.sequence import aboard, awaits_heating
from ares_models.kernels.vectors import Vector, axpy, load, norm
from ares_optimizer.two_point.contract import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    MAX_UNKNOWNS,
    field_of,
    free_column,
    gravity_terms,
    next_ignition,
    propagated_back,
    tangential_primer,
)

#: Initial guess of a search.
BY_NOTHING = 0
BY_STEERING = 1
BY_PLAN = 2


@kernel
def begins_by_plan(arcs: NDArray[Any], onboard: Onboard) -> bool:
    """Return whether the search starts from the plan's costates.

    Without free arcs before the last only the first cycle does.
    """
    nav = onboard.navigation
    state = onboard.state
    if plans_whole(state):
        return True
    if state.plan.made == 1 or state.plan.aims == 0 or state.cycle != 1:
        return False
    k = nav.arc
    while arcs[k].kind != BURN:
        k += 1
    primer = state.plan.primer[k]
    return math.isfinite(norm(load(primer[0])) + norm(load(primer[1])))


@kernel
def primer_later(
    environment: Record, r: Vector, costates: tuple[Vector, Vector], dt: float
) -> tuple[Vector, Vector]:
    """Propagate primer and rate by ``dt`` s at constant gravity gradient."""
    p, q = costates
    _, curvature = gravity_terms(r, field_of(environment), p)
    return axpy(dt, axpy(0.5 * dt, curvature, q), p), axpy(dt, curvature, q)


@kernel
def planned_primer(
    believed: MissionRecords, onboard: Onboard, ignition: float
) -> tuple[Vector, Vector]:
    """Propagate the planned primer at ignition to now; without one start along the velocity.

    Args:
        believed: mission of :func:`believed_mission`.
        onboard: state of guidance.
        ignition: of the present burn, or of the next, s.
    """
    nav = onboard.navigation
    plan = onboard.state.plan
    k = nav.arc
    while believed.arcs[k].kind != BURN:
        k += 1
    p, q = load(plan.primer[k, 0]), load(plan.primer[k, 1])
    if not math.isfinite(norm(p) + norm(q)):
        p, q = tangential_primer(nav, believed, ignition)
    elif k == nav.arc:
        later = nav.time - plan.ignition[k]
        return primer_later(believed.environment, load(nav.position), (p, q), later)
    return propagated_back(nav, believed, ignition, (p, q))


@kernel
def guess_by_plan(believed: MissionRecords, onboard: Onboard) -> None:
    """Write the unknowns from the plan."""
    nav = onboard.navigation
    state = onboard.state
    memory = state.optimal
    u = memory.unknowns
    first_end = free_column(nav, believed.jettisons, memory.options)
    first = first_end
    end = nav.arc_start_time
    last = believed.arcs.shape[0] - 1
    for k in range(nav.arc, last + 1):
        free = math.isinf(believed.arcs[k].duration)
        end += state.plan.length[k] if free else believed.arcs[k].duration
        if free and k < last:
            u[first] = end
            first += 1
    u[COLUMN_CUTOFF] = end
    ignition = next_ignition(nav, believed, u[first_end:])
    p, q = planned_primer(believed, onboard, ignition)
    for i in range(3):
        u[i] = p[i]
        u[3 + i] = -q[i]
    index = COLUMN_JETTISON
    for j in range(believed.jettisons.shape[0]):
        if awaits_heating(believed.jettisons, nav.jettisoned, j):
            planned = state.plan.jettison_time
            u[index] = planned if math.isfinite(planned) else u[COLUMN_CUTOFF]
            u[index + 1] = 0.0
            index += 2


@kernel
def propagate_costates(mission: MissionRecords, onboard: Onboard) -> None:
    """Propagate the costates of the last solution to the present state, across jettisons."""
    nav = onboard.navigation
    environment = mission.environment
    memory = onboard.state.optimal
    u = memory.unknowns
    r = load(nav.position)
    p = (u[0], u[1], u[2])
    q = (-u[3], -u[4], -u[5])
    p, q = primer_later(environment, r, (p, q), nav.time - memory.time)
    # a jettison since then: apply its jump and remove its unknowns
    index = 0
    for j in range(mission.jettisons.shape[0]):
        if not awaits_heating(mission.jettisons, memory.jettisoned, j):
            continue
        if aboard(nav.jettisoned, j):
            index += 1
            continue
        pi = u[COLUMN_JETTISON + 2 * index + 1]
        _, by_r, by_v = log_heating_gradient(r, load(nav.velocity), environment, mission.atmosphere)
        p = axpy(-pi, by_v, p)
        q = axpy(pi, by_r, q)
        for i in range(COLUMN_JETTISON + 2 * index, MAX_UNKNOWNS - 2):
            u[i] = u[i + 2]
    size = 1.0 / norm(p)
    for i in range(3):
        u[i] = size * p[i]
        u[3 + i] = -size * q[i]
    first = free_column(nav, mission.jettisons, memory.options)
    for i in range(COLUMN_JETTISON + 1, first, 2):
        u[i] *= size
    drop_past_ends(mission, onboard, first)
    if memory.jettisoned != nav.jettisoned:
        memory.age = REFRESH
    memory.jettisoned = nav.jettisoned
    memory.time = nav.time


@kernel
def guess_by_steering(jettisons: NDArray[Any], onboard: Onboard) -> None:
    """Write the unknowns from the steering in force: lambda_v = direction, lambda_r = -rate."""
    nav = onboard.navigation
    solution = onboard.state.solution
    u = onboard.state.optimal.unknowns
    ahead = nav.time - solution.reference_time
    p = axpy(ahead, load(solution.direction_rate), load(solution.direction))
    size = 1.0 / norm(p)
    for i in range(3):
        u[i] = size * p[i]
        u[3 + i] = -size * solution.direction_rate[i]
    u[COLUMN_CUTOFF] = nav.time + solution.time_to_go - solution.tail_gain
    index = COLUMN_JETTISON
    for j in range(jettisons.shape[0]):
        if awaits_heating(jettisons, nav.jettisoned, j):
            planned = solution.jettison_time[j]
            u[index] = planned if math.isfinite(planned) else u[COLUMN_CUTOFF]
            u[index + 1] = 0.0
            index += 2
