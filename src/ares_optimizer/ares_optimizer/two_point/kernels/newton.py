# SPDX-License-Identifier: Apache-2.0
"""Solve the two-point problem by Newton's method with backtracking."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, LONGEST_FLIGHT, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.linear import back_substitute, factor
from ares_models.kernels.sequence import awaits_heating
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_IGNORED,
    MAX_SEGMENTS,
    Times,
    fill_timetable,
    free_count,
)
from ares_optimizer.two_point.arrays import (
    AT_LONGEST,
    AT_ONCE,
    AT_SHORTEST,
    DRY,
    NOT_HELD,
)
from ares_optimizer.two_point.kernels.free_arcs import find_switches, length_margins, longest_burn
from ares_optimizer.two_point.kernels.shooting import (
    aim_held_burns,
    free_column,
    held_column,
    load_times,
    search_is_over,
    shoot,
    shoot_with_jacobian,
    unknown_count,
)

CONVERGED = 0
ITERATION_LIMIT = 1
STALLED = 2
SINGULAR = 3
BAD_TIMETABLE = 4
#: A heating jettison reached its earliest time: its limit may be inactive.
AT_FLOOR = 5
#: Converged to a root that is no acceptable flight.
UNSOUND = 6
#: Stopped by the caller, or out of steps.
STOPPED = 7
#: A free arc reached a bound of its length.
AT_BOUND = 8
#: Not finished: continue to iterate.
NOT_YET = -1

_SMALLEST_FRACTION = 1e-3
_ROUNDING = 1e-13  # of the residuals, less than a micrometre: near cut-off no step reduces them
_CLOSE = 0.1  # scaled step below which a trial is made without a Jacobian
_CONTRACTION = 0.1  # of simplified corrections, to keep the factors
_NEAR_FLOOR = 1.0  # s
_INSIDE = 0.5  # s, largest margin of a guessed drop to its bounds; less than _NEAR_FLOOR
_FAR = 1e7  # s, a cut-off beyond every event
_NEAR_BOUND = 0.02  # of the span between the bounds of an arc
_LONGEST_SPAN = 100.0  # s, largest span for _NEAR_BOUND


@kernel
def find_floors(start: Record, mission: MissionRecords, work: Record) -> bool:
    """Write the earliest time of every unknown time, and the latest cut-off, into ``work``.

    Ends of free arcs are those of ``work.arc_ends``.

    Returns:
        False if there is no timetable, or none of at most LONGEST_FLIGHT.
    """
    arcs = mission.arcs
    jettisons = mission.jettisons
    # slices, not nested arrays: numba would compile the timetable again for those
    times = Times(HEATING_IGNORED, work.heating_times[:], work.arc_ends[:], _FAR)
    count = fill_timetable(start, arcs, jettisons, times, work.segments[:], work.layout)
    if count == 0:
        return False
    column = COLUMN_JETTISON
    for j in range(jettisons.shape[0]):
        if not awaits_heating(jettisons, start.jettisoned, j):
            continue
        earliest = start.time
        for i in range(count):
            arc = arcs[work.segments[i].arc]
            if arc.kind == BURN and arc.stage >= jettisons[j].stage:
                earliest = work.segments[i].start
                break
        work.floor[column] = earliest
        column += 2
    for i in range(count):
        if work.segments[i].arc == arcs.shape[0] - 1:
            work.floor[COLUMN_CUTOFF] = work.segments[i].start
            break
    while work.segments[count - 1].after_cutoff == 1:
        count -= 1
    final = work.segments[count - 1]
    # 2 % of the mass is left: later cut-offs are not tried
    latest = start.time + LONGEST_FLIGHT
    work.ceiling = min(final.start + 0.98 * final.mass / final.flow, latest)
    return work.floor[COLUMN_CUTOFF] < work.ceiling


@kernel
def prepare(start: Record, mission: MissionRecords, options: Record, work: Record) -> None:
    """Set the scales of the unknowns and reset the step counts."""
    n = unknown_count(start, mission, options)
    work.first_free = free_column(start, mission.jettisons, options)
    work.first_held = held_column(start, mission, options)
    find_switches(start, mission.arcs, work)
    for i in range(n):
        work.unit[i] = 1.0
    for i in range(3):
        work.unit[3 + i] = 1e-3
    for i in range(COLUMN_CUTOFF, work.first_held):
        work.unit[i] = 100.0
    for i in range(COLUMN_JETTISON + 1, work.first_free, 2):
        work.unit[i] = 5.0
    for i in range(MAX_SEGMENTS):
        work.steps[i] = 0
    work.evaluations = 0


@kernel
def scaled_length(n: int, x: NDArray[np.float64], unit: NDArray[np.float64]) -> float:
    """Return the norm of a step in scaled unknowns."""
    total = 0.0
    for i in range(n):
        total += (x[i] / unit[i]) ** 2
    return math.sqrt(total)


@kernel
def _begin_moves(k: int, step: NDArray[np.float64], work: Record) -> float:
    """Return the change of the begin of arc ``k`` with a step, s."""
    total = 0.0
    for c in range(work.layout.moves):
        total += work.layout.begins[k].time_by[c] * step[COLUMN_CUTOFF + c]
    return total


@kernel
def _limit_free_arcs(
    limit: float, mission: MissionRecords, x: NDArray[np.float64], count: int, work: Record
) -> float:
    """Return the largest fraction of the step that keeps free arcs in their bounds."""
    for f in range(count):
        if work.switches[f].hold != NOT_HELD:
            continue
        shorter, longer = length_margins(f, mission.arcs, x, work)
        move = work.step[work.first_free + f] - _begin_moves(work.switches[f].arc, work.step, work)
        if shorter + limit * move < 0.2 * shorter:
            limit = -0.8 * shorter / move
        if longer - limit * move < 0.2 * longer:
            limit = 0.8 * longer / move
    return limit


@kernel
def _step_limit(n: int, mission: MissionRecords, x: NDArray[np.float64], work: Record) -> float:
    """Return the largest fraction of the Newton step that keeps the times possible."""
    step = work.step
    limit = 1.0
    # at most about 30 deg, 1e-3 1/s, 100 s per step
    for i in range(n):
        size = abs(step[i]) / work.unit[i]
        bound = 1.0
        if i < 3 or i >= work.first_held:
            bound = 0.5
        if size * limit > bound:
            limit = bound / size
    cutoff = x[COLUMN_CUTOFF]
    move = step[COLUMN_CUTOFF]
    floor = work.floor[COLUMN_CUTOFF]
    ceiling = work.ceiling
    if work.planned == 1:
        last = mission.arcs.shape[0] - 1
        floor = work.layout.begins[last].time
        move -= _begin_moves(last, step, work)
        ceiling = math.inf
        limit = _limit_free_arcs(limit, mission, x, work.first_held - work.first_free, work)
    gap = cutoff - floor
    if gap + limit * move < 0.2 * gap:
        limit = -0.8 * gap / move
    gap = ceiling - cutoff
    if gap - limit * move < 0.2 * gap:
        limit = 0.8 * gap / move
    move = step[COLUMN_CUTOFF]
    for i in range(COLUMN_JETTISON, work.first_free, 2):
        if work.pinned[(i - COLUMN_JETTISON) // 2] == 1:
            continue
        gap = x[i] - work.floor[i]
        if gap + limit * step[i] < 0.2 * gap:
            limit = -0.8 * gap / step[i]
        gap = cutoff - x[i]
        if gap + limit * (move - step[i]) < 0.2 * gap:
            limit = 0.8 * gap / (step[i] - move)
    return limit


@kernel
def _move_inside(start: Record, unknowns: NDArray[np.float64], work: Record) -> None:
    """Move a guess to possible times and adapt the scales to a short flight."""
    floor = work.floor[COLUMN_CUTOFF]
    unknowns[COLUMN_CUTOFF] = min(
        max(unknowns[COLUMN_CUTOFF], floor + 1e-6 * (work.ceiling - floor)),
        work.ceiling - 0.01 * (work.ceiling - floor),
    )
    # scales of a short flight: times are shorter and rates greater
    part = min(1.0, (unknowns[COLUMN_CUTOFF] - start.time) / work.unit[COLUMN_CUTOFF])
    work.unit[COLUMN_CUTOFF] *= part
    for i in range(3, 6):
        work.unit[i] /= part
    for i in range(COLUMN_JETTISON, work.first_free, 2):
        if work.pinned[(i - COLUMN_JETTISON) // 2] == 1:
            unknowns[i] = work.floor[i] + AT_ONCE
            continue
        span = unknowns[COLUMN_CUTOFF] - work.floor[i]
        # 1 % of a long coast would be too large a margin
        inside = min(0.01 * span, _INSIDE)
        unknowns[i] = min(
            max(unknowns[i], work.floor[i] + inside), unknowns[COLUMN_CUTOFF] - inside
        )


@kernel
def _residual_norm(n: int, work: Record) -> float:
    total = 0.0
    for i in range(n):
        total += work.residual[i] ** 2
    return math.sqrt(total)


@kernel
def _newton_step(n: int, work: Record) -> float:
    """Compute Newton's step; return its scaled length, nan where the Jacobian is singular."""
    for i in range(n):
        work.step[i] = -work.residual[i]
        for j in range(n):
            work.factors[i, j] = work.jacobian[i, j]
    if not factor(n, work.factors, work.pivots):
        return math.nan
    back_substitute(n, work.factors, work.pivots, work.step)
    return scaled_length(n, work.step, work.unit)


@kernel
def _correction(n: int, work: Record) -> float:
    """Compute the simplified Newton correction, same factors; return its scaled length."""
    for i in range(n):
        work.correction[i] = -work.residual[i]
    back_substitute(n, work.factors, work.pivots, work.correction)
    return scaled_length(n, work.correction, work.unit)


@kernel
def _runs_into_floor(unknowns: NDArray[np.float64], work: Record) -> bool:
    """Detect a step of a drop to before its earliest time; set ``work.stuck``."""
    for i in range(COLUMN_JETTISON, work.first_free, 2):
        index = (i - COLUMN_JETTISON) // 2
        near = unknowns[i] < work.floor[i] + _NEAR_FLOOR
        if near and unknowns[i] + work.step[i] < work.floor[i] and work.pinned[index] == 0:
            work.stuck = index
            return True
    return False


@kernel
def _runs_into_bound(
    start: Record, mission: MissionRecords, unknowns: NDArray[np.float64], work: Record
) -> bool:
    """Detect a step of a free arc beyond a bound; set ``stuck_arc``, ``stuck_hold``."""
    for f in range(free_count(start, mission.arcs)):
        switch = work.switches[f]
        if switch.hold != NOT_HELD:
            continue
        shorter, longer = length_margins(f, mission.arcs, unknowns, work)
        near = _NEAR_BOUND * min(shorter + longer, _LONGEST_SPAN)
        move = work.step[work.first_free + f] - _begin_moves(switch.arc, work.step, work)
        work.stuck_arc = f
        if shorter < near and shorter + move < 0.0:
            work.stuck_hold = AT_SHORTEST
            return True
        if longer < near and longer - move < 0.0:
            arc = mission.arcs[switch.arc]
            dry = arc.kind == BURN
            if dry:
                dry = longest_burn(switch.arc, mission.arcs, work) < arc.longest
            work.stuck_hold = DRY if dry else AT_LONGEST
            return True
    return False


class _LineSearch(NamedTuple):
    """Hold the outcome of the line search.

    Attributes:
        fraction: of Newton's step; 0: no acceptable step.
        with_jacobian: true if the Jacobian of the last trial is computed.
        shorter: scaled length of the simplified correction at the last trial.
    """

    fraction: float
    with_jacobian: bool
    shorter: float


@kernel
def _search_along_step(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    length: float,
    work: Record,
) -> _LineSearch:
    """Halve the step until the next simplified correction is shorter; apply it."""
    n = unknown_count(start, mission, options)
    # far from the root the first trial is nearly always accepted and needs its Jacobian; close to
    # the root the old one suffices
    with_jacobian = length > _CLOSE
    # a slice, not the nested array: numba would compile the flight again for that
    trial = work.trial[:]
    fraction = _step_limit(n, mission, unknowns, work)
    while True:
        for i in range(n):
            trial[i] = unknowns[i] + fraction * work.step[i]
        if with_jacobian:
            good = shoot_with_jacobian(start, mission, options, trial, work)
        else:
            good = shoot(start, mission, options, trial, work)
        shorter = _correction(n, work) if good else math.inf
        if shorter <= (1.0 - 0.25 * fraction) * length:
            break
        with_jacobian = False
        fraction *= 0.5
        if not fraction >= _SMALLEST_FRACTION:
            return _LineSearch(0.0, False, shorter)
    for i in range(n):
        unknowns[i] = trial[i]
    return _LineSearch(fraction, with_jacobian, shorter)


@kernel
def _simplified_newton(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    shorter: float,
    work: Record,
) -> int:
    """Iterate with the same factors while the corrections shrink fast.

    Returns:
        CONVERGED, STALLED where the times are not possible, or NOT_YET.
    """
    n = unknown_count(start, mission, options)
    before = scaled_length(n, work.step, work.unit)
    while shorter < _CONTRACTION * before:
        for i in range(n):
            unknowns[i] += work.correction[i]
        if shorter <= options.tolerance:
            return CONVERGED
        before = shorter
        if not shoot(start, mission, options, unknowns, work):
            return STALLED
        shorter = _correction(n, work)
    return NOT_YET


@kernel
def _iterate(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[float, int]:
    """Perform one iteration of Newton's method; return residual norm and status."""
    n = unknown_count(start, mission, options)
    residual_norm = _residual_norm(n, work)
    length = _newton_step(n, work)
    if not math.isfinite(length):
        return residual_norm, SINGULAR
    if length <= options.tolerance or residual_norm <= _ROUNDING:
        for i in range(n):
            unknowns[i] += work.step[i]
        return residual_norm, CONVERGED
    if _runs_into_floor(unknowns, work):
        return residual_norm, AT_FLOOR
    if _runs_into_bound(start, mission, unknowns, work):
        return residual_norm, AT_BOUND
    line_search = _search_along_step(start, mission, options, unknowns, length, work)
    if line_search.fraction == 0.0:
        return residual_norm, STALLED
    if line_search.with_jacobian:
        return residual_norm, NOT_YET
    if line_search.fraction == 1.0:
        status = _simplified_newton(start, mission, options, unknowns, line_search.shorter, work)
        if status == CONVERGED:
            return _residual_norm(n, work), CONVERGED
        if status == STALLED:
            return residual_norm, STALLED
    if not shoot_with_jacobian(start, mission, options, unknowns, work):
        return residual_norm, STALLED
    return residual_norm, NOT_YET


@kernel
def solve_two_point(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int]:
    """Solve the two-point problem by Newton's method from ``unknowns``, updated in place.

    A step is accepted if the next simplified Newton correction is shorter than the step
    (Deuflhard, *Newton Methods for Nonlinear Problems*, section 3.3): the test does not depend on
    the scaling of the equations.

    Args:
        start: record NAVIGATION: time, position, velocity, mass (0: that of the stack), arc,
            arc_start_time, jettisoned.
        mission: its last arc is the burn that ends with the cut-off.
        options: record OPTIONS.
        unknowns: shape (at least n,), see :func:`shoot`; the guess, overwritten by the root.
        work: record WORK; ``pinned`` marks the drops fixed at their earliest time.

    Returns:
        iterations, norm of the last residuals, status.
    """
    n = unknown_count(start, mission, options)
    prepare(start, mission, options, work)
    load_times(start, mission, options, unknowns, work)
    if not find_floors(start, mission, work):
        return 0, math.inf, BAD_TIMETABLE
    _move_inside(start, unknowns, work)
    aim_held_burns(start, mission, options, unknowns, work)
    if not shoot_with_jacobian(start, mission, options, unknowns, work):
        return 0, math.inf, BAD_TIMETABLE
    for iteration in range(1, options.max_iterations + 1):
        if search_is_over(options, work):
            return iteration, math.inf, STOPPED
        residual_norm, status = _iterate(start, mission, options, unknowns, work)
        if status != NOT_YET:
            return iteration, residual_norm, status
    return options.max_iterations, _residual_norm(n, work), ITERATION_LIMIT
