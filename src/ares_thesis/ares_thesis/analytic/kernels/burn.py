# SPDX-License-Identifier: Apache-2.0
"""Compute burns in closed form, from polynomials in sin(gamma) and cos(alpha): chapter 5.

A *burn* has constant thrust; a *part* is one or two burns under one steering law: start to jettison
(part one), jettison to cut-off (part two). The motion is planar: radius r, speed V, flight-path
angle gamma, range angle phi. Polynomials are in x = t/T over a burn of duration T.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import allocating, kernel
from ares_thesis.analytic.arrays import (
    CUBIC,
    EXACT,
    FITTED,
    LINEAR,
    LOCAL,
    MAX_NODES,
    POWERS,
    PRIMER,
    QUADRATIC,
    SINE_TERMS,
    TRAPEZOID,
)

Array = NDArray[np.float64]


def _powers_of_nodes() -> Array:
    """Return, per number of nodes, the matrix from values at the nodes to powers of x."""
    table = np.zeros((MAX_NODES + 1, MAX_NODES, MAX_NODES))
    for n in range(2, MAX_NODES + 1):
        table[n, :n, :n] = np.linalg.inv(np.vander(np.linspace(0.0, 1.0, n), increasing=True))
    return table


def _powers_of_inner_nodes() -> Array:
    """Return the same for the inner nodes, of values divided by x^2 (1 - x)^2."""
    table = np.zeros((MAX_NODES + 1, MAX_NODES, MAX_NODES))
    for n in range(3, MAX_NODES + 1):
        x = np.linspace(0.0, 1.0, n)[1:-1]
        powers = np.linalg.inv(np.vander(x, increasing=True))
        table[n, : n - 2, : n - 2] = powers / (x * (1.0 - x)) ** 2
    return table


_POWERS = _powers_of_nodes()
_INNER_POWERS = _powers_of_inner_nodes()

_CANCELLATION = 1e-4  # of the upward recursion, over the rounding
_NEGLIGIBLE = 1e-18
_SWEEPS = 30
_SETTLED = 1e-11


@kernel
def log_moments(x: float, count: int, out: Array) -> None:
    """Compute the thrust integrals of Eq. 5.20 without cancellation.

    out[k] is the integral over s from 0 to 1 of s^k x / (1 - x s), that is 1/T^k times the
    integral over t from 0 to T of t^k / (tau - t), with x = T/tau. out[0] = -ln(1 - x), and
    out[k] = out[k-1]/x - 1/k; for small x this recursion runs downwards from a series.

    Printed in 5.20, 5.21, 5.27: ln(-tau + t), which has no real value; correct is ln(tau - t).

    Args:
        x: less than 1; negative for a burn flown backwards.
        count: number of integrals.
        out: shape (>= count,), written.
    """
    if abs(x) ** (count - 1) > _CANCELLATION:
        out[0] = -math.log1p(-x)
        for k in range(1, count):
            out[k] = out[k - 1] / x - 1.0 / k
        return
    power = x
    total = 0.0
    j = count
    while abs(power) > _NEGLIGIBLE:
        total += power / j
        power *= x
        j += 1
    out[count - 1] = total
    for k in range(count - 1, 0, -1):
        out[k - 1] = x * (out[k] + 1.0 / k)


@kernel
def polynomial(a: Array, count: int, x: float) -> float:
    """Return the sum of a[k] x^k."""
    total = 0.0
    for k in range(count - 1, -1, -1):
        total = total * x + a[k]
    return total


@kernel
def integral(a: Array, count: int, x: float) -> float:
    """Return the integral of a polynomial from 0 to x."""
    total = 0.0
    for k in range(count - 1, -1, -1):
        total = total * x + a[k] / (k + 1)
    return total * x


@kernel
def through_nodes(values: Array, n: int, out: Array) -> None:
    """Compute the polynomial through ``n`` values at equally spaced x from 0 to 1."""
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += _POWERS[n, i, j] * values[j]
        out[i] = total


@kernel
def cosine_of(sine: float) -> float:
    """Return the cosine of an angle within 90 deg from its sine."""
    return math.sqrt(max(0.0, 1.0 - sine * sine))


@kernel
def angle_of(sine: float) -> float:
    """Return the angle, rad, of a sine clipped to [-1, 1]."""
    return math.asin(min(1.0, max(-1.0, sine)))


@kernel
def set_law(part: Record, total: float) -> None:
    """Set the steering law of a part from its angles at both ends.

    LOCAL and INERTIAL: tan(theta) = a1 t + a0, Eq. 5.16. PRIMER: lambda'' = G lambda (3.15) to
    third order in time, with the gravity gradient G half-way. The rate along the horizon follows
    from a free range angle, r x lambda_r + V x lambda_v = 0.

    Args:
        part: dtype PART; ``along`` and ``above`` are written.
        total: duration of the part, s.
    """
    cos = math.cos(part.theta_start)
    sin = math.sin(part.theta_start)
    if part.steering != PRIMER:
        start = sin / cos
        for k in range(4):
            part.along[k] = 0.0
            part.above[k] = 0.0
        part.along[0] = 1.0
        part.above[0] = start
        part.above[1] = (math.tan(part.theta_end) - start) / total
        return
    half_way = 0.5 * part.mean_speed * total / part.mean_radius
    up_x = math.sin(half_way)
    up_z = math.cos(half_way)
    k = part.mu / part.mean_radius**3
    gxx = k * (3.0 * up_x * up_x - 1.0)
    gxz = k * 3.0 * up_x * up_z
    gzz = k * (3.0 * up_z * up_z - 1.0)
    rate = -part.speed * math.sin(part.theta_start - part.gamma) / part.radius
    # vector at the end without a rate above the horizon, and its derivative by that rate
    t2 = 0.5 * total * total
    t3 = total * t2 / 3.0
    x0 = cos + rate * total + t2 * (gxx * cos + gxz * sin) + t3 * gxx * rate
    z0 = sin + t2 * (gxz * cos + gzz * sin) + t3 * gxz * rate
    x1 = t3 * gxz
    z1 = total + t3 * gzz
    cos_end = math.cos(part.theta_end)
    sin_end = math.sin(part.theta_end)
    rise = (x0 * sin_end - z0 * cos_end) / (z1 * cos_end - x1 * sin_end)
    part.along[0] = cos
    part.along[1] = rate
    part.along[2] = 0.5 * (gxx * cos + gxz * sin)
    part.along[3] = (gxx * rate + gxz * rise) / 6.0
    part.above[0] = sin
    part.above[1] = rise
    part.above[2] = 0.5 * (gxz * cos + gzz * sin)
    part.above[3] = (gxz * rate + gzz * rise) / 6.0


@kernel
def thrust_direction(part: Record, t: float, range_angle: float) -> tuple[float, float]:
    """Return cosine and sine of theta: thrust against the local horizon.

    Args:
        part: dtype PART.
        t: time after the start of the part, s.
        range_angle: rotation of the horizon since then, rad.
    """
    along = polynomial(part.along, 4, t)
    above = polynomial(part.above, 4, t)
    scale = 1.0 / math.sqrt(along * along + above * above)
    along *= scale
    above *= scale
    if part.steering == LOCAL:
        return along, above
    cos = math.cos(range_angle)
    sin = math.sin(range_angle)
    return along * cos - above * sin, along * sin + above * cos


@kernel
def _sine_rate(mu: float, burn: Record, i: int) -> float:
    """Return the rate of sin(gamma) at a node, 1/s: Eq. 5.6 times cos(gamma)."""
    sine = burn.sine[i]
    cosine = cosine_of(sine)
    speed = burn.speed[i]
    radius = burn.radius[i]
    left = burn.tau if i == 0 else burn.tau - burn.duration
    sin_alpha = burn.sin_theta[i] * cosine - burn.cos_theta[i] * sine
    thrust = burn.exhaust_velocity / left * sin_alpha / speed
    return (thrust - (mu / (radius * radius * speed) - speed / radius) * cosine) * cosine


@kernel
def _set_sine(mu: float, burn: Record) -> None:
    """Compute sin(gamma): Eqs. 5.8 to 5.14, or with the slope of 5.6 at both ends.

    Printed in 5.11: b2 t0 + b1; the derivative is 2 b2 t0 + b1.
    """
    n = burn.nodes
    b = burn.sin_gamma
    for k in range(SINE_TERMS):
        b[k] = 0.0
    b[0] = burn.sine[0]
    rise = burn.sine[n - 1] - burn.sine[0]
    if burn.form == LINEAR:
        b[1] = rise
        return
    slope = _sine_rate(mu, burn, 0) * burn.duration
    b[1] = slope
    if burn.form == QUADRATIC:
        b[2] = rise - slope
        return
    end_slope = _sine_rate(mu, burn, n - 1) * burn.duration
    b[2] = 3.0 * rise - 2.0 * slope - end_slope
    b[3] = slope + end_slope - 2.0 * rise
    if burn.form == CUBIC:
        return
    # x^2 (1 - x)^2 q(x) does not change values and slopes at the ends
    cubic = (b[0], b[1], b[2], b[3])
    for j in range(1, n - 1):
        x = j / (n - 1)
        missing = burn.sine[j] - cubic[0] - x * (cubic[1] + x * (cubic[2] + x * cubic[3]))
        for i in range(n - 2):
            q = _INNER_POWERS[n, i, j - 1] * missing
            b[i + 2] += q
            b[i + 3] -= 2.0 * q
            b[i + 4] += q


@kernel
def _speed_from(burn: Record, x: float, moments: Array) -> float:
    """Return the speed at x, m/s, with the log moments of x T / tau given."""
    thrust = 0.0
    power = 1.0
    for k in range(burn.nodes):
        thrust += burn.cos_alpha[k] * power * moments[k]
        power *= x
    fall = burn.duration * integral(burn.sin_gamma, SINE_TERMS, x)
    return burn.speed[0] + burn.exhaust_velocity * thrust - burn.gravity * fall


@kernel
def speed_at(burn: Record, x: float, moments: Array) -> float:
    """Return the speed in closed form, m/s: Eqs. 5.20, 5.21, 5.27.

    Printed: ln(-tau + t), tau_1 in stage 2, and in 5.27 gravity inside the brace of the thrust.

    Args:
        burn: dtype BURN, after :func:`shape_burn`.
        x: fraction of the burn.
        moments: shape (POWERS,), work space.
    """
    log_moments(x * burn.duration / burn.tau, burn.nodes, moments)
    return _speed_from(burn, x, moments)


@kernel
def exact_rise(burn: Record, x: float, moments: Array) -> float:
    """Integrate V sin(gamma) up to x in closed form, m.

    By parts: with B the integral of sin(gamma), the integral of V sin(gamma) is V B minus that of
    B V'. With V' = a_T cos(alpha) - g sin(gamma) (5.5) the latter is a polynomial over tau - t,
    integrated as in Eq. 5.20, minus g B^2/2.

    Args:
        burn: dtype BURN, after :func:`shape_burn`.
        x: fraction of the burn.
        moments: shape (POWERS,), work space.
    """
    log_moments(x * burn.duration / burn.tau, POWERS, moments)
    area = integral(burn.sin_gamma, SINE_TERMS, x)
    product = 0.0
    power = x
    for k in range(1, burn.nodes + SINE_TERMS):
        coefficient = 0.0
        for i in range(max(0, k - SINE_TERMS), min(k, burn.nodes)):
            coefficient += burn.cos_alpha[i] * burn.sin_gamma[k - 1 - i] / (k - i)
        product += coefficient * power * moments[k]
        power *= x
    rise = _speed_from(burn, x, moments) * area - burn.exhaust_velocity * product
    return burn.duration * (rise + 0.5 * burn.gravity * burn.duration * area * area)


@kernel
def trapezoid_rise(burn: Record, moments: Array) -> float:
    """Integrate V sin(gamma) over the burn by the trapezoidal rule, m (section 6.2)."""
    total = 0.0
    for i in range(burn.steps + 1):
        x = i / burn.steps
        value = speed_at(burn, x, moments) * polynomial(burn.sin_gamma, SINE_TERMS, x)
        total += 0.5 * value if i in (0, burn.steps) else value
    return total * burn.duration / burn.steps


@allocating
def quadratic_rise(burn: Record, moments: Array) -> float:
    """Integrate V sin(gamma) with a quadratic or linear V, m: Eqs. 5.23 to 5.26, 5.28.

    V agrees with the closed form at both ends and, if quadratic, half-way. Printed in 5.26: limits
    0 and t_stage1; correct are those of the segment.
    """
    n = 2 if burn.form == LINEAR else 3
    values = np.empty(n)
    for i in range(n):
        values[i] = speed_at(burn, i / (n - 1), moments)
    v = np.empty(n)
    through_nodes(values, n, v)
    total = 0.0
    for i in range(n):
        for j in range(SINE_TERMS):
            total += v[i] * burn.sin_gamma[j] / (i + j + 1)
    return total * burn.duration


@kernel
def _begin_shape(part: Record, burn: Record, free: bool) -> None:
    """Set rough values at the nodes to start the fixed-point iteration."""
    n = burn.nodes
    for i in range(1, n):
        x = i / (n - 1)
        gain = -burn.exhaust_velocity * math.log1p(-x * burn.duration / burn.tau)
        burn.speed[i] = burn.speed[0] + 0.9 * gain
        burn.radius[i] = burn.radius[0]
        mean = 0.5 * (burn.speed[0] + burn.speed[i])
        burn.range_angle[i] = burn.range_angle[0] + mean / burn.radius[0] * x * burn.duration
        if free:
            burn.sine[i] = burn.sine[0] + x * (math.sin(part.target_gamma) - burn.sine[0])


@kernel
def _shape_speed(part: Record, burn: Record, values: Array) -> None:
    """Compute polynomials and speed from the values at the nodes: Eqs. 5.8 to 5.18, 5.20."""
    n = burn.nodes
    last = n - 1
    for i in range(n):
        t = burn.begin + i / last * burn.duration
        burn.cos_theta[i], burn.sin_theta[i] = thrust_direction(part, t, burn.range_angle[i])
    _set_sine(part.mu, burn)
    if burn.form != FITTED:
        for i in range(1, last):
            burn.sine[i] = polynomial(burn.sin_gamma, SINE_TERMS, i / last)
    for i in range(n):
        # cos(theta - gamma), Eq. 5.15
        s = burn.sine[i]
        values[i] = burn.cos_theta[i] * cosine_of(s) + burn.sin_theta[i] * s
    through_nodes(values, n, burn.cos_alpha)
    nearest = burn.radius[last] if part.mean_gravity == 1 else burn.radius[0]
    burn.gravity = part.mu / (burn.radius[0] * nearest)
    for i in range(1, n):
        burn.speed[i] = _speed_from(burn, i / last, burn.moments[i])


@kernel
def _shape_climb(part: Record, burn: Record, values: Array, a: Array) -> None:
    """Compute sin(gamma) = V_r/V at the end (FITTED: at the nodes between, too).

    By 5.5 and 5.6 the rate of climb V_r = V sin(gamma) has the derivative
    a_T sin(theta) - g + V^2 cos^2(gamma)/r, which is integrated as in 5.20.
    """
    n = burn.nodes
    last = n - 1
    start = burn.speed[0] * burn.sine[0]
    for i in range(n):
        radius = burn.radius[i]
        across = burn.speed[i] * burn.speed[i] * (1.0 - burn.sine[i] * burn.sine[i])
        values[i] = across / radius - part.mu / (radius * radius)
    through_nodes(values, n, a)
    for i in range(1, n):
        values[i] = start + burn.duration * integral(a, n, i / last)
    through_nodes(burn.sin_theta, n, a)
    for i in range(1 if burn.form == FITTED else last, n):
        thrust = 0.0
        power = 1.0
        for k in range(n):
            thrust += a[k] * power * burn.moments[i, k]
            power *= i / last
        burn.sine[i] = (values[i] + burn.exhaust_velocity * thrust) / burn.speed[i]


@kernel
def _shape_place(burn: Record, values: Array, a: Array) -> None:
    """Compute radius and range angle at the nodes."""
    n = burn.nodes
    last = n - 1
    for i in range(n):
        values[i] = burn.speed[i] * burn.sine[i]
    through_nodes(values, n, a)
    for i in range(1, n):
        burn.radius[i] = burn.radius[0] + burn.duration * integral(a, n, i / last)
    for i in range(n):
        values[i] = burn.speed[i] * cosine_of(burn.sine[i]) / burn.radius[i]
    through_nodes(values, n, a)
    for i in range(1, n):
        burn.range_angle[i] = burn.range_angle[0] + burn.duration * integral(a, n, i / last)


@allocating
def shape_burn(part: Record, burn: Record) -> bool:
    """Find polynomials, speed, radius and range angle of one burn by fixed-point iteration.

    Each sweep reduces the error about twentyfold.

    Args:
        part: dtype PART with its law.
        burn: dtype BURN; its first node is the start, ``sine`` of the last one the end
            unless the part is ``solved``.

    Returns:
        true if the iteration converged.
    """
    n = burn.nodes
    last = n - 1
    values = np.empty(MAX_NODES)
    a = np.empty(MAX_NODES)
    x = burn.duration / burn.tau
    if burn.moments_of != x:
        burn.moments_of = x
        for i in range(n):
            log_moments(i / last * x, n, burn.moments[i])
    if burn.warm == 0:
        _begin_shape(part, burn, part.solved == 1)
    burn.warm = 0
    for _ in range(_SWEEPS):
        sine = burn.sine[last]
        speed = burn.speed[last]
        range_angle = burn.range_angle[last]
        _shape_speed(part, burn, values)
        if part.solved == 1:
            _shape_climb(part, burn, values, a)
        _shape_place(burn, values, a)
        change = abs(burn.sine[last] - sine) + abs(burn.speed[last] / speed - 1.0)
        change += abs(burn.range_angle[last] - range_angle)
        if change < _SETTLED:
            burn.warm = 1
            return True
        if not change < 10.0:
            return False
    return False


@kernel
def _theta_from_slope(part: Record, burn: Record) -> float:
    """Return the thrust angle at the end, rad: Eq. 5.6 solved for alpha.

    The slope of gamma is that of the quadratic.
    """
    total = part.time_to_go
    sine = math.sin(part.gamma)
    cosine = math.cos(part.gamma)
    fall = part.mu / (part.radius * part.radius * part.speed) - part.speed / part.radius
    thrust = burn.exhaust_velocity / (burn.tau * part.speed)
    turn = thrust * math.sin(part.theta_start - part.gamma) - fall * cosine
    slope = 2.0 * (math.sin(part.target_gamma) - sine) / total - turn * cosine
    radius = part.target_radius
    speed = part.target_speed
    cosine = math.cos(part.target_gamma)
    turn = slope / cosine + (part.mu / (radius * radius * speed) - speed / radius) * cosine
    sin_alpha = turn * speed * (burn.tau - total) / burn.exhaust_velocity
    return part.target_gamma + angle_of(sin_alpha)


@kernel
def end_radius(part: Record, burn: Record, moments: Array) -> float:
    """Return the radius at the end of a burn, m, by the position integral of the part."""
    if part.integral == EXACT:
        return burn.radius[0] + exact_rise(burn, 1.0, moments)
    if part.integral == TRAPEZOID:
        return burn.radius[0] + trapezoid_rise(burn, moments)
    return burn.radius[0] + quadratic_rise(burn, moments)


@kernel
def project(part: Record, burns: NDArray[Any], moments: Array) -> bool:
    """Project the ascent of a part for its current unknowns; set its errors.

    Args:
        part: dtype PART.
        burns: dtype BURN, shape (>= part.burns,); all but the last have their duration.
        moments: shape (POWERS,), work space.

    Returns:
        true if the projection exists.
    """
    part.position_error = math.nan
    part.speed_error = math.nan
    part.gamma_error = math.nan
    count = part.burns
    final = burns[count - 1]
    if not part.time_to_go < final.tau:
        return False
    final.duration = part.time_to_go
    if part.solved == 0 and count == 1:
        part.theta_end = _theta_from_slope(part, final)
    total = 0.0
    for k in range(count):
        total += burns[k].duration
    set_law(part, total)
    begin = 0.0
    radius = part.radius
    speed = part.speed
    sine = math.sin(part.gamma)
    range_angle = 0.0
    for k in range(count):
        burn = burns[k]
        last = burn.nodes - 1
        burn.begin = begin
        burn.radius[0] = radius
        burn.speed[0] = speed
        burn.sine[0] = sine
        burn.range_angle[0] = range_angle
        if part.solved == 0:
            burn.sine[last] = math.sin(part.target_gamma if k == count - 1 else part.gamma_joint)
        if not shape_burn(part, burn):
            return False
        radius = end_radius(part, burn, moments)
        burn.end_radius = radius
        speed = burn.speed[last]
        sine = burn.sine[last]
        range_angle = burn.range_angle[last]
        begin += burn.duration
    part.position_error = part.target_radius - radius
    part.speed_error = part.target_speed - speed
    part.gamma_error = part.target_gamma - angle_of(sine)
    return math.isfinite(radius) and math.isfinite(speed) and abs(sine) < 1.0


@allocating
def sample_burn(part: Record, burn: Record, xs: Array, out: Array) -> None:
    """Sample a burn at fractions of its duration.

    Args:
        part: dtype PART.
        burn: dtype BURN.
        xs: shape (n,).
        out: shape (n, 6), written: radius m, speed m/s, sin(gamma), range angle rad, cosine and
            sine of theta.
    """
    n = burn.nodes
    moments = np.empty(POWERS)
    a = np.empty(MAX_NODES)
    through_nodes(burn.range_angle, n, a)
    for i in range(xs.size):
        x = xs[i]
        range_angle = polynomial(a, n, x)
        out[i, 0] = burn.radius[0] + exact_rise(burn, x, moments)
        out[i, 1] = speed_at(burn, x, moments)
        out[i, 2] = polynomial(burn.sin_gamma, SINE_TERMS, x)
        out[i, 3] = range_angle
        out[i, 4], out[i, 5] = thrust_direction(part, burn.begin + x * burn.duration, range_angle)
