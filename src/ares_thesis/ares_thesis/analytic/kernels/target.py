# SPDX-License-Identifier: Apache-2.0
"""Find the jettison target from the mission alone.

For each time from staging to the jettison there is one flight, both parts in closed form, with a
continuous thrust direction and the heating limit met at the jettison, and the target met at
cut-off. The state at the jettison of the flight with the earliest cut-off is the target of part
one.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import allocating, kernel
from ares_models.kernels.environment import heating_rate
from ares_models.kernels.linear import back_substitute, factor
from ares_thesis.analytic.arrays import LOCAL, MAX_NODES, POWERS
from ares_thesis.analytic.kernels.burn import (
    angle_of,
    polynomial,
    project,
    through_nodes,
    thrust_direction,
)
from ares_thesis.analytic.kernels.iteration import guess_angles, iterate
from ares_thesis.analytic.kernels.plane import Plane, place

Array = NDArray[np.float64]

#: Status of the search: jettison during the burn; jettison at ignition of the stage, already within
#: the limit; no flight to the target; no flight within the limit.
ON_THE_WAY = 0
AT_ONCE = 1
NO_FLIGHT = 2
TOO_HOT = 3

_UNKNOWNS = 4  # theta at the start, at the jettison, at cut-off; time from jettison to cut-off
_SHIFT = 1e-5  # rad, of the finite differences
_TIME_SHIFT = 1e-3  # s
_NEWTON_STEPS = 25
_MET = 1e-9  # scaled
_CONTRACTION = 0.1
_LONGEST_STEP = 0.2  # rad
_SCAN = 32
_BISECTIONS = 30
_MOST_FLIGHTS = 30
_MOST_HALVINGS = 8
_FIRST_STEP = 0.1  # fraction of the time to the jettison
_GREATEST_STEP = 0.3
_TIME_FOUND = 0.02  # s
_TIME_ROUNDING = 1e-6  # s
_BOTH_PARTS = True


class HeatingLimit(NamedTuple):
    """Hold the heating limit and the environment.

    Attributes:
        environment: shape (1,), dtype ENVIRONMENT.
        atmosphere: shape (n, 9).
        plane: of the flight.
        limit: W/m2.
        drop_s: dropped mass over mass flow, s.
    """

    environment: NDArray[Any]
    atmosphere: Array
    plane: Plane
    limit: float
    drop_s: float


class TwoParts(NamedTuple):
    """Hold a flight in two parts.

    Attributes:
        parts: shape (2,), dtype PART.
        before: dtype BURN: burns of part one.
        after: shape (1,), dtype BURN: burn of part two.
        heating: limit and plane.
        moments: shape (POWERS,), work space.
    """

    parts: NDArray[Any]
    before: NDArray[Any]
    after: NDArray[Any]
    heating: HeatingLimit
    moments: Array


@kernel
def log_heating_over_limit(
    radius: float, speed: float, sine: float, range_angle: float, heating: HeatingLimit
) -> float:
    """Return the log of the ratio of free molecular heating to its limit."""
    r, v = place(radius, speed, sine, range_angle, 0.0, heating.plane)
    rate = heating_rate(r, v, heating.environment[0], heating.atmosphere)
    return math.log(rate / heating.limit)


@kernel
def _node_state(burn: Record, x: float, work: Array) -> tuple[float, float, float, float]:
    """Return radius, speed, sin(gamma), range angle by the polynomials through the nodes."""
    n = burn.nodes
    through_nodes(burn.radius, n, work)
    radius = polynomial(work, n, x)
    through_nodes(burn.speed, n, work)
    speed = polynomial(work, n, x)
    through_nodes(burn.sine, n, work)
    sine = polynomial(work, n, x)
    through_nodes(burn.range_angle, n, work)
    return radius, speed, sine, polynomial(work, n, x)


@kernel
def _level(burn: Record, x: float, heating: HeatingLimit, work: Array) -> float:
    radius, speed, sine, range_angle = _node_state(burn, x, work)
    return log_heating_over_limit(radius, speed, sine, range_angle, heating)


@allocating
def first_within_limit(burn: Record, heating: HeatingLimit) -> tuple[float, float]:
    """Find the first point of a burn within the heating limit.

    Returns:
        fraction of the burn, and log of heating over limit at that point; those of the least
        heating if the limit is never met.
    """
    work = np.empty(MAX_NODES)
    least = math.inf
    at = 0.0
    for i in range(_SCAN + 1):
        level = _level(burn, i / _SCAN, heating, work)
        if level < least:
            least = level
            at = i / _SCAN
        if level <= 0.0:
            break
    if least <= 0.0 < at:
        low = at - 1.0 / _SCAN
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + at)
            level = _level(burn, middle, heating, work)
            if level > 0.0:
                low = middle
            else:
                at = middle
                least = level
    return at, least


@kernel
def _fly(flight: TwoParts, x: Array, time: float, changed_before: bool, f: Array) -> bool:
    """Fly both parts for given unknowns; write the errors in heating, radius, speed, gamma."""
    parts, before, after, heating, moments = flight
    first = parts[0]
    second = parts[1]
    last = before[first.burns - 1]
    n = last.nodes
    if changed_before:
        first.theta_start = x[0]
        first.theta_end = x[1]
        first.time_to_go = time
        if not project(first, before, moments):
            return False
        second.radius = last.end_radius
        second.speed = last.speed[n - 1]
        second.gamma = angle_of(last.sine[n - 1])
        second.theta_start = first.theta_end
        if first.steering != LOCAL:
            second.theta_start += last.range_angle[n - 1]
        after[0].tau = last.tau - time - heating.drop_s
    second.theta_end = x[2]
    second.time_to_go = x[3]
    if not (0.0 < x[3] < after[0].tau) or not project(second, after, moments):
        return False
    f[0] = log_heating_over_limit(
        last.end_radius, last.speed[n - 1], last.sine[n - 1], last.range_angle[n - 1], heating
    )
    f[1] = -second.position_error / second.target_radius
    f[2] = -second.speed_error / second.target_speed
    f[3] = -second.gamma_error
    return True


@kernel
def _size(f: Array) -> float:
    return 0.01 * abs(f[0]) + abs(f[1]) + abs(f[2]) + abs(f[3])


@allocating
def _differences(flight: TwoParts, x: Array, time: float, f: Array, jacobian: Array) -> bool:
    """Compute the Jacobian by differences; its last column is by the time to the jettison."""
    shifted = np.empty(_UNKNOWNS)
    trial = np.empty(_UNKNOWNS)
    for i in range(_UNKNOWNS):
        trial[i] = x[i]
    # columns 3 and 2 change part two only
    for j in (3, 2, 1, 0):
        shift = _TIME_SHIFT if j == 3 else _SHIFT
        trial[j] = x[j] + shift
        if not _fly(flight, trial, time, j < 2, shifted):
            return False
        trial[j] = x[j]
        for i in range(_UNKNOWNS):
            jacobian[i, j] = (shifted[i] - f[i]) / shift
    later = time + _TIME_SHIFT
    if not _fly(flight, x, later, _BOTH_PARTS, shifted):
        return False
    for i in range(_UNKNOWNS):
        jacobian[i, _UNKNOWNS] = (shifted[i] - f[i]) / _TIME_SHIFT
    return True


@allocating
def _solve_at_time(flight: TwoParts, x: Array, time: float, slope: Array) -> bool:
    """Solve by Newton's method for a given time to the jettison; write dx/dtime to ``slope``."""
    f = np.empty(_UNKNOWNS)
    step = np.empty(_UNKNOWNS)
    jacobian = np.empty((_UNKNOWNS, _UNKNOWNS + 1))
    pivots = np.empty(_UNKNOWNS, np.int64)
    if not _fly(flight, x, time, _BOTH_PARTS, f):
        return False
    size = _size(f)
    factored = False
    for _ in range(_NEWTON_STEPS):
        if not factored:
            if not _differences(flight, x, time, f, jacobian):
                return False
            if not factor(_UNKNOWNS, jacobian, pivots):
                return False
            for i in range(_UNKNOWNS):
                slope[i] = -jacobian[i, _UNKNOWNS]
            back_substitute(_UNKNOWNS, jacobian, pivots, slope)
        for i in range(_UNKNOWNS):
            step[i] = f[i]
        back_substitute(_UNKNOWNS, jacobian, pivots, step)
        longest = max(abs(step[0]), abs(step[1]), abs(step[2]))
        shorter = min(1.0, _LONGEST_STEP / longest)
        for i in range(_UNKNOWNS):
            x[i] -= shorter * step[i]
        if not _fly(flight, x, time, _BOTH_PARTS, f):
            return False
        old = size
        size = _size(f)
        if size < _MET:
            return True
        factored = size < _CONTRACTION * old
    return False


@allocating
def _set_unknowns(
    whole: Record, burns: NDArray[Any], fraction: float, parts: NDArray[Any], x: Array
) -> float:
    """Set the unknowns from the flight with one law; return the time to the jettison."""
    last = burns[whole.burns - 1]
    work = np.empty(MAX_NODES)
    radius, speed, sine, range_angle = _node_state(last, fraction, work)
    time = fraction * last.duration
    cos, sin = thrust_direction(whole, last.begin + time, range_angle)
    turned = 0.0 if whole.steering == LOCAL else range_angle
    x[0] = whole.theta_start
    x[1] = math.atan2(sin, cos) - turned
    x[2] = whole.theta_end + turned
    x[3] = last.duration - time
    first = parts[0]
    second = parts[1]
    first.target_radius = radius
    first.target_speed = speed
    first.target_gamma = angle_of(sine)
    first.mean_radius = 0.5 * (first.radius + radius)
    first.mean_speed = 0.5 * (first.speed + speed)
    second.mean_radius = 0.5 * (radius + second.target_radius)
    second.mean_speed = 0.5 * (speed + second.target_speed)
    return time


@allocating
def _shortest(flight: TwoParts, x: Array, time: float, slope: Array) -> tuple[float, int]:
    """Minimise the cut-off time over the time to the jettison by the secant method.

    Returns:
        time to the jettison, s, and the number of flights within the limit.
    """
    trial = np.empty(_UNKNOWNS)
    gradient = 1.0 + slope[3]
    step = -math.copysign(_FIRST_STEP * time, gradient)
    count = 1
    halvings = 0
    while count < _MOST_FLIGHTS and halvings < _MOST_HALVINGS:
        later = max(0.0, time + step)
        for i in range(_UNKNOWNS):
            trial[i] = x[i] + slope[i] * (later - time)
        kept = slope[3]
        met = _solve_at_time(flight, trial, later, slope)
        if not met or later + trial[3] > time + x[3] + _TIME_ROUNDING:
            halvings += 1
            step *= 0.5
            _solve_at_time(flight, x, time, slope)
            continue
        count += 1
        moved = later - time
        for i in range(_UNKNOWNS):
            x[i] = trial[i]
        time = later
        gradient = 1.0 + slope[3]
        if time == 0.0 and gradient >= 0.0:
            break
        curvature = (slope[3] - kept) / moved
        greatest = _GREATEST_STEP * max(time, abs(moved))
        step = -math.copysign(greatest, gradient)
        if curvature * greatest > abs(gradient):
            step = -gradient / curvature
        if abs(step) < _TIME_FOUND:
            break
    return time, count


@allocating
def find_target(
    whole: Record,
    whole_burns: NDArray[Any],
    parts: NDArray[Any],
    before: NDArray[Any],
    after: NDArray[Any],
    heating: HeatingLimit,
) -> tuple[int, int, float]:
    """Find the jettison of the shortest flight.

    The search starts at the point where the flight with one steering law to cut-off first meets the
    limit, and returns it if no other flight is found.

    Args:
        whole: dtype PART: start to target as one part.
        whole_burns: dtype BURN: its burns, the last one without the dropped mass.
        parts: shape (2,), dtype PART; the first one's target and time to go are written.
        before: dtype BURN: burns of part one.
        after: shape (1,), dtype BURN: burn of part two.
        heating: limit and plane.

    Returns:
        status; number of flights in two parts within the limit; log of heating over limit at the
        first point of the single-law flight within it, or at its least heating.
    """
    guess_angles(whole, whole_burns, False)
    if not iterate(whole, whole_burns):
        return NO_FLIGHT, 0, math.nan
    fraction, level = first_within_limit(whole_burns[whole.burns - 1], heating)
    x = np.empty(_UNKNOWNS)
    slope = np.empty(_UNKNOWNS)
    time = _set_unknowns(whole, whole_burns, fraction, parts, x)
    first = parts[0]
    first.time_to_go = time
    if time == 0.0 and level <= 0.0:
        return AT_ONCE, 0, level
    count = 0
    single = np.empty(_UNKNOWNS)
    for i in range(_UNKNOWNS):
        single[i] = x[i]
    flight = TwoParts(parts, before, after, heating, np.empty(POWERS))
    if _solve_at_time(flight, x, time, slope):
        time, count = _shortest(flight, x, time, slope)
    elif level > 0.0:
        return TOO_HOT, 0, level
    else:
        f = np.empty(_UNKNOWNS)
        if not _fly(flight, single, time, _BOTH_PARTS, f):
            return NO_FLIGHT, 0, level
    first.time_to_go = time
    first.target_radius = parts[1].radius
    first.target_speed = parts[1].speed
    first.target_gamma = parts[1].gamma
    return ON_THE_WAY, count, level
