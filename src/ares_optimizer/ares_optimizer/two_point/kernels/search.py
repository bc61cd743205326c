# SPDX-License-Identifier: Apache-2.0
"""Search the optimum from a guess or from built-in guesses; check that a root is sound."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    HEATING_LIMIT,
    MAX_JETTISONS,
    MISSION_TIME,
    TARGET_ELEMENTS,
    TIME_AFTER_IGNITION,
    MissionRecords,
    Record,
)
from ares_models.jit import allocating, inlined, kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.sequence import awaits_heating
from ares_models.kernels.targets import two_planes
from ares_models.kernels.vectors import dot, load, norm
from ares_optimizer.kernels.elements import APSIS, ENERGY, has_row
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    MAX_FREE,
    free_count,
    heating_count,
    heating_index,
    segment_mass,
    segment_thrust,
)
from ares_optimizer.plan import DEEPEST
from ares_optimizer.two_point.arrays import (
    AT_ONCE,
    AT_SHORTEST,
    HELD,
    NOT_HELD,
    Effort,
)
from ares_optimizer.two_point.kernels.gravity import field_of, gravity_terms
from ares_optimizer.two_point.kernels.guess import OwnStart, guess_two_point
from ares_optimizer.two_point.kernels.held_burns import along_thrust
from ares_optimizer.two_point.kernels.newton import (
    AT_BOUND,
    AT_FLOOR,
    CONVERGED,
    STALLED,
    STOPPED,
    UNSOUND,
    find_floors,
    solve_two_point,
)
from ares_optimizer.two_point.kernels.shooting import (
    begin_flight,
    fly_segment,
    search_is_over,
    shoot,
    step_count,
    unknown_count,
    which_jettison,
)

#: Built-in guesses, tried in this order.
_OWN_STARTS = (
    OwnStart(6, 100.0, 1.0),
    OwnStart(1, 100.0, 1.0),
    OwnStart(2, 60.0, 1.0),
    OwnStart(12, 150.0, 1.0),
    OwnStart(6, 100.0, -1.0),
    OwnStart(3, 30.0, 1.0),
    OwnStart(1, 60.0, -1.0),
)
_ROUNDING = 1e-6  # of pi, for a drop without mass
_SCAN = 5.0  # s, sampling of the heating
_MOST_SCANS = 2000
_BOUND_CHANGES = 4  # most activations and releases of a bound, per arc
_WORTHLESS = 1e-9  # kg/s of propellant, below which a bound is not released
_NEARLY_ROUND = 0.02  # eccentricity


@kernel
def fly_to(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    time: float,
    work: Record,
) -> None:
    """Fly the unknowns up to ``time``, s; ``work.state`` holds the state at that time.

    No costate jumps are applied: valid before the first heating jettison.
    """
    gravity = begin_flight(start, mission, options, unknowns, work)
    work.columns = 0
    for i in range(work.segment_count):
        segment = work.segments[i]
        end = segment.end
        if end < time:
            steps = step_count(segment, options.step)
            work.spent += steps
            fly_segment(segment, steps, gravity, options, work)
            continue
        segment.end = max(segment.start, time)
        if segment.end > segment.start:
            fly_segment(segment, step_count(segment, options.step), gravity, options, work)
        segment.end = end
        return


@kernel
def _log_heating_now(mission: MissionRecords, work: Record) -> float:
    """Return the log of the heating, W/m2, at ``work.state``."""
    s = work.state
    rate, _, _ = log_heating_gradient(
        (s[0], s[1], s[2]), (s[3], s[4], s[5]), mission.environment, mission.atmosphere
    )
    return rate


@kernel
def final_hamiltonian(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> float:
    """Return lambda_r . V + lambda_v . (g + u T/m) at cut-off, m/s2; nan on failure.

    u is the thrust direction. The value is the gain per second of burn, positive at an optimum.
    """
    shoot(start, mission, options, unknowns, work)
    # shoot fails without the condition of a drop that comes at once, but the flight is complete
    if work.segment_count == 0:
        return math.nan
    s = work.state
    last = work.segment_count - 1
    while work.segments[last].after_cutoff == 1:
        last -= 1
    segment = work.segments[last]
    r = (s[0], s[1], s[2])
    v = (s[3], s[4], s[5])
    p = (s[6], s[7], s[8])
    q = (s[9], s[10], s[11])
    g, _ = gravity_terms(r, field_of(mission.environment), p)
    thrust = segment_thrust(segment, segment.end)
    size, _ = along_thrust(segment, p, work)
    return -dot(q, v) + dot(p, g) + size * thrust / segment_mass(segment, segment.end)


@kernel
def _perigee_is_cheapest(target: Record, work: Record) -> bool:
    """Return true if the perigee of a nearly circular target is where it costs least.

    At a fixed small eccentricity two perigees are stationary, the cheapest and the dearest. The
    sign of the multiplier of the eccentricity tells them apart.
    """
    if target.kind != TARGET_ELEMENTS or not target.eccentricity < _NEARLY_ROUND:
        return True
    if not has_row(ENERGY, target) or not has_row(APSIS, target):
        return True
    row = 0
    for other in range(APSIS):
        if has_row(other, target):
            row += 1
    return work.terminal_frame.multipliers[row] > 0.0


@kernel
def _sound(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """Return true if a root can be flown and is no false extremum.

    It stays above ground, a longer burn gains, and no heating jettison would gain by waiting.
    """
    value = final_hamiltonian(start, mission, options, unknowns, work)
    ground = min(mission.environment.polar_radius, norm(load(start.position)))
    if work.planned == 1:
        value = work.price
        ground *= 1.0 - DEEPEST
    if not value > 0.0 or work.lowest < ground or not _perigee_is_cheapest(mission.target, work):
        return False
    for i in range(work.segment_count):
        # the interior condition lacks the change of flow at a drop from a throttled burn
        if work.segments[i].end_heating >= 0 and work.segments[i].fading > 0.0:
            return False
    if options.heating == HEATING_OPTIMAL:
        for i in range((work.first_free - COLUMN_JETTISON) // 2):
            # at an optimum an earlier drop gains: only the limit makes it wait
            if unknowns[COLUMN_JETTISON + 2 * i + 1] > _ROUNDING:
                return False
            if work.pinned[i] == 1 and work.waiting_pays[i] == 1:
                return False
    return True


@kernel
def _column_of(start: Record, mission: MissionRecords, jettison: int) -> int:
    """Return the column of the time of a heating jettison."""
    return COLUMN_JETTISON + 2 * heating_index(start, mission.jettisons, jettison)


@kernel
def _remove_unknown(n: int, index: int, unknowns: NDArray[np.float64], work: Record) -> None:
    """Remove a heating unknown from the unknowns."""
    for i in range(COLUMN_JETTISON + 2 * index, n - 2):
        unknowns[i] = unknowns[i + 2]
    for i in range(index, MAX_JETTISONS - 1):
        work.pinned[i] = work.pinned[i + 1]


@kernel
def _insert_unknown(
    n: int, index: int, time: float, unknowns: NDArray[np.float64], work: Record
) -> None:
    """Insert a heating unknown, not pinned; ``n`` is the count without it."""
    column = COLUMN_JETTISON + 2 * index
    for i in range(n - 1, column - 1, -1):
        unknowns[i + 2] = unknowns[i]
    for i in range(MAX_JETTISONS - 1, index, -1):
        work.pinned[i] = work.pinned[i - 1]
    unknowns[column] = time
    unknowns[column + 1] = 0.0
    work.pinned[index] = 0


@inlined
def as_flown(mission: MissionRecords, work: Record) -> MissionRecords:
    """Return the mission with the jettisons of ``work``: inactive limits are times."""
    return MissionRecords(
        mission.environment,
        mission.atmosphere,
        mission.arcs,
        work.jettisons[: mission.jettisons.shape[0]],
        mission.target,
    )


@kernel
def _hold_passed_limit(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """Pin a drop whose removed limit is exceeded; return true if there is one."""
    flown = as_flown(mission, work)
    for j in range(mission.jettisons.shape[0]):
        limit = mission.jettisons[j]
        if limit.criterion != HEATING_LIMIT or flown.jettisons[j].criterion == HEATING_LIMIT:
            continue
        find_floors(start, mission, work)
        earliest = work.floor[_column_of(start, mission, j)]
        fly_to(start, flown, options, unknowns, earliest, work)
        if _log_heating_now(mission, work) > math.log(limit.value) + 1e-9:
            n = unknown_count(start, flown, options)
            work.jettisons[j] = limit
            index = heating_index(start, flown.jettisons, j)
            _insert_unknown(n, index, earliest + AT_ONCE, unknowns, work)
            work.pinned[index] = 1
            return True
    return False


@kernel
def _release_bounds(start: Record, mission: MissionRecords, work: Record) -> bool:
    """Release free arcs from bounds that cost propellant; return true if there are any."""
    found = False
    for f in range(free_count(start, mission.arcs)):
        switch = work.switches[f]
        if switch.hold == NOT_HELD or switch.hold == HELD:
            continue
        longer = 1.0 if switch.hold == AT_SHORTEST else -1.0
        if longer * switch.worth > _WORTHLESS * abs(work.price):
            switch.hold = NOT_HELD
            found = True
    return found


@kernel
def _solve_with_floors(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int]:
    """Solve by Newton's method with an active set of drops and arc bounds.

    A drop that reaches its earliest time is made at that time, without its limit. If the heating
    then exceeds the limit, the limit returns and the drop is pinned at its earliest time. A free
    arc that reaches a bound of its length is held there while the switching function points
    outwards.
    """
    count = mission.jettisons.shape[0]
    flown = as_flown(mission, work)
    total = 0
    residual = math.inf
    status = STALLED
    changes = 2 * count + 1 + _BOUND_CHANGES * free_count(start, mission.arcs)
    for _ in range(changes):
        iterations, residual, status = solve_two_point(start, flown, options, unknowns, work)
        total += iterations
        if status == AT_FLOOR:
            n = unknown_count(start, flown, options)
            j = which_jettison(start, flown, work.stuck)
            _remove_unknown(n, work.stuck, unknowns, work)
            work.jettisons[j].criterion = TIME_AFTER_IGNITION
            work.jettisons[j].value = 0.0
            continue
        if status == AT_BOUND:
            work.switches[work.stuck_arc].hold = work.stuck_hold
            continue
        if status != CONVERGED:
            return total, residual, status
        if _release_bounds(start, mission, work):
            status = STALLED
            continue
        if not _hold_passed_limit(start, mission, options, unknowns, work):
            break
    if status != CONVERGED:
        return total, residual, status
    if not _sound(start, flown, options, unknowns, work):
        return total, residual, UNSOUND
    find_floors(start, mission, work)
    for j in range(count):
        left_out = flown.jettisons[j].criterion != HEATING_LIMIT
        if mission.jettisons[j].criterion == HEATING_LIMIT and left_out:
            n = unknown_count(start, flown, options)
            earliest = work.floor[_column_of(start, mission, j)]
            work.jettisons[j].criterion = HEATING_LIMIT
            index = heating_index(start, flown.jettisons, j)
            _insert_unknown(n, index, earliest, unknowns, work)
    return total, residual, CONVERGED


@kernel
def _crossing(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    earliest: float,
    limit: float,
    work: Record,
) -> float:
    """Return the first time, s, with heating at or below ``limit``; inf: not before cut-off."""
    time = earliest
    before = 0.0
    goal = math.log(limit)
    for _ in range(_MOST_SCANS):
        if not time < unknowns[COLUMN_CUTOFF] or search_is_over(options, work):
            break
        fly_to(start, mission, options, unknowns, time, work)
        rate = _log_heating_now(mission, work) - goal
        if rate <= 0.0:
            if time == earliest:
                return time
            return time - _SCAN * rate / (rate - before)
        before = rate
        time += _SCAN
    return math.inf


@kernel
def _reset(jettisons: NDArray[Any], work: Record) -> None:
    """Reset the jettisons to those of the mission, none pinned."""
    for j in range(jettisons.shape[0]):
        work.jettisons[j] = jettisons[j]
    for i in range(MAX_JETTISONS):
        work.pinned[i] = 0


@kernel
def _release_all(work: Record) -> None:
    """Release free arcs that an earlier search held at a bound."""
    for f in range(MAX_FREE + 1):
        if work.switches[f].hold != HELD:
            work.switches[f].hold = NOT_HELD


@kernel
def _solve_timed_first(
    start: Record,
    mission: MissionRecords,
    options: Record,
    own: OwnStart,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int]:
    """Solve with drops at fixed times first; its limit crossings are the guess."""
    flown = as_flown(mission, work)
    find_floors(start, mission, work)
    for j in range(mission.jettisons.shape[0]):
        if awaits_heating(mission.jettisons, start.jettisoned, j):
            earliest = work.floor[_column_of(start, mission, j)]
            work.jettisons[j].criterion = MISSION_TIME
            work.jettisons[j].value = earliest + own.wait
    guess_two_point(start, flown, options, OwnStart(own.rounds, 0.0, own.branch), unknowns, work)
    total, residual, status = solve_two_point(start, flown, options, unknowns, work)
    if status != CONVERGED:
        return total, residual, status
    find_floors(start, mission, work)
    count = 0
    # kept apart from the unknowns: the flight has no heating unknowns yet
    times = work.correction[:]
    for j in range(mission.jettisons.shape[0]):
        if awaits_heating(mission.jettisons, start.jettisoned, j):
            limit = mission.jettisons[j].value
            earliest = work.floor[_column_of(start, mission, j)]
            time = _crossing(start, flown, options, unknowns, earliest, limit, work)
            times[count] = min(time, unknowns[COLUMN_CUTOFF] - 1.0)
            count += 1
    n = unknown_count(start, flown, options)
    for i in range(count):
        _insert_unknown(n + 2 * i, i, times[i], unknowns, work)
    _reset(mission.jettisons, work)
    iterations, residual, status = _solve_with_floors(start, mission, options, unknowns, work)
    return total + iterations, residual, status


class _SearchResult(NamedTuple):
    """Hold the outcome of a search.

    Attributes:
        iterations: total.
        residual: norm of the residuals of the best start.
        status: of the best start.
        starts: number of starts tried.
    """

    iterations: int
    residual: float
    status: int
    starts: int


@allocating
def _search_from_guesses(
    start: Record,
    mission: MissionRecords,
    options: Record,
    effort: Effort,
    unknowns: NDArray[np.float64],
    work: Record,
) -> _SearchResult:
    """Search from the guess and from the built-in guesses in turn.

    Arguments: see :func:`find_optimum`. The best root is left in ``unknowns``.
    """
    best = unknowns.copy()
    best_residual = math.inf
    best_status = STALLED
    total = 0
    starts = 0
    last = len(_OWN_STARTS) if effort.restart or not effort.guessed else 0
    if effort.first // len(_OWN_STARTS) % 2 == 1:
        # all of these failed before: continue with the drops at fixed times
        last = 0
    one_plane = not two_planes(mission.target)
    solved_near = False
    solved_far = False
    for attempt in range(-1 if effort.guessed else 0, last):
        if search_is_over(options, work):
            if best_status != CONVERGED:
                best_status = STOPPED
            break
        own = _OWN_STARTS[(effort.first + max(0, attempt)) % len(_OWN_STARTS)]
        near = attempt < 0 or own.branch > 0.0
        if attempt >= 0 and (solved_near if near else solved_far):
            continue
        _reset(mission.jettisons, work)
        if attempt >= 0:
            _release_all(work)
        starts += 1
        if attempt >= 0 and not guess_two_point(start, mission, options, own, unknowns, work):
            continue
        iterations, residual, status = _solve_with_floors(start, mission, options, unknowns, work)
        total += iterations
        if status == CONVERGED:
            if not effort.thorough:
                return _SearchResult(total, residual, status, starts)
            if attempt >= 0:
                solved_near = solved_near or near or one_plane
                solved_far = solved_far or not near or one_plane
            better = best_status != CONVERGED or unknowns[COLUMN_CUTOFF] < best[COLUMN_CUTOFF]
        else:
            better = best_status != CONVERGED and residual < best_residual
        if better:
            best_residual = residual
            best_status = status
            best[:] = unknowns
    unknowns[:] = best
    return _SearchResult(total, best_residual, best_status, starts)


@allocating
def find_optimum(
    start: Record,
    mission: MissionRecords,
    options: Record,
    effort: Effort,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int, int]:
    """Find the optimum, from the guess in ``unknowns`` or from the start alone.

    The built-in guesses are tried in turn. When all fail, the flight with its drops at fixed times
    is solved first, and the time at which it reaches the limit is the next guess.

    Args:
        start: record NAVIGATION, see :func:`newton.solve_two_point`.
        mission: its records.
        options: record OPTIONS.
        effort: extent of the search.
        unknowns: shape (MAX_UNKNOWNS,), see :func:`shooting.shoot`, updated. A limit that is
            inactive at the earliest possible drop returns with that time and pi = 0.
        work: record WORK.

    Returns:
        iterations, norm of the residuals, status (see ``newton``), number of starts after the
        first. After a failure ``unknowns`` holds the start with the smallest residuals.
    """
    work.spent = 0
    result = _search_from_guesses(start, mission, options, effort, unknowns, work)
    total = result.iterations
    status = result.status
    starts = result.starts
    last = len(_OWN_STARTS) if effort.restart or not effort.guessed else 0
    if status == CONVERGED or heating_count(start, mission.jettisons, options.heating) == 0:
        last = 0
    best = unknowns.copy()
    for attempt in range(last):
        if search_is_over(options, work):
            status = STOPPED
            break
        _reset(mission.jettisons, work)
        if attempt >= 0:
            _release_all(work)
        starts += 1
        own = _OWN_STARTS[(effort.first + attempt) % len(_OWN_STARTS)]
        iterations, residual, ended = _solve_timed_first(
            start, mission, options, own, unknowns, work
        )
        total += iterations
        if ended == CONVERGED:
            return total, residual, ended, starts - 1
    # the start with the smallest residuals
    unknowns[:] = best
    return total, result.residual, status, starts - 1
