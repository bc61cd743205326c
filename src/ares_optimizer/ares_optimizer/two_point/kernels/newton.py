# SPDX-License-Identifier: Apache-2.0
"""Newton's method for the two-point problem, with backtracking."""

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
from ares_optimizer.two_point.kernels.free_arcs import find_switches, longest_burn, room
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
#: A heating jettison ran into its earliest time: the limit may be met from there on.
AT_FLOOR = 5
#: Converged, but to something that no vehicle should fly.
UNSOUND = 6
#: The time or the work that the search may take has ended.
STOPPED = 7
#: A free arc ran into a bound of its length.
AT_BOUND = 8
#: Within an iteration: go on.
NOT_YET = -1

_SMALLEST_FRACTION = 1e-3
_ROUNDING = 1e-13  # of the residuals: under a micrometre; near cut-off no step can mend it
_CLOSE = 0.1  # scaled step within which a trial goes without a Jacobian
_CONTRACTION = 0.1  # of simplified corrections, to go on with the same factors
_NEAR_FLOOR = 1.0  # s
_INSIDE = 0.5  # s, of a guessed drop to its bounds at most: so near it can run into its floor
_FAR = 1e7  # s, a cut-off beyond every event
_NEAR_BOUND = 0.02  # of the span between the bounds of an arc
_LONGEST_SPAN = 100.0  # s, of an arc without a longest length, in that sense


@kernel
def find_floors(start: Record, mission: MissionRecords, work: Record) -> bool:
    """Earliest time of every unknown time, and the latest cut-off, into ``work``.

    Free arcs end as ``work.arc_ends`` says.

    Returns:
        False if the sequence makes no flight, or none of at most LONGEST_FLIGHT.
    """
    arcs = mission.arcs
    jettisons = mission.jettisons
    # not the nested arrays themselves: numba would compile the timetable once more for them
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
    # 2 % of the mass is left: beyond that nothing flies
    latest = start.time + LONGEST_FLIGHT
    work.ceiling = min(final.start + 0.98 * final.mass / final.flow, latest)
    return work.floor[COLUMN_CUTOFF] < work.ceiling


@kernel
def prepare(start: Record, mission: MissionRecords, options: Record, work: Record) -> None:
    """Units of the unknowns; step counts start anew."""
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
    """Norm of a step in scaled unknowns."""
    total = 0.0
    for i in range(n):
        total += (x[i] / unit[i]) ** 2
    return math.sqrt(total)


@kernel
def _begin_moves(k: int, step: NDArray[np.float64], work: Record) -> float:
    """By how much a step moves the begin of arc ``k``, s."""
    total = 0.0
    for c in range(work.layout.moves):
        total += work.layout.begins[k].time_by[c] * step[COLUMN_CUTOFF + c]
    return total


@kernel
def _limit_free_arcs(
    limit: float, mission: MissionRecords, x: NDArray[np.float64], count: int, work: Record
) -> float:
    """The largest fraction of the step that leaves free arcs their lengths."""
    for f in range(count):
        if work.switches[f].hold != NOT_HELD:
            continue
        shorter, longer = room(f, mission.arcs, x, work)
        move = work.step[work.first_free + f] - _begin_moves(work.switches[f].arc, work.step, work)
        if shorter + limit * move < 0.2 * shorter:
            limit = -0.8 * shorter / move
        if longer - limit * move < 0.2 * longer:
            limit = 0.8 * longer / move
    return limit


@kernel
def _step_limit(n: int, mission: MissionRecords, x: NDArray[np.float64], work: Record) -> float:
    """Largest fraction of the Newton step that keeps the flight a flight."""
    step = work.step
    limit = 1.0
    # no more than about 30 deg, 1e-3 1/s, 100 s at once
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
    """Move a guess to possible times; units of a short flight."""
    floor = work.floor[COLUMN_CUTOFF]
    unknowns[COLUMN_CUTOFF] = min(
        max(unknowns[COLUMN_CUTOFF], floor + 1e-6 * (work.ceiling - floor)),
        work.ceiling - 0.01 * (work.ceiling - floor),
    )
    # in a short flight times are shorter and rates greater
    part = min(1.0, (unknowns[COLUMN_CUTOFF] - start.time) / work.unit[COLUMN_CUTOFF])
    work.unit[COLUMN_CUTOFF] *= part
    for i in range(3, 6):
        work.unit[i] /= part
    for i in range(COLUMN_JETTISON, work.first_free, 2):
        if work.pinned[(i - COLUMN_JETTISON) // 2] == 1:
            unknowns[i] = work.floor[i] + AT_ONCE
            continue
        span = unknowns[COLUMN_CUTOFF] - work.floor[i]
        # after a long coast a hundredth is a long time
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
    """Newton's step from residuals and Jacobian; its scaled length, nan if there is none."""
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
    """Simplified Newton correction, with the last factors; its scaled length."""
    for i in range(n):
        work.correction[i] = -work.residual[i]
    back_substitute(n, work.factors, work.pivots, work.correction)
    return scaled_length(n, work.correction, work.unit)


@kernel
def _runs_into_floor(unknowns: NDArray[np.float64], work: Record) -> bool:
    """Whether the step takes a drop before its earliest time; ``work.stuck`` says which."""
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
    """Whether the step takes a free arc beyond a bound; ``work.stuck_arc`` says which."""
    for f in range(free_count(start, mission.arcs)):
        switch = work.switches[f]
        if switch.hold != NOT_HELD:
            continue
        shorter, longer = room(f, mission.arcs, unknowns, work)
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


class _Taken(NamedTuple):
    """A step as it was taken.

    Attributes:
        fraction: of Newton's step; 0: none brings the flight nearer.
        with_jacobian: whether the last trial has one.
        shorter: scaled length of the simplified correction that follows.
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
) -> _Taken:
    """Halve the step until the next simplified correction is shorter; ``unknowns`` move."""
    n = unknown_count(start, mission, options)
    # far away the first trial is nearly always taken and its Jacobian wanted; close by the old
    # one will do
    with_jacobian = length > _CLOSE
    # not the nested array itself: numba would compile the flight once more for it
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
            return _Taken(0.0, False, shorter)
    for i in range(n):
        unknowns[i] = trial[i]
    return _Taken(fraction, with_jacobian, shorter)


@kernel
def _simplified_newton(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    shorter: float,
    work: Record,
) -> int:
    """Corrections with the same factors as long as they shrink fast: ``unknowns`` move.

    Returns:
        CONVERGED, STALLED where the times make no flight, or NOT_YET.
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
    """One iteration of Newton's method; norm of the residuals, and how it ended."""
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
    taken = _search_along_step(start, mission, options, unknowns, length, work)
    if taken.fraction == 0.0:
        return residual_norm, STALLED
    if taken.with_jacobian:
        return residual_norm, NOT_YET
    if taken.fraction == 1.0:
        status = _simplified_newton(start, mission, options, unknowns, taken.shorter, work)
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
    """Newton with backtracking from ``unknowns``, which are improved in place.

    A step is taken when the next simplified Newton correction is shorter than the step
    (Deuflhard, *Newton Methods for Nonlinear Problems*, section 3.3): the test does not
    depend on how the equations are scaled.

    Args:
        start: record NAVIGATION: time, position, velocity, mass (0: that of the stack), arc,
            arc_start_time, jettisoned.
        mission: what is flown; its last arc is the burn that the cut-off ends.
        options: record OPTIONS.
        unknowns: shape (at least n,), see :func:`shoot`; guess in, answer out.
        work: record WORK; ``pinned`` says which drops are held at their earliest time.

    Returns:
        iterations, norm of the last residuals, status (CONVERGED or what went wrong).
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
