# SPDX-License-Identifier: Apache-2.0
"""List the events of a flight in order of time, with the variables that set their times."""

import math
from typing import NamedTuple

from ares_models.jit import kernel
from ares_optimizer.direct.kernels.problem import (
    AT_DROP,
    AT_START,
    L_BEGINS,
    P_TIME,
    TIME_SCALE,
    Problem,
)
from ares_optimizer.direct.kernels.scratch import BREAKS, LATER_PEAKS, Scratch
from ares_optimizer.kernels.algebra import Array, Index

# kinds of breaks
PIECE = 0
LAW = 1
DROP = 2
CUTOFF = 3
TAIL = 4
PROBE = 5
HELD = 6
HELD_END = 7

FIXED = -1
MOST_STEPS = 200


@kernel
def drop_column(problem: Problem, j: int) -> int:
    """Return the column of the time of drop ``j``."""
    return problem.variables - 1 - problem.drops.shape[0] + j


class Break(NamedTuple):
    """Hold an event of the flight.

    Attributes:
        kind: PIECE, LAW, DROP, CUTOFF, TAIL, PROBE, HELD or HELD_END.
        number: index within its kind.
        column: variable that sets its time; FIXED: none.
        time: s after the start.
    """

    kind: int
    number: int
    column: int
    time: float


@kernel
def add_break(at: Break, count: int, times: Array, breaks: Index) -> int:
    """Store an event; return the number of events."""
    times[count] = at.time
    breaks[count, 0] = at.kind
    breaks[count, 1] = at.number
    breaks[count, 2] = at.column
    return count + 1


@kernel
def sort_breaks(count: int, times: Array, breaks: Index) -> None:
    """Sort events by time, stable: at one instant pieces precede laws, drops and cut-off."""
    for i in range(1, count):
        time = times[i]
        kind, number, column = breaks[i, 0], breaks[i, 1], breaks[i, 2]
        k = i
        while k > 0 and times[k - 1] > time:
            times[k] = times[k - 1]
            breaks[k, 0] = breaks[k - 1, 0]
            breaks[k, 1] = breaks[k - 1, 1]
            breaks[k, 2] = breaks[k - 1, 2]
            k -= 1
        times[k] = time
        breaks[k, 0] = kind
        breaks[k, 1] = number
        breaks[k, 2] = column


@kernel
def count_steps(count: int, longest: float, times: Array, breaks: Index) -> None:
    """Set the number of integration steps from each break to the next."""
    for i in range(count - 1):
        duration = times[i + 1] - times[i]
        same = breaks[i, 2] == breaks[i + 1, 2]
        if same and duration <= 0.0:
            breaks[i, 3] = 0
        elif duration < MOST_STEPS * longest:
            breaks[i, 3] = max(1, int(math.ceil(duration / longest)))
        else:
            # not a plausible flight: bound the work
            breaks[i, 3] = MOST_STEPS
    breaks[count - 1, 3] = 0


@kernel
def lay_out(p: Array, problem: Problem, scratch: Scratch) -> None:
    """List all events of the flight in order of time.

    Args:
        p: shape (n,), variables.
        problem: the flight.
        scratch: its LATER_PEAKS ``peaks`` are listed as probes. Written: ``times`` of the
            breaks, s after the start; ``breaks``: kind, index within the kind, column of the
            time (or FIXED), number of integration steps to the next break; and the count of
            BREAKS. The last break is the end of thrust.
    """
    times = scratch.times
    breaks = scratch.breaks
    last = problem.variables - 1
    cutoff = p[last] * TIME_SCALE
    scratch.counts[BREAKS] = 0
    count = scratch.counts[BREAKS]
    for k in range(problem.profile.shape[0]):
        at = problem.profile[k, P_TIME] - problem.start_time
        if k == 0 or at < cutoff:
            count = add_break(Break(PIECE, k, FIXED, at), count, times, breaks)
    for k in range(problem.laws.shape[0]):
        if problem.laws[k, L_BEGINS] == AT_DROP:
            continue
        at = problem.law_time[k] - problem.start_time
        if problem.laws[k, L_BEGINS] == AT_START or at < cutoff:
            count = add_break(Break(LAW, k, FIXED, at), count, times, breaks)
    for k in range(problem.held.shape[0]):
        for kind, end in ((HELD, 0), (HELD_END, 1)):
            at = problem.held_time[k, end] - problem.start_time
            if at < cutoff:
                count = add_break(Break(kind, k, FIXED, at), count, times, breaks)
    for j in range(problem.drops.shape[0]):
        column = drop_column(problem, j)
        at = min(p[column] * TIME_SCALE, cutoff)
        count = add_break(Break(DROP, j, column, at), count, times, breaks)
    for k in range(scratch.counts[LATER_PEAKS]):
        if scratch.peaks[k] < cutoff:
            count = add_break(Break(PROBE, k, FIXED, scratch.peaks[k]), count, times, breaks)
    count = add_break(Break(CUTOFF, 0, last, cutoff), count, times, breaks)
    sort_breaks(count, times, breaks)
    for k in range(problem.tail.shape[0]):
        at = cutoff + problem.tail[k, P_TIME]
        count = add_break(Break(TAIL, k, last, at), count, times, breaks)
    count_steps(count, problem.longest_step, times, breaks)
    scratch.counts[BREAKS] = count


@kernel
def break_at(b: int, p: Array, tail: Array, times: Array, breaks: Index) -> Break:
    """Return a break at its time by ``p``, whose order may be that of another ``p``."""
    kind, number, column = breaks[b, 0], breaks[b, 1], breaks[b, 2]
    time = times[b]
    if column != FIXED:
        time = p[column] * TIME_SCALE
    if kind == TAIL:
        time += tail[number, P_TIME]
    return Break(kind, number, column, time)
