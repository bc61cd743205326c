"""Two-body motion in closed form, in universal variables.

Sources: Battin, *An Introduction to the Mathematics and Methods of Astrodynamics*,
section 4.5 (universal functions U0..U3, Lagrange coefficients); Conway, "An improved
algorithm due to Laguerre for the solution of Kepler's equation", Celest. Mech. 39 (1986).
"""

import math

from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, axpy, dot, norm, scale

_MAX_ITERATIONS = 80
_TOLERANCE = 1.0e-6  # of the anomaly; convergence is cubic: after this step it is exact


@kernel
def universal_functions(anomaly: float, alpha: float) -> tuple[float, float, float, float]:
    """Universal functions U0..U3 of Battin, Eq. 4.71 onwards.

    Args:
        anomaly: universal anomaly chi, m^0.5.
        alpha: reciprocal of the semi-major axis, 1/m; negative on a hyperbola.

    Returns:
        U0 (no unit), U1 (m^0.5), U2 (m), U3 (m^1.5). Overflow gives inf.
    """
    z = alpha * anomaly * anomaly
    if abs(z) < 1.0:
        # power series of the Stumpff functions c2 and c3; the parabola lies inside it
        c2 = 1.0 - z * (1.0 / 306.0)
        c2 = 1.0 - z * (1.0 / 240.0) * c2
        c2 = 1.0 - z * (1.0 / 182.0) * c2
        c2 = 1.0 - z * (1.0 / 132.0) * c2
        c2 = 1.0 - z * (1.0 / 90.0) * c2
        c2 = 1.0 - z * (1.0 / 56.0) * c2
        c2 = 1.0 - z * (1.0 / 30.0) * c2
        c2 = 0.5 * (1.0 - z * (1.0 / 12.0) * c2)
        c3 = 1.0 - z * (1.0 / 342.0)
        c3 = 1.0 - z * (1.0 / 272.0) * c3
        c3 = 1.0 - z * (1.0 / 210.0) * c3
        c3 = 1.0 - z * (1.0 / 156.0) * c3
        c3 = 1.0 - z * (1.0 / 110.0) * c3
        c3 = 1.0 - z * (1.0 / 72.0) * c3
        c3 = 1.0 - z * (1.0 / 42.0) * c3
        c3 = (1.0 - z * (1.0 / 20.0) * c3) / 6.0
        return (
            1.0 - z * c2,
            anomaly * (1.0 - z * c3),
            anomaly * anomaly * c2,
            anomaly * anomaly * anomaly * c3,
        )
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
def first_anomaly(goal: float, r0: float, sigma: float, alpha: float, high: float) -> float:
    """Universal anomaly by reversion of the series in time: good for all that guidance asks.

    Args:
        goal: time times the root of mu, m^1.5.
        r0: radius, m.
        sigma: r.v over the root of mu, m^0.5.
        alpha: reciprocal of the semi-major axis, 1/m.
        high: upper bound, m^0.5; inf: none.
    """
    y = goal / r0
    b = 0.5 * sigma / r0
    c = (1.0 / r0 - alpha) / 6.0
    d = -alpha * b / 12.0
    e = -alpha * c / 20.0
    bb = b * b
    third = 2.0 * bb - c
    fourth = b * (5.0 * (c - bb)) - d
    fifth = 6.0 * b * d + 3.0 * c * c + 7.0 * bb * (2.0 * bb - 3.0 * c) - e
    x = y * (1.0 + y * (-b + y * (third + y * (fourth + y * fifth))))
    if not abs(x - y) < 0.5 * y:
        if alpha > 0.0:
            x = alpha * goal
        else:
            # a cube root bounds the anomaly where the cubic term rules
            x = min(y, (6.0 * goal) ** (1.0 / 3.0))
        if not 0.0 < x < high:
            x = 0.5 * high
    return x


@kernel
def kepler(r: Vector, v: Vector, dt: float, mu: float) -> tuple[Vector, Vector]:
    """Position and velocity ``dt`` seconds later (earlier if negative) on the conic.

    Kepler's equation is monotone in the universal anomaly; it is solved by
    Laguerre-Conway steps held inside a bracket, so that ellipses, parabolas and
    hyperbolas take the same way and the loop always ends.

    Args:
        r: position, m.
        v: velocity, m/s.
        dt: time to go along the conic, s. Whole revolutions are taken off first.
        mu: gravitational parameter, m3/s2.

    Returns:
        Position (m) and velocity (m/s); nan if an input is not finite.
    """
    if dt == 0.0:
        return r, v
    root_mu = math.sqrt(mu)
    r0 = norm(r)
    alpha = 2.0 / r0 - dot(v, v) / mu

    if not math.isfinite(dt + alpha + r0):
        nowhere = (math.nan, math.nan, math.nan)
        return nowhere, nowhere

    # motion backwards is motion forwards with the velocity turned round
    sign = 1.0 if dt > 0.0 else -1.0
    sigma = sign * dot(r, v) / root_mu
    time = sign * dt
    low = 0.0
    high = math.inf
    if alpha > 0.0:
        revolution = 2.0 * math.pi / (alpha * math.sqrt(alpha) * root_mu)
        if time > revolution:
            time -= revolution * math.floor(time / revolution)
        high = 2.0 * math.pi / math.sqrt(alpha)
    goal = root_mu * time

    x = first_anomaly(goal, r0, sigma, alpha, high)
    u0 = 1.0
    u1 = 0.0
    u2 = 0.0
    u3 = 0.0
    for _ in range(_MAX_ITERATIONS):
        u0, u1, u2, u3 = universal_functions(x, alpha)
        radius = r0 * u0 + sigma * u1 + u2
        error = r0 * u1 + sigma * u2 + u3 - goal
        if error > 0.0 or not math.isfinite(error):
            high = x
        else:
            low = x
        slope = sigma * u0 + (1.0 - alpha * r0) * u1
        # Laguerre-Conway, degree 5
        root = math.sqrt(abs(16.0 * radius * radius - 20.0 * error * slope))
        step = -5.0 * error / (radius + root)
        trial = x + step
        if abs(step) <= _TOLERANCE * x:
            # so short a step needs no more than the Taylor series: U(k)' = U(k-1)
            half = 0.5 * step
            u3 += step * (u2 + half * u1)
            u2 += step * (u1 + half * u0)
            u1, u0 = (
                u1 + step * (u0 - half * alpha * u1),
                u0 - step * alpha * (u1 + half * u0),
            )
            break
        if not low < trial < high:
            trial = 2.0 * x if high == math.inf else 0.5 * (low + high)
            if trial in (low, high):
                break
        x = trial
    radius = r0 * u0 + sigma * u1 + u2

    f = 1.0 - u2 / r0
    # both forms of g are exact; take the one that does not cancel
    g = (r0 * u1 + sigma * u2) / root_mu if sigma >= 0.0 else time - u3 / root_mu
    f_dot = -root_mu * u1 / (radius * r0)
    g_dot = 1.0 - u2 / radius
    return (
        axpy(sign * g, v, scale(f, r)),
        axpy(g_dot, v, scale(sign * f_dot, r)),
    )
