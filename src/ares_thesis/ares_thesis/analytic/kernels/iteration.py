# SPDX-License-Identifier: Apache-2.0
"""Iterate the unknowns of a part (section 5.3.3) from a first guess."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import allocating, kernel
from ares_optimizer.kernels.algebra import least_step
from ares_thesis.analytic.arrays import LOCAL, POWERS
from ares_thesis.analytic.kernels.burn import cosine_of, log_moments, project

Array = NDArray[np.float64]

SPEED_TOLERANCE = 1e-4  # m/s
POSITION_TOLERANCE = 1.0  # m
GAMMA_TOLERANCE = 1e-6  # rad

_MOST_OF_TAU = 0.97
_SEARCHES = 60
_LONGEST_STEP = 0.2  # rad; time to go: 200 s
_SHORTEST_STEP = 1e-3  # of the full one
_SHIFT = 1e-5  # rad, of the finite differences
_TIME_SCALE = 1e3  # s
_ROUNDS = 8
_LEAST_COSINE_SQUARE = 0.1
_STEEPEST = 0.95  # sine of a guessed angle


@kernel
def guess_time(part: Record, burns: NDArray[Any], delta_v: float) -> None:
    """Guess the time to go from an impulsive change of speed, Eq. 5.29.

    Args:
        part: dtype PART; ``time_to_go`` is written.
        burns: dtype BURN; those before the last reduce the speed to gain.
        delta_v: m/s.
    """
    final = burns[part.burns - 1]
    left = delta_v
    for k in range(part.burns - 1):
        left += burns[k].exhaust_velocity * math.log1p(-burns[k].duration / burns[k].tau)
    x = 1.0 - math.exp(-left / final.exhaust_velocity)
    part.time_to_go = final.tau * min(0.9, max(0.01, x))


@allocating
def _thrust_moments(part: Record, burns: NDArray[Any], m: Array) -> float:
    """Integrate a_T, a_T t, a_T t^2 over a part; return a_T over its first half."""
    work = np.empty(3)
    for k in range(3):
        m[k] = 0.0
    begin = 0.0
    total = part.time_to_go
    for k in range(part.burns - 1):
        total += burns[k].duration
    half = 0.0
    for k in range(part.burns):
        burn = burns[k]
        duration = burn.duration if k < part.burns - 1 else part.time_to_go
        log_moments(duration / burn.tau, 3, work)
        v = burn.exhaust_velocity
        m[0] += v * work[0]
        m[1] += v * (begin * work[0] + duration * work[1])
        m[2] += v * (begin * begin * work[0] + 2.0 * begin * duration * work[1])
        m[2] += v * duration * duration * work[2]
        inside = min(duration, max(0.0, 0.5 * total - begin))
        half -= v * math.log1p(-inside / burn.tau)
        begin += duration
    return half


@allocating
def guess_angles(part: Record, burns: NDArray[Any], time_known: bool) -> None:
    """Guess angles and time to go with a prescribed history of speed.

    sin(theta) = p + q t: vertical motion under gravity minus centrifugal acceleration determines p
    and q from the target's rate of climb and radius; the change of horizontal speed determines the
    time to go (Eq. 5.29 over the mean cosine).

    Args:
        part: dtype PART; ``theta_start``, ``theta_end``, ``time_to_go`` are written.
        burns: dtype BURN.
        time_known: do not change ``time_to_go``.
    """
    m = np.empty(3)
    across0 = part.speed * math.cos(part.gamma)
    across1 = part.target_speed * math.cos(part.target_gamma)
    climb0 = part.speed * math.sin(part.gamma)
    climb1 = part.target_speed * math.sin(part.target_gamma)
    radius0 = part.radius
    radius1 = part.target_radius
    middle = 0.5 * (radius0 + radius1)
    if not time_known:
        guess_time(part, burns, part.target_speed - part.speed)
    p = 0.0
    q = 0.0
    total = 0.0
    turned = 0.0
    for _ in range(_ROUNDS):
        half = _thrust_moments(part, burns, m)
        total = part.time_to_go
        for k in range(part.burns - 1):
            total += burns[k].duration
        across = across0 + (across1 - across0) * half / m[0]
        # single and double integrals over time by Simpson's rule
        net0 = across0 * across0 / radius0 - part.mu / (radius0 * radius0)
        net = across * across / middle - part.mu / (middle * middle)
        net1 = across1 * across1 / radius1 - part.mu / (radius1 * radius1)
        once = total / 6.0 * (net0 + 4.0 * net + net1)
        twice = total * total / 6.0 * (net0 + 2.0 * net)
        climb = climb1 - climb0 - once
        rise = radius1 - radius0 - climb0 * total - twice
        s = m[0] * total - m[1]
        r = m[1] * total - m[2]
        determinant = m[0] * r - m[1] * s
        p = (climb * r - m[1] * rise) / determinant
        q = (m[0] * rise - s * climb) / determinant
        turned = total / 6.0 * (across0 + 4.0 * across + across1) / middle
        if time_known:
            break
        square = (p * p * m[0] + 2.0 * p * q * m[1] + q * q * m[2]) / m[0]
        cosine = math.sqrt(max(_LEAST_COSINE_SQUARE, 1.0 - square))
        guess_time(part, burns, (across1 - across0) / cosine)
    part.theta_start = math.asin(min(_STEEPEST, max(-_STEEPEST, p)))
    part.theta_end = math.asin(min(_STEEPEST, max(-_STEEPEST, p + q * total)))
    if part.steering != LOCAL:
        part.theta_end -= turned


@kernel
def search_time(part: Record, burns: NDArray[Any], moments: Array) -> bool:
    """Search for the time to go by the speed error, Eq. 5.30.

    Printed: dt/dV is "the inverse of Eq. 5.4"; it is that of Eq. 5.5.

    Args:
        part: dtype PART.
        burns: dtype BURN.
        moments: shape (POWERS,), work space.

    Returns:
        true if the speed is met.
    """
    final = burns[part.burns - 1]
    longest = _MOST_OF_TAU * final.tau
    for _ in range(_SEARCHES):
        part.searches += 1
        if part.stop != 0 or not project(part, burns, moments):
            return False
        if abs(part.speed_error) < SPEED_TOLERANCE:
            return True
        last = final.nodes - 1
        sine = final.sine[last]
        cos_alpha = final.cos_theta[last] * cosine_of(sine) + final.sin_theta[last] * sine
        gain = final.exhaust_velocity / (final.tau - final.duration) * cos_alpha
        gain -= final.gravity * sine
        if not gain > 0.0:
            return False
        part.time_to_go = min(longest, max(0.0, part.time_to_go + part.speed_error / gain))
    return False


@kernel
def _get(part: Record, u: Array) -> None:
    """Copy the free parameters of Tables 5.1 and 5.2 to ``u``.

    As printed these are the angles; if ``solved``, the time to go too.
    """
    if part.solved == 1:
        u[0] = part.theta_start
        u[1] = part.theta_end
        u[2] = part.time_to_go / _TIME_SCALE
    elif part.burns == 2:
        u[0] = part.theta_end
        u[1] = part.gamma_joint
    else:
        u[0] = part.theta_start


@kernel
def _put(part: Record, u: Array) -> None:
    if part.solved == 1:
        part.theta_start = u[0]
        part.theta_end = u[1]
        if part.timed == 0:
            part.time_to_go = _TIME_SCALE * u[2]
    elif part.burns == 2:
        part.theta_end = u[0]
        part.gamma_joint = u[1]
    else:
        part.theta_start = u[0]


@kernel
def _residuals(part: Record, f: Array) -> float:
    """Write the scaled errors: position; if ``solved``, also gamma and speed.

    Returns:
        sum of their squares.
    """
    f[0] = -part.position_error / part.target_radius
    if part.solved == 1:
        f[1] = -part.gamma_error
        if part.timed == 0:
            f[2] = -part.speed_error / part.target_speed
    total = 0.0
    for x in f:
        total += x * x
    return total


@kernel
def _is_met(part: Record) -> bool:
    if part.solved == 1:
        if not abs(part.gamma_error) < GAMMA_TOLERANCE:
            return False
        if part.timed == 0 and not abs(part.speed_error) < SPEED_TOLERANCE:
            return False
    return abs(part.position_error) < POSITION_TOLERANCE


@kernel
def _project(part: Record, burns: NDArray[Any], moments: Array) -> bool:
    """Project a part; as printed, with a search for the time to go (5.30)."""
    if part.solved == 1:
        return project(part, burns, moments)
    return search_time(part, burns, moments)


@allocating
def _find_partials(
    part: Record, burns: NDArray[Any], moments: Array, u: Array, f: Array, m: Array
) -> bool:
    """Compute the finite differences of Eq. 5.32; the part is left perturbed."""
    rows, columns = m.shape
    shifted = np.empty(rows)
    for j in range(columns):
        u[j] += _SHIFT
        _put(part, u)
        if not project(part, burns, moments):
            return False
        u[j] -= _SHIFT
        _residuals(part, shifted)
        for i in range(rows):
            m[i, j] = (shifted[i] - f[i]) / _SHIFT
    for j in range(min(columns, 2)):
        part.partials[j] = m[0, j] * part.target_radius
    return True


@kernel
def _largest(step: Array) -> float:
    """Return the largest modulus of a step."""
    largest = 0.0
    for x in step:
        largest = max(largest, abs(x))
    return largest


@allocating
def iterate(part: Record, burns: NDArray[Any]) -> bool:
    """Solve for the unknowns by the pseudoinverse of finite differences: section 5.3.3.

    As printed, the speed error determines the time to go first, then the position error the
    shortest step of two angles (part one) or one (part two). If ``solved``, the errors in position,
    gamma and speed determine the angles at both ends and the time to go; a step that increases the
    errors is halved.

    Args:
        part: dtype PART with guesses; unknowns, errors, partials and counts are written.
        burns: dtype BURN; written.

    Returns:
        true if the target is met.
    """
    moments = np.empty(POWERS)
    rows = 1
    columns = part.burns
    if part.solved == 1:
        rows = 2 if part.timed == 1 else 3
        columns = rows
    m = np.zeros((rows, columns))
    f = np.zeros(rows)
    u = np.zeros(3)
    step = np.zeros(columns)
    part.searches = 0
    for k in range(part.burns):
        burns[k].warm = 0
    _get(part, u)
    size = math.inf
    scale = 0.0
    for iteration in range(1, part.max_iterations + 1):
        part.iterations = iteration
        if part.stop != 0:
            return False
        projected = _project(part, burns, moments)
        old = size
        size = _residuals(part, f)
        if part.solved == 1 and scale > _SHORTEST_STEP and not (projected and size < old):
            scale *= 0.5
            for j in range(columns):
                u[j] -= scale * step[j]
            _put(part, u)
            size = old
            continue
        if not projected:
            return False
        met = _is_met(part)
        if not _find_partials(part, burns, moments, u, f, m):
            return False
        _put(part, u)
        if met:
            return project(part, burns, moments)
        least_step(m, f, 0.0, step)
        scale = part.step_scale * min(1.0, _LONGEST_STEP / _largest(step))
        for j in range(columns):
            u[j] += scale * step[j]
        _put(part, u)
    return False
