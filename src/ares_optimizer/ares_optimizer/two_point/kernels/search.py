"""The optimum from a guess or from nothing: restarts, limits that do not bind, soundness."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    HEATING_LIMIT,
    MAX_JETTISONS,
    MISSION_TIME,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TIME_AFTER_IGNITION,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.vectors import dot, load, norm
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    build_timetable,
    heating_count,
)
from ares_optimizer.two_point.arrays import AT_ONCE
from ares_optimizer.two_point.kernels.guess import guess_two_point
from ares_optimizer.two_point.kernels.newton import (
    AT_FLOOR,
    BAD_TIMETABLE,
    CONVERGED,
    STALLED,
    STOPPED,
    UNSOUND,
    find_floors,
    solve_two_point,
)
from ares_optimizer.two_point.kernels.shooting import (
    begin_state,
    fly_segment,
    gravity_terms,
    search_is_over,
    shoot,
    unknown_count,
)

#: Rounds of the guess, s until a heating jettison, plane: tried in this order.
_STARTS = np.array(
    [
        [6.0, 100.0, 1.0],
        [1.0, 100.0, 1.0],
        [2.0, 60.0, 1.0],
        [12.0, 150.0, 1.0],
        [6.0, 100.0, -1.0],
        [3.0, 30.0, 1.0],
        [1.0, 60.0, -1.0],
    ]
)
_ROUNDING = 1e-6  # of pi, where a drop weighs nothing
_SCAN = 5.0  # s, between looks at the heating
_MOST_SCANS = 2000


@kernel
def fly_to(
    start: Record,
    environment: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    options: Record,
    unknowns: NDArray[np.float64],
    time: float,
    work: Record,
) -> int:
    """Fly the unknowns up to ``time``; ``work.state`` holds the state there.

    No costate jump is made on the way: meant for times before the first heating jettison.

    Returns:
        index of the segment that ``time`` falls in; -1 if there is none.
    """
    n = unknown_count(start, jettisons, options)
    for i in range((n - COLUMN_JETTISON) // 2):
        work.heating_times[i] = unknowns[COLUMN_JETTISON + 2 * i]
    count = build_timetable(
        start,
        arcs,
        jettisons,
        options.heating,
        work.heating_times,
        unknowns[COLUMN_CUTOFF],
        work.segments,
    )
    omega_square = begin_state(start, environment.mu, options, unknowns, work)
    for i in range(count):
        segment = work.segments[i]
        end = segment.end
        if end < time:
            steps = max(1, int(math.ceil((end - segment.start) / options.step - 1e-9)))
            work.spent += steps
            fly_segment(segment, steps, environment.mu, omega_square, options, 0, work)
            continue
        segment.end = max(segment.start, time)
        steps = max(1, int(math.ceil((segment.end - segment.start) / options.step - 1e-9)))
        if segment.end > segment.start:
            fly_segment(segment, steps, environment.mu, omega_square, options, 0, work)
        segment.end = end
        return i
    return -1


@kernel
def _log_heating_now(environment: Record, atmosphere: NDArray[np.float64], work: Record) -> float:
    """Log of heating at ``work.state``, W/m2."""
    s = work.state
    rate, _, _ = log_heating_gradient(
        (s[0], s[1], s[2]), (s[3], s[4], s[5]), environment, atmosphere
    )
    return rate


@kernel
def final_hamiltonian(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> float:
    """lambda_r . V + lambda_v . g + |lambda_v| T/m at cut-off, m/s2; nan if not flown.

    It is what a second of burning is worth; on an optimum it is positive.
    """
    # a variable, for the sake of one compiled flight
    tangents = jettisons.shape[0] < 0
    shoot(
        start,
        environment,
        atmosphere,
        arcs,
        jettisons,
        target,
        options,
        unknowns,
        tangents,
        work,
    )
    # a drop that comes at once has no condition to meet, but it is flown
    if work.segment_count == 0:
        return math.nan
    s = work.state
    last = work.segment_count - 1
    while work.segments[last].after_cutoff == 1:
        last -= 1
    segment = work.segments[last]
    length = segment.end - segment.start
    thrust = segment.thrust + segment.thrust_slope * length
    mass = segment.mass - length * (segment.flow + 0.5 * length * segment.flow_slope)
    r = (s[0], s[1], s[2])
    v = (s[3], s[4], s[5])
    p = (s[6], s[7], s[8])
    q = (s[9], s[10], s[11])
    gravity, _ = gravity_terms(r, environment.mu, 0.0, 0, p)
    return -dot(q, v) + dot(p, gravity) + norm(p) * thrust / mass


@kernel
def _sound(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """Whether a root is a flight: above ground, burning worth its time, drops worth theirs."""
    value = final_hamiltonian(
        start, environment, atmosphere, arcs, jettisons, target, options, unknowns, work
    )
    ground = min(environment.polar_radius, norm(load(start.position)))
    if not value > 0.0 or work.lowest < ground:
        return False
    if options.heating == HEATING_OPTIMAL:
        n = unknown_count(start, jettisons, options)
        for i in range((n - COLUMN_JETTISON) // 2):
            # a drop must wait for the limit because it would rather come sooner
            if unknowns[COLUMN_JETTISON + 2 * i + 1] > _ROUNDING:
                return False
            if work.pinned[i] == 1 and work.waiting_pays[i] == 1:
                return False
    return True


@kernel
def _which_jettison(start: Record, jettisons: NDArray[Any], index: int) -> int:
    """Jettison that the heating unknown ``index`` belongs to."""
    unknown = 0
    for j in range(jettisons.shape[0]):
        if jettisons[j].criterion == HEATING_LIMIT and (start.jettisoned >> j) & 1 == 0:
            if unknown == index:
                return j
            unknown += 1
    return -1


@kernel
def _heating_index(start: Record, jettisons: NDArray[Any], jettison: int) -> int:
    """Heating unknown of a jettison: how many unknown ones stand before it."""
    index = 0
    for i in range(jettison):
        if jettisons[i].criterion == HEATING_LIMIT and (start.jettisoned >> i) & 1 == 0:
            index += 1
    return index


@kernel
def _take_out(n: int, index: int, unknowns: NDArray[np.float64], work: Record) -> None:
    """Close the gap that a heating unknown leaves."""
    for i in range(COLUMN_JETTISON + 2 * index, n - 2):
        unknowns[i] = unknowns[i + 2]
    for i in range(index, MAX_JETTISONS - 1):
        work.pinned[i] = work.pinned[i + 1]


@kernel
def _put_in(
    n: int, index: int, time: float, pinned: int, unknowns: NDArray[np.float64], work: Record
) -> None:
    """Make room for a heating unknown; ``n`` counts the unknowns without it."""
    column = COLUMN_JETTISON + 2 * index
    for i in range(n - 1, column - 1, -1):
        unknowns[i + 2] = unknowns[i]
    for i in range(MAX_JETTISONS - 1, index, -1):
        work.pinned[i] = work.pinned[i - 1]
    unknowns[column] = time
    unknowns[column + 1] = 0.0
    work.pinned[index] = pinned


@kernel
def _solve_with_floors(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int]:
    """Newton, and what to do when a limit is met as soon as its drop is possible.

    The drop is then made at once, without the limit; if the limit turns out to be passed
    there, it is kept with the drop held at its earliest time.
    """
    count = jettisons.shape[0]
    flown = work.jettisons[:count]
    total = 0
    residual = math.inf
    status = STALLED
    for _ in range(2 * count + 1):
        iterations, residual, status = solve_two_point(
            start, environment, atmosphere, arcs, flown, target, options, unknowns, work
        )
        total += iterations
        n = unknown_count(start, flown, options)
        if status == AT_FLOOR:
            j = _which_jettison(start, flown, work.stuck)
            _take_out(n, work.stuck, unknowns, work)
            flown[j].criterion = TIME_AFTER_IGNITION
            flown[j].value = 0.0
            continue
        if status != CONVERGED:
            return total, residual, status
        passed = -1
        for j in range(count):
            if jettisons[j].criterion != HEATING_LIMIT or flown[j].criterion == HEATING_LIMIT:
                continue
            find_floors(start, arcs, jettisons, work)
            column = COLUMN_JETTISON + 2 * _heating_index(start, jettisons, j)
            earliest = work.floor[column]
            fly_to(start, environment, arcs, flown, options, unknowns, earliest, work)
            rate = _log_heating_now(environment, atmosphere, work)
            if rate > math.log(jettisons[j].value) + 1e-9:
                passed = j
                flown[j] = jettisons[j]
                index = _heating_index(start, flown, j)
                _put_in(n, index, earliest + AT_ONCE, 1, unknowns, work)
                break
        if passed < 0:
            break
    if status != CONVERGED:
        return total, residual, status
    if not _sound(start, environment, atmosphere, arcs, flown, target, options, unknowns, work):
        return total, residual, UNSOUND
    find_floors(start, arcs, jettisons, work)
    for j in range(count):
        if jettisons[j].criterion == HEATING_LIMIT and flown[j].criterion != HEATING_LIMIT:
            n = unknown_count(start, flown, options)
            earliest = work.floor[COLUMN_JETTISON + 2 * _heating_index(start, jettisons, j)]
            flown[j].criterion = HEATING_LIMIT
            _put_in(n, _heating_index(start, flown, j), earliest, 0, unknowns, work)
    return total, residual, CONVERGED


@kernel
def _crossing(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    options: Record,
    unknowns: NDArray[np.float64],
    earliest: float,
    limit: float,
    work: Record,
) -> float:
    """First time at which heating is at or below ``limit``; inf if not before cut-off."""
    time = earliest
    before = 0.0
    goal = math.log(limit)
    for _ in range(_MOST_SCANS):
        if not time < unknowns[COLUMN_CUTOFF] or search_is_over(options, work):
            break
        fly_to(start, environment, arcs, jettisons, options, unknowns, time, work)
        rate = _log_heating_now(environment, atmosphere, work) - goal
        if rate <= 0.0:
            if time == earliest:
                return time
            return time - _SCAN * rate / (rate - before)
        before = rate
        time += _SCAN
    return math.inf


@kernel
def _reset(jettisons: NDArray[Any], work: Record) -> None:
    """Jettisons as the mission has them, none held."""
    for j in range(jettisons.shape[0]):
        work.jettisons[j] = jettisons[j]
    for i in range(MAX_JETTISONS):
        work.pinned[i] = 0


@kernel
def _solve_timed_first(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    attempt: int,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int]:
    """Solve with the drops at fixed times; where that flight meets the limits is the guess."""
    count = jettisons.shape[0]
    flown = work.jettisons[:count]
    find_floors(start, arcs, jettisons, work)
    for j in range(count):
        if jettisons[j].criterion == HEATING_LIMIT and (start.jettisoned >> j) & 1 == 0:
            column = COLUMN_JETTISON + 2 * _heating_index(start, jettisons, j)
            flown[j].criterion = MISSION_TIME
            flown[j].value = work.floor[column] + _STARTS[attempt, 1]
    guess_two_point(
        start,
        environment,
        arcs,
        flown,
        target,
        options,
        int(_STARTS[attempt, 0]),
        0.0,
        _STARTS[attempt, 2],
        unknowns,
        work,
    )
    total, residual, status = solve_two_point(
        start, environment, atmosphere, arcs, flown, target, options, unknowns, work
    )
    if status != CONVERGED:
        return total, residual, status
    find_floors(start, arcs, jettisons, work)
    for j in range(count):
        if jettisons[j].criterion == HEATING_LIMIT and (start.jettisoned >> j) & 1 == 0:
            column = COLUMN_JETTISON + 2 * _heating_index(start, jettisons, j)
            time = _crossing(
                start,
                environment,
                atmosphere,
                arcs,
                flown,
                options,
                unknowns,
                work.floor[column],
                jettisons[j].value,
                work,
            )
            unknowns[column] = min(time, unknowns[COLUMN_CUTOFF] - 1.0)
            unknowns[column + 1] = 0.0
    _reset(jettisons, work)
    iterations, residual, status = _solve_with_floors(
        start, environment, atmosphere, arcs, jettisons, target, options, unknowns, work
    )
    return total + iterations, residual, status


@kernel
def find_optimum(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    guessed: bool,
    restart: bool,
    thorough: bool,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int, int]:
    """The optimum, from the guess in ``unknowns`` if there is one, else from nothing.

    Own guesses are tried in turn. When none leads there, the flight with its drops at fixed
    times is solved first, and the time at which it meets the limit is the next guess.

    Args:
        start: record NAVIGATION, see :func:`newton.solve_two_point`.
        environment: record ENVIRONMENT.
        atmosphere: log-density table.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        target: record TARGET.
        options: record OPTIONS.
        guessed: ``unknowns`` hold a guess; it is tried first.
        restart: go on with own guesses when the guess leads nowhere.
        thorough: seek one root from the guess, one from own guesses and, with a free node, one
            in the other plane, and take that which cuts off first; else take the first root.
        unknowns: shape (MAX_UNKNOWNS,), see :func:`two_point.shoot`. A limit that is met
            from the earliest possible drop on comes back with that time and pi = 0.
        work: record WORK.

    Returns:
        iterations, norm of the residuals, status (newton.CONVERGED or why not), number of
        starts after the first. A failure leaves the start that came nearest in ``unknowns``.
    """
    best = unknowns.copy()
    best_residual = math.inf
    best_status = STALLED
    found = False
    total = 0
    residual = math.inf
    status = STALLED
    starts = 0
    last = _STARTS.shape[0] if restart or not guessed else 0
    one_plane = target.kind != TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    solved_near = False
    solved_far = False
    work.spent = 0
    for attempt in range(-1 if guessed else 0, last):
        if search_is_over(options, work):
            best_status = STOPPED
            break
        near = attempt < 0 or _STARTS[attempt, 2] > 0.0
        if attempt >= 0 and (solved_near if near else solved_far):
            continue
        _reset(jettisons, work)
        starts += 1
        if attempt >= 0 and not guess_two_point(
            start,
            environment,
            arcs,
            jettisons,
            target,
            options,
            int(_STARTS[attempt, 0]),
            _STARTS[attempt, 1],
            _STARTS[attempt, 2],
            unknowns,
            work,
        ):
            status = BAD_TIMETABLE
            continue
        iterations, residual, status = _solve_with_floors(
            start, environment, atmosphere, arcs, jettisons, target, options, unknowns, work
        )
        total += iterations
        if status == CONVERGED:
            if not thorough:
                return total, residual, status, starts - 1
            if attempt >= 0:
                solved_near = solved_near or near or one_plane
                solved_far = solved_far or not near or one_plane
            better = not found or unknowns[COLUMN_CUTOFF] < best[COLUMN_CUTOFF]
            found = True
        else:
            better = not found and residual < best_residual
        if better:
            best_residual = residual
            best_status = status
            for i in range(unknowns.shape[0]):
                best[i] = unknowns[i]
    if found:
        for i in range(unknowns.shape[0]):
            unknowns[i] = best[i]
        return total, best_residual, CONVERGED, starts - 1
    if heating_count(start, jettisons, options.heating) == 0:
        last = 0
    for attempt in range(last):
        if search_is_over(options, work):
            best_status = STOPPED
            break
        _reset(jettisons, work)
        starts += 1
        iterations, residual, status = _solve_timed_first(
            start,
            environment,
            atmosphere,
            arcs,
            jettisons,
            target,
            options,
            attempt,
            unknowns,
            work,
        )
        total += iterations
        if status == CONVERGED:
            return total, residual, status, starts - 1
    # the nearest miss
    for i in range(unknowns.shape[0]):
        unknowns[i] = best[i]
    return total, best_residual, best_status, starts - 1
