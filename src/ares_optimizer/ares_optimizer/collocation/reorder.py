# SPDX-License-Identifier: Apache-2.0
"""Move events of a solution past others that they coincide with."""

from collections.abc import Iterator

from ares_models.arrays import BURN
from ares_optimizer.collocation.arrays import COASTING
from ares_optimizer.collocation.points import Array, FoundOptimum, times_of
from ares_optimizer.collocation.transcription import CollocationProgram, FreeTimes
from ares_optimizer.plan import free_arcs
from ares_optimizer.results import SAME_LENGTH

#: Time by which an event is moved past another, s.
_MOVES_S = (1.0, 0.1)


def moved_events(found: FoundOptimum) -> Iterator[FreeTimes]:
    """Yield times with an event moved past another that it coincides with."""
    program, x = found.program, found.point.x
    lengths = x[program.lengths] * program.time
    for move in _MOVES_S:
        for phases in program.arc_phases.values():
            for p in phases:
                if len(phases) > 1 and lengths[p] <= SAME_LENGTH:
                    times = _moved_times(program, x, phases, p, move)
                    if times is not None:
                        yield times


def _moved_times(
    program: CollocationProgram, x: Array, phases: list[int], p: int, move: float
) -> FreeTimes | None:
    """Return the times with the event at a vanished phase moved out of its arc.

    Args:
        program: the program.
        x: its solution.
        phases: of the arc.
        p: the vanished phase.
        move: time by which to move, s.
    """
    times = times_of(program, x)
    drops = times.drops.copy()
    lengths = program.time * x[program.lengths]
    burning = program.steering != COASTING
    stages = program.arrays.arcs["stage"][program.segments["arc"]]
    for number, at in program.drop_ends.items():
        own = program.arrays.jettisons[program.waiting_for_heating[number]]["stage"]
        # in a coast nothing is gained: on to the burn before or after it
        if at == p:
            before = max((q for q in range(p) if burning[q] and stages[q] >= own), default=None)
            if before is not None:
                drops[number] -= move + lengths[before + 1 : p].sum()
        if at == p - 1 and p + 1 < len(lengths):
            after = min((q for q in range(p + 1, len(lengths)) if burning[q]), default=p + 1)
            drops[number] += move + lengths[p + 1 : after].sum()
    if (drops != times.drops).any():
        return times._replace(drops=drops)
    # limit of a throttle: end the burn before it, or the burn before later
    k = int(program.segments[p]["arc"])
    burn, step = (k, -move) if p == phases[-1] else (_burn_before(program, k), move)
    free = free_arcs(program.arrays, program.start[0])
    last = program.arrays.arcs[-1]
    fixed = not last["shortest"] < last["longest"]
    if burn == len(program.arrays.arcs) - 1 and not fixed:
        return times._replace(cutoff=times.cutoff + step)
    if burn not in free:
        return None
    moved = times.lengths.copy()
    moved[free.index(burn)] += step
    return times._replace(lengths=moved, cutoff=times.cutoff + step * fixed)


def _burn_before(program: CollocationProgram, k: int) -> int:
    """Return the burn before an arc; -1: none."""
    burns = [b for b in program.arc_phases if b < k and program.arrays.arcs[b]["kind"] == BURN]
    return max(burns, default=-1)
