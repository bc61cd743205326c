# SPDX-License-Identifier: Apache-2.0
"""Solve for the optimum as a root: shooting function and its Jacobian.

Unknowns: lambda_v and lambda_r at the start, the cut-off time, time and pi of every heating
jettison still to come, the ends of free arcs before the last, the directions of held burns.
Equations: |lambda_v| = 1 at the start (the scale is free; printed: H_f = 1, Eq. 3.30), the terminal
set with its reduced transversality conditions, log heating = log limit and a continuous
Hamiltonian per heating jettison, and the conditions of ``free_arcs`` and ``held_burns``.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.sequence import SAME_TIME, awaits_heating
from ares_models.kernels.vectors import (
    Vector,
    axpy,
    dot,
    load,
    norm,
)
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    Times,
    fill_timetable,
    free_count,
    heating_count,
    held_count,
    segment_flow,
    segment_mass,
    segment_thrust,
)
from ares_optimizer.two_point.arrays import AT_ONCE, LINEAR, ROWS, RUNGE_KUTTA, Gravity
from ares_optimizer.two_point.kernels.air import fly_in_air
from ares_optimizer.two_point.kernels.closed_form import closed_form_segment
from ares_optimizer.two_point.kernels.costates import (
    integrate_segment,
    log_heating_hessian_product,
    thrust_acceleration_tangents,
)
from ares_optimizer.two_point.kernels.free_arcs import find_switches, store_segment, switch_rows
from ares_optimizer.two_point.kernels.gravity import field_of, gravity_terms
from ares_optimizer.two_point.kernels.held_burns import (
    aim_rows,
    along_by_direction,
    along_thrust,
    clear_impulse_tangents,
    direction_column,
    load_aims,
)
from ares_optimizer.two_point.kernels.terminal import end_rows


class _Drop(NamedTuple):
    """Hold the quantities of the interior condition at a heating jettison.

    Attributes:
        row: first of its two residuals, that of the limit.
        weight: pi, or 0 if ``passive``.
        passive: true if the costates do not jump.
        pinned: true if the drop is fixed at its earliest time.
        before, after: T/m on both sides, m/s2.
        by_r, by_v: gradient of log heating, 1/m and s/m.
        gravity: gravity at the drop, m/s2.
    """

    row: int
    weight: float
    passive: bool
    pinned: bool
    before: float
    after: float
    by_r: Vector
    by_v: Vector
    gravity: Vector


@kernel
def _interior_residuals(
    i: int, limit: float, pi: float, mission: MissionRecords, gravity: Gravity, work: Record
) -> _Drop:
    """Write the residuals of the interior condition at the end of segment ``i``.

    Equations and arguments: see :func:`_jettison_rows`.
    """
    state = work.state
    segment = work.segments[i]
    index = segment.end_heating
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    before = thrust_acceleration_tangents(
        segment, segment.end - segment.start, 1.0, work.columns, work.thrust
    )
    after = thrust_acceleration_tangents(
        work.segments[i + 1], 0.0, 0.0, work.columns, work.thrust_after
    )
    rate, by_r, by_v = log_heating_gradient(r, v, mission.environment, mission.atmosphere)
    passive = work.passive == 1
    pinned = work.pinned[index] == 1
    weight = 0.0 if passive else pi
    g, _ = gravity_terms(r, gravity, p)
    drift = dot(by_r, v) + dot(by_v, g)
    row = COLUMN_JETTISON + 2 * index
    size = 1.0 / after if after > 0.0 else 1.0
    work.residual[row] = rate - math.log(limit)
    size_before, _ = along_thrust(segment, p, work)
    size_after, _ = along_thrust(work.segments[i + 1], axpy(-weight, by_v, p), work)
    # H(-) - H(+): gain by a later drop, per second
    worth = before * size_before - after * size_after + weight * drift
    work.waiting_pays[index] = 1 if worth > 0.0 else 0
    if passive:
        work.residual[row + 1] = pi
    elif pinned:
        # the time is fixed: no condition on the Hamiltonian
        work.residual[row + 1] = (segment.end - work.floor[row] - AT_ONCE) / 100.0
    else:
        work.residual[row + 1] = size * worth
    return _Drop(row, weight, passive, pinned, before, after, by_r, by_v, g)


@kernel
def _drop_column(
    c: int, i: int, drop: _Drop, mission: MissionRecords, gravity: Gravity, work: Record
) -> None:
    """Write column ``c`` of the Jacobian rows of a drop and the jump of its tangents.

    Args:
        c: column.
        i: segment that ends with the drop.
        drop: a drop that is not passive.
        mission: environment and atmosphere are read.
        gravity: the field.
        work: record WORK; the tangents of the column are advanced over the jump.
    """
    state = work.state
    tangent = work.tangent
    row = drop.row
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    dr = (tangent[c, 0], tangent[c, 1], tangent[c, 2])
    dv = (tangent[c, 3], tangent[c, 4], tangent[c, 5])
    dp = (tangent[c, 6], tangent[c, 7], tangent[c, 8])
    dq = (tangent[c, 9], tangent[c, 10], tangent[c, 11])
    d_by_r, d_by_v = log_heating_hessian_product(
        r, v, dr, dv, mission.environment, mission.atmosphere
    )
    dp_after = axpy(-drop.weight, d_by_v, dp)
    dq_after = axpy(drop.weight, d_by_r, dq)
    _, d_gravity = gravity_terms(r, gravity, dr)
    change = drop.weight * (
        dot(d_by_r, v) + dot(drop.by_r, dv) + dot(d_by_v, drop.gravity) + dot(drop.by_v, d_gravity)
    )
    if c == row + 1:
        dp_after = axpy(-1.0, drop.by_v, dp_after)
        dq_after = axpy(1.0, drop.by_r, dq_after)
        change += dot(drop.by_r, v) + dot(drop.by_v, drop.gravity)
    if drop.pinned:
        work.jacobian[row + 1, c] = 0.01 if c == row else 0.0
    else:
        size = 1.0 / drop.after if drop.after > 0.0 else 1.0
        p_after = axpy(-drop.weight, drop.by_v, p)
        segment = work.segments[i]
        following = work.segments[i + 1]
        length, u = along_thrust(segment, p, work)
        length_after, u_after = along_thrust(following, p_after, work)
        turned = along_by_direction(c, segment, p, work)
        turned_after = along_by_direction(c, following, p_after, work)
        work.jacobian[row + 1, c] = size * (
            work.thrust[c] * length
            + drop.before * (dot(u, dp) + turned)
            - work.thrust_after[c] * length_after
            - drop.after * (dot(u_after, dp_after) + turned_after)
            + change
        )
        # derivative of the scale 1 / after
        work.jacobian[row + 1, c] -= work.residual[row + 1] * size * work.thrust_after[c]
    for n in range(3):
        tangent[c, 6 + n] = dp_after[n]
        tangent[c, 9 + n] = dq_after[n]


@kernel
def _jettison_rows(
    i: int, limit: float, pi: float, mission: MissionRecords, gravity: Gravity, work: Record
) -> None:
    """Apply the interior condition at a heating jettison: residuals, Jacobian, jump.

    lambda_r(-) = lambda_r(+) + pi N_r and lambda_v(-) = lambda_v(+) + pi N_v with N the
    logarithm of heating, and H(-) = H(+) across the mass drop (printed in 3.44-3.51: without
    N_v). The mass costate is continuous and cancels.

    Args:
        i: segment that ends with the drop.
        limit: W/m2.
        pi: per unit of log heating.
        mission: environment and atmosphere are read.
        gravity: the field.
        work: record WORK; ``state`` and ``tangent`` are advanced over the jump.
    """
    state = work.state
    tangent = work.tangent
    drop = _interior_residuals(i, limit, pi, mission, gravity, work)
    row = drop.row
    for c in range(work.columns):
        dr = (tangent[c, 0], tangent[c, 1], tangent[c, 2])
        dv = (tangent[c, 3], tangent[c, 4], tangent[c, 5])
        work.jacobian[row, c] = dot(drop.by_r, dr) + dot(drop.by_v, dv)
        work.jacobian[row + 1, c] = 1.0 if c == row + 1 else 0.0
        if not drop.passive:
            _drop_column(c, i, drop, mission, gravity, work)
    for n in range(3):
        state[6 + n] -= drop.weight * drop.by_v[n]
        state[9 + n] += drop.weight * drop.by_r[n]


#: Difference of an unknown in the air, in its unit.
DIFFERENCE = 1e-6
#: Ratio of the longest step in a coast to that in a burn.
_COAST_STEPS = 4.0


@kernel
def free_column(start: Record, jettisons: NDArray[Any], options: Record) -> int:
    """Return the column of the first free end, after those of the heating jettisons."""
    return COLUMN_JETTISON + 2 * heating_count(start, jettisons, options.heating)


@kernel
def held_column(start: Record, mission: MissionRecords, options: Record) -> int:
    """Return the column of the first direction of a held burn, after those of free ends."""
    return free_column(start, mission.jettisons, options) + free_count(start, mission.arcs)


@kernel
def unknown_count(start: Record, mission: MissionRecords, options: Record) -> int:
    """Return the number of unknowns.

    7, and from the start on 2 per heating jettison, 1 per free arc but the last, 3 per held burn.
    """
    return held_column(start, mission, options) + 3 * held_count(start, mission.arcs)


@kernel
def which_jettison(start: Record, mission: MissionRecords, index: int) -> int:
    """Return the jettison of heating unknown ``index``; -1: none."""
    unknown = 0
    for j in range(mission.jettisons.shape[0]):
        if awaits_heating(mission.jettisons, start.jettisoned, j):
            if unknown == index:
                return j
            unknown += 1
    return -1


@kernel
def search_is_over(options: Record, work: Record) -> bool:
    """Return true if the search was stopped or has used up its steps."""
    return work.stop != 0 or 0 < options.max_steps <= work.spent


@kernel
def load_times(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> None:
    """Copy the unknown times of jettisons and free arcs into ``work``."""
    first = free_column(start, mission.jettisons, options)
    for i in range((first - COLUMN_JETTISON) // 2):
        work.heating_times[i] = unknowns[COLUMN_JETTISON + 2 * i]
    for f in range(free_count(start, mission.arcs)):
        work.arc_ends[f] = unknowns[first + f]


@kernel
def begin_flight(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> Gravity:
    """Set up segments, state and costates at the start in ``work``; return the field.

    Args:
        start: record NAVIGATION.
        mission: its records.
        options: record OPTIONS.
        unknowns: see :func:`shoot`.
        work: record WORK; ``segment_count`` is 0 where the times are not possible.
    """
    load_times(start, mission, options, unknowns, work)
    work.first_held = held_column(start, mission, options)
    load_aims(held_count(start, mission.arcs), unknowns, work)
    find_switches(start, mission.arcs, work)
    times = Times(options.heating, work.heating_times[:], work.arc_ends[:], unknowns[COLUMN_CUTOFF])
    work.segment_count = fill_timetable(
        start, mission.arcs, mission.jettisons, times, work.segments[:], work.layout
    )
    work.passive = 0 if options.heating == HEATING_OPTIMAL else 1
    state = work.state
    for i in range(3):
        state[i] = start.position[i]
        state[3 + i] = start.velocity[i]
        state[6 + i] = unknowns[i]
        state[9 + i] = -unknowns[3 + i]
    square = state[0] * state[0] + state[1] * state[1] + state[2] * state[2]
    work.lowest = math.sqrt(square)
    work.pressure_share = 0.0
    mu = mission.environment.mu
    omega_square = 0.0
    if options.gravity == LINEAR:
        # omega0 at the radius of the start (Eq. 3.4; printed without the root)
        omega_square = mu / (square * work.lowest)
    field = field_of(mission.environment)
    return Gravity(mu, omega_square, options.gravity, field.oblateness)


@kernel
def part_of(segment: Record, k: int, parts: int, part: Record) -> None:
    """Copy one of the equal parts of a segment into ``part``, with fixed ends."""
    length = segment.end - segment.start
    s = length * k / parts
    part.start = segment.start + s
    part.end = segment.end if k == parts - 1 else part.start + length / parts
    part.thrust = segment_thrust(segment, part.start)
    part.thrust_slope = segment.thrust_slope
    part.flow = segment_flow(segment, part.start)
    part.flow_slope = segment.flow_slope
    part.fading = segment.fading
    part.mass = segment_mass(segment, part.start)
    part.held = segment.held
    part.moves = 0


@kernel
def step_count(segment: Record, longest: float) -> int:
    """Return the number of equal steps in a segment, none longer than ``longest`` s.

    In a coast, _COAST_STEPS times that.
    """
    if segment.thrust == 0.0 and segment.thrust_slope == 0.0:
        longest *= _COAST_STEPS
    return max(1, int(math.ceil((segment.end - segment.start) / longest - 1e-9)))


@kernel
def fly_segment(
    segment: Record, steps: int, gravity: Gravity, options: Record, work: Record
) -> None:
    """Propagate ``work.state`` and ``work.tangent`` over a segment."""
    if options.propagator == RUNGE_KUTTA:
        integrate_segment(segment, steps, gravity, work)
    else:
        closed_form_segment(segment, steps, gravity, options, work)
    state = work.state
    radius = math.sqrt(state[0] * state[0] + state[1] * state[1] + state[2] * state[2])
    work.lowest = min(work.lowest, radius)


@kernel
def aim_held_burns(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> None:
    """Estimate the directions of held burns that have none, from a guided flight.

    Args:
        start: record NAVIGATION.
        mission: its records.
        options: record OPTIONS.
        unknowns: see :func:`shoot`; directions of length 0 are overwritten.
        work: record WORK.
    """
    count = held_count(start, mission.arcs)
    first = held_column(start, mission, options)
    aimed = True
    for k in range(count):
        aimed = aimed and norm(load(unknowns[first + 3 * k :])) > 0.0
    if aimed:
        return
    gravity = begin_flight(start, mission, options, unknowns, work)
    work.columns = 0
    work.aiming = 1
    for i in range(work.segment_count):
        steps = step_count(work.segments[i], options.step)
        work.spent += steps
        fly_segment(work.segments[i], steps, gravity, options, work)
    work.aiming = 0
    for k in range(count):
        column = direction_column(k + 1, work)
        primer_impulse = load(work.aims[k].primer_impulse)
        if norm(load(unknowns[column:])) == 0.0 and norm(primer_impulse) > 0.0:
            for i in range(3):
                unknowns[column + i] = primer_impulse[i] / norm(primer_impulse)


@kernel
def _begin_rows(unknowns: NDArray[np.float64], work: Record) -> None:
    """Set the tangents at the start, and the first equation, |lambda_v| = 1."""
    work.columns = min(6, work.columns_wanted)
    for c in range(work.columns_wanted):
        for i in range(ROWS):
            work.tangent[c, i] = 0.0
        work.jacobian[0, c] = unknowns[c] if c < 3 else 0.0
    for i in range(min(3, work.columns)):
        work.tangent[i, 6 + i] = 1.0
        work.tangent[3 + i, 9 + i] = -1.0
    work.residual[0] = 0.5 * (
        unknowns[0] * unknowns[0] + unknowns[1] * unknowns[1] + unknowns[2] * unknowns[2] - 1.0
    )


@kernel
def _shoot(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """Fly to the end with ``work.columns_wanted`` tangents; return false on failure."""
    work.evaluations += 1
    gravity = begin_flight(start, mission, options, unknowns, work)
    count = work.segment_count
    if count == 0:
        return False
    _begin_rows(unknowns, work)
    held = held_count(start, mission.arcs)
    clear_impulse_tangents(held, work)
    met = 0
    for i in range(count):
        segment = work.segments[i]
        if segment.moves == 1 or segment.held > 0:
            work.columns = work.columns_wanted
        if options.in_air == 1 and segment.start < options.air_end - SAME_TIME:
            work.spent += fly_in_air(segment, options.air_end, gravity, mission, work)
        else:
            # the number of steps never falls within a solve: no chatter between two grids
            steps = max(step_count(segment, options.step), work.steps[i])
            work.steps[i] = steps
            work.spent += steps
            fly_segment(segment, steps, gravity, options, work)
        if work.planned == 1:
            store_segment(i, mission.arcs, gravity, work)
        if segment.end_heating >= 0 and i + 1 < count:
            met += 1
            limit = mission.jettisons[which_jettison(start, mission, segment.end_heating)].value
            pi = unknowns[COLUMN_JETTISON + 2 * segment.end_heating + 1]
            _jettison_rows(i, limit, pi, mission, gravity, work)
    n = unknown_count(start, mission, options)
    first = free_column(start, mission.jettisons, options)
    if COLUMN_JETTISON + 2 * met != first:
        return False
    end_rows(mission.target, gravity.mu, work)
    aim_rows(held, work)
    if work.planned == 1 and not switch_rows(start, mission, unknowns, first, work):
        return False
    total = 0.0
    for i in range(n):
        total += work.residual[i]
    return math.isfinite(total)


@kernel
def shoot(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """Evaluate the residuals of the unknowns by a flight to the end.

    Args:
        start: record NAVIGATION.
        mission: its records.
        options: record OPTIONS.
        unknowns: shape (at least n,): lambda_v (3), lambda_r (3, 1/s), cut-off time (s), then
            per heating jettison its time (s) and pi (per unit of log heating), then the end
            (s) of each free arc but the last, then the direction (3) of each held burn.
        work: record WORK; ``residual`` is written, ``state`` holds the end.

    Returns:
        False if the times are not possible, or a residual is not finite.
    """
    work.columns_wanted = 0
    return _shoot(start, mission, options, unknowns, work)


@kernel
def shoot_with_jacobian(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """Evaluate residuals and Jacobian, arguments and result as :func:`shoot`.

    In the air the Jacobian is of differences.
    """
    n = unknown_count(start, mission, options)
    if options.in_air == 0:
        work.columns_wanted = n
        return _shoot(start, mission, options, unknowns, work)
    work.columns_wanted = 0
    if not _shoot(start, mission, options, unknowns, work):
        return False
    # each flight turns the frame of the transversality conditions from where it was
    frame = work.terminal_frame
    for i in range(6):
        for k in range(6):
            work.free_kept[i, k] = frame.free[i, k]
    for c in range(n):
        kept = unknowns[c]
        unknowns[c] = kept + DIFFERENCE * work.unit[c]
        good = _shoot(start, mission, options, unknowns, work)
        unknowns[c] = kept
        for i in range(6):
            for k in range(6):
                frame.free[i, k] = work.free_kept[i, k]
        if not good:
            return False
        for i in range(n):
            work.jacobian[i, c] = work.residual[i]
    if not _shoot(start, mission, options, unknowns, work):
        return False
    for c in range(n):
        for i in range(n):
            work.jacobian[i, c] -= work.residual[i]
            work.jacobian[i, c] /= DIFFERENCE * work.unit[c]
    return True
