# SPDX-License-Identifier: Apache-2.0
"""Two-body propagation in universal variables.

Sources: Battin, *An Introduction to the Mathematics and Methods of Astrodynamics*,
section 4.5 (universal functions U0..U3, Lagrange coefficients); Conway, "An improved
algorithm due to Laguerre for the solution of Kepler's equation", Celest. Mech. 39 (1986).
"""

import math

from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, axpy, dot, norm, scale

_MAX_ITERATIONS = 80
_TOLERANCE = 1.0e-6  # relative step; convergence is cubic: after it the anomaly is exact
#: Relative step of the anomaly below which addition theorems update the functions.
_SHORT = 5.0e-3
_SHORT_Z = 1.0e-4  # bound on alpha step^2 for the series of such a step
_LAST = 1.0e-9  # relative step of Newton's method after which the anomaly is exact

#: Series coefficients of the Stumpff functions c2 and c3.
_C2 = tuple((-1.0) ** k / math.factorial(2 * k + 2) for k in range(9))
_C3 = tuple((-1.0) ** k / math.factorial(2 * k + 3) for k in range(9))

#: Universal functions U0 (no unit), U1 (m^0.5), U2 (m), U3 (m^1.5).
Universal = tuple[float, float, float, float]


@kernel
def _series(c: tuple[float, ...], z: float) -> float:
    """Sum c[k] z^k for k = 0..8 in independent pairs (Estrin's scheme)."""
    s = z * z
    q = s * s
    low = (c[0] + z * c[1]) + s * (c[2] + z * c[3])
    return low + q * (((c[4] + z * c[5]) + s * (c[6] + z * c[7])) + q * c[8])


@kernel
def universal_functions(anomaly: float, alpha: float) -> Universal:
    """Compute the universal functions U0..U3 of Battin, Eq. 4.71 onwards.

    Args:
        anomaly: universal anomaly chi, m^0.5.
        alpha: reciprocal of the semi-major axis, 1/m; negative on a hyperbola.

    Returns:
        U0..U3. Overflow gives inf.
    """
    square = anomaly * anomaly
    z = alpha * square
    if abs(z) < 1.0:
        # includes the parabola
        c2 = _series(_C2, z)
        c3 = _series(_C3, z)
        return (1.0 - z * c2, anomaly * (1.0 - z * c3), square * c2, anomaly * square * c3)
    if z > 0.0:
        root = math.sqrt(alpha)
        half = math.sin(0.5 * root * anomaly)
        u1 = math.sin(root * anomaly) / root
        u2 = 2.0 * half * half / alpha
        return (1.0 - alpha * u2, u1, u2, (anomaly - u1) / alpha)
    root = math.sqrt(-alpha)
    half = math.sinh(0.5 * root * anomaly)
    u1 = math.sinh(root * anomaly) / root
    u2 = -2.0 * half * half / alpha
    return (1.0 - alpha * u2, u1, u2, (anomaly - u1) / alpha)


@kernel
def _further(functions: Universal, step: float, alpha: float) -> Universal:
    """Update the universal functions by a short step of the anomaly: addition theorems."""
    u0, u1, u2, u3 = functions
    square = step * step
    z = alpha * square
    w3 = step * square * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0)))
    w2 = square * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0)))
    w1 = step - alpha * w3
    return (
        u0 - alpha * (u1 * w1 + u0 * w2),
        u1 + (u0 * w1 - alpha * (u1 * w2)),
        u2 + (u1 * w1 + u0 * w2),
        u3 + (step * u2 + (u1 * w2 + u0 * w3)),
    )


@kernel
def _radius_and_time(functions: Universal, r0: float, sigma: float) -> tuple[float, float]:
    """Compute radius, m, and time times the square root of mu, m^1.5: Kepler's equation."""
    u0, u1, u2, u3 = functions
    return r0 * u0 + sigma * u1 + u2, r0 * u1 + sigma * u2 + u3


@kernel
def first_anomaly(goal: float, r0: float, sigma: float, alpha: float, high: float) -> float:
    """Guess the universal anomaly by reversion of its series in time, for short times.

    Args:
        goal: time times the square root of mu, m^1.5.
        r0: radius, m.
        sigma: r.v over the square root of mu, m^0.5.
        alpha: reciprocal of the semi-major axis, 1/m.
        high: upper bound, m^0.5; inf: none.
    """
    inverse = 1.0 / r0
    y = goal * inverse
    b = 0.5 * sigma * inverse
    c = (inverse - alpha) * (1.0 / 6.0)
    d = -alpha * b * (1.0 / 12.0)
    e = -alpha * c * (1.0 / 20.0)
    bb = b * b
    third = 2.0 * bb - c
    fourth = b * (5.0 * (c - bb)) - d
    fifth = 6.0 * b * d + 3.0 * c * c + 7.0 * bb * (2.0 * bb - 3.0 * c) - e
    x = y * (1.0 + y * (-b + y * (third + y * (fourth + y * fifth))))
    if not abs(x - y) < 0.5 * y:
        if alpha > 0.0:
            x = alpha * goal
        else:
            # a cube root bounds the anomaly where the cubic term dominates
            x = min(y, (6.0 * goal) ** (1.0 / 3.0))
        if not 0.0 < x < high:
            x = 0.5 * high
    return x


@kernel
def _solve(goal: float, r0: float, sigma: float, alpha: float, high: float) -> Universal:
    """Solve Kepler's equation for the universal functions; arguments as in :func:`first_anomaly`.

    It is monotone in the universal anomaly and solved by Laguerre-Conway steps inside a bracket,
    so that one loop serves ellipses, parabolas and hyperbolas and always ends.
    """
    low = 0.0
    x = first_anomaly(goal, r0, sigma, alpha, high)
    functions = (1.0, 0.0, 0.0, 0.0)
    for _ in range(_MAX_ITERATIONS):
        functions = universal_functions(x, alpha)
        radius, reached = _radius_and_time(functions, r0, sigma)
        error = reached - goal
        if error > 0.0 or not math.isfinite(error):
            high = x
        else:
            low = x
        slope = sigma * functions[0] + (1.0 - alpha * r0) * functions[1]
        # Laguerre-Conway, degree 5
        root = math.sqrt(abs(16.0 * radius * radius - 20.0 * error * slope))
        step = -5.0 * error / (radius + root)
        if abs(step) <= _TOLERANCE * x:
            return _further(functions, step, alpha)
        if abs(step) <= _SHORT * x and abs(alpha) * step * step <= _SHORT_Z:
            near = _further(functions, step, alpha)
            radius, reached = _radius_and_time(near, r0, sigma)
            rest = (goal - reached) / radius
            if abs(rest) <= _LAST * x:
                return _further(near, rest, alpha)
        trial = x + step
        if not low < trial < high:
            trial = 2.0 * x if high == math.inf else 0.5 * (low + high)
            if trial in (low, high):
                break
        x = trial
    return functions


@kernel
def kepler(r: Vector, v: Vector, dt: float, mu: float) -> tuple[Vector, Vector]:
    """Propagate position and velocity along the conic by ``dt`` s, backwards if negative.

    Args:
        r: position, m.
        v: velocity, m/s.
        dt: time, s. Whole revolutions are removed first.
        mu: gravitational parameter, m3/s2.

    Returns:
        Position (m) and velocity (m/s); nan if an input is not finite.
    """
    if dt == 0.0:
        return r, v
    root_mu = math.sqrt(mu)
    r0 = norm(r)
    inverse = 1.0 / r0
    alpha = 2.0 * inverse - dot(v, v) / mu

    if not math.isfinite(dt + alpha + r0):
        nowhere = (math.nan, math.nan, math.nan)
        return nowhere, nowhere

    # backward motion is forward motion with reversed velocity
    sign = 1.0 if dt > 0.0 else -1.0
    sigma = sign * dot(r, v) / root_mu
    time = sign * dt
    high = math.inf
    goal = root_mu * time
    if alpha > 0.0:
        if goal * goal * (alpha * alpha * alpha) > 4.0 * math.pi * math.pi:
            revolution = 2.0 * math.pi / (alpha * math.sqrt(alpha) * root_mu)
            time -= revolution * math.floor(time / revolution)
            goal = root_mu * time
        high = 2.0 * math.pi / math.sqrt(alpha)

    functions = _solve(goal, r0, sigma, alpha, high)
    radius, _ = _radius_and_time(functions, r0, sigma)
    _, u1, u2, u3 = functions

    f = 1.0 - u2 * inverse
    # both forms of g are exact; use the one without cancellation
    g = (r0 * u1 + sigma * u2) / root_mu if sigma >= 0.0 else time - u3 / root_mu
    along = 1.0 / radius
    f_dot = -root_mu * u1 * along * inverse
    g_dot = 1.0 - u2 * along
    return (
        axpy(sign * g, v, scale(f, r)),
        axpy(g_dot, v, scale(sign * f_dot, r)),
    )
