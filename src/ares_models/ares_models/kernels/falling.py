# SPDX-License-Identifier: Apache-2.0
"""Fall of a body without thrust through the air, down to altitude zero.

A point mass under gravity with J2 and drag against its velocity w in the air, which turns with the
body and has its wind: a = g - 0.5 rho |w| w / beta; beta = m / (Cd A) is the ballistic coefficient.
Runge-Kutta 5(4) with step control: J. R. Dormand and P. J. Prince, *A family of embedded
Runge-Kutta formulae*, J. Comp. Appl. Math. 6 (1980), table 2.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.environment import (
    air_velocity,
    altitude,
    altitude_gradient,
    density,
    gravity,
    relative_velocity,
    vertical_stretch,
)
from ares_models.kernels.impact import fall, ground_direction
from ares_models.kernels.vectors import Vector, axpy, dot, load, norm, scale, store

#: Errors of position, m, and velocity, m/s, allowed in a step.
_POSITION_ERROR, _VELOCITY_ERROR = 0.01, 1e-4
#: Steps, s: the first, and the least one.
_FIRST_STEP, _LEAST_STEP = 1.0, 1e-3
#: Largest number of steps of a fall, and of iterations to the ground.
_MOST_STEPS, _MOST_ITERATIONS = 20_000, 30
#: Tolerance of the altitude of an impact, m.
_ON_GROUND = 1e-4


@kernel
def _pull(
    r: Vector,
    v: Vector,
    coefficient: float,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> Vector:
    """Compute the acceleration by gravity and drag, m/s2."""
    g = gravity(r, environment)
    if math.isinf(coefficient):
        return g
    w = air_velocity(r, v, environment)
    return axpy(-0.5 * density(r, environment, atmosphere) * norm(w) / coefficient, w, g)


@kernel
def _step(
    h: float,
    r: Vector,
    v: Vector,
    coefficient: float,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> tuple[Vector, Vector, float]:
    """Make one step of length ``h``, s; return the state and its error over the allowed one."""
    a = _pull(r, v, coefficient, environment, atmosphere)
    v2 = axpy(h / 5.0, a, v)
    r2 = axpy(h / 5.0, v, r)
    a2 = _pull(r2, v2, coefficient, environment, atmosphere)
    v3 = axpy(h * 9.0 / 40.0, a2, axpy(h * 3.0 / 40.0, a, v))
    r3 = axpy(h * 9.0 / 40.0, v2, axpy(h * 3.0 / 40.0, v, r))
    a3 = _pull(r3, v3, coefficient, environment, atmosphere)
    k1, k2, k3 = h * 44.0 / 45.0, -h * 56.0 / 15.0, h * 32.0 / 9.0
    v4 = axpy(k3, a3, axpy(k2, a2, axpy(k1, a, v)))
    r4 = axpy(k3, v3, axpy(k2, v2, axpy(k1, v, r)))
    a4 = _pull(r4, v4, coefficient, environment, atmosphere)
    k1, k2 = h * 19372.0 / 6561.0, -h * 25360.0 / 2187.0
    k3, k4 = h * 64448.0 / 6561.0, -h * 212.0 / 729.0
    v5 = axpy(k4, a4, axpy(k3, a3, axpy(k2, a2, axpy(k1, a, v))))
    r5 = axpy(k4, v4, axpy(k3, v3, axpy(k2, v2, axpy(k1, v, r))))
    a5 = _pull(r5, v5, coefficient, environment, atmosphere)
    k1, k2, k3 = h * 9017.0 / 3168.0, -h * 355.0 / 33.0, h * 46732.0 / 5247.0
    k4, k5 = h * 49.0 / 176.0, -h * 5103.0 / 18656.0
    v6 = axpy(k5, a5, axpy(k4, a4, axpy(k3, a3, axpy(k2, a2, axpy(k1, a, v)))))
    r6 = axpy(k5, v5, axpy(k4, v4, axpy(k3, v3, axpy(k2, v2, axpy(k1, v, r)))))
    a6 = _pull(r6, v6, coefficient, environment, atmosphere)
    k1, k3, k4 = h * 35.0 / 384.0, h * 500.0 / 1113.0, h * 125.0 / 192.0
    k5, k6 = -h * 2187.0 / 6784.0, h * 11.0 / 84.0
    v7 = axpy(k6, a6, axpy(k5, a5, axpy(k4, a4, axpy(k3, a3, axpy(k1, a, v)))))
    r7 = axpy(k6, v6, axpy(k5, v5, axpy(k4, v4, axpy(k3, v3, axpy(k1, v, r)))))
    a7 = _pull(r7, v7, coefficient, environment, atmosphere)
    # difference to the embedded formula of order 4
    k1, k3, k4 = h * 71.0 / 57600.0, -h * 71.0 / 16695.0, h * 71.0 / 1920.0
    k5, k6, k7 = -h * 17253.0 / 339200.0, h * 22.0 / 525.0, -h / 40.0
    off_v = axpy(k7, a7, axpy(k6, a6, axpy(k5, a5, axpy(k4, a4, axpy(k3, a3, scale(k1, a))))))
    off_r = axpy(k7, v7, axpy(k6, v6, axpy(k5, v5, axpy(k4, v4, axpy(k3, v3, scale(k1, v))))))
    return r7, v7, max(norm(off_r) / _POSITION_ERROR, norm(off_v) / _VELOCITY_ERROR)


@kernel
def _land(
    h: float,
    r: Vector,
    v: Vector,
    coefficient: float,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> tuple[float, Vector, Vector]:
    """Find the impact within a step of ``h`` s that ends below the ground: time, s, and state."""
    span = h
    low, high = 0.0, h
    end, speed, _ = _step(span, r, v, coefficient, environment, atmosphere)
    for _ in range(_MOST_ITERATIONS):
        height = altitude(end, environment)
        if abs(height) < _ON_GROUND:
            break
        if height > 0.0:
            low = span
        else:
            high = span
        span -= height / dot(altitude_gradient(end, environment), speed)
        if not low < span < high:
            span = 0.5 * (low + high)
        end, speed, _ = _step(span, r, v, coefficient, environment, atmosphere)
    return span, end, speed


@kernel
def come_down(
    r: Vector,
    v: Vector,
    coefficient: float,
    longest: float,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> tuple[float, Vector, Vector]:
    """Follow a body without thrust to the ground.

    Args:
        r: position, m.
        v: inertial velocity, m/s.
        coefficient: ballistic coefficient, kg/m2; inf: without drag.
        longest: s, at which it is left in flight; inf: not before the ground.
        environment: record ENVIRONMENT.
        atmosphere: as in ``kernels/environment.py``.

    Returns:
        time, s, position and velocity on the ground, or at ``longest``. The time is nan if it does
        not come down: after one revolution its perigee is above the ground, or it escapes, or it
        floats for more than _MOST_STEPS steps.
    """
    alpha = 2.0 / norm(r) - dot(v, v) / environment.mu
    revolution = 0.0
    if alpha > 0.0:
        revolution = 2.0 * math.pi / (alpha * math.sqrt(alpha * environment.mu))
    now, h = 0.0, _FIRST_STEP
    for _ in range(_MOST_STEPS):
        if altitude(r, environment) <= 0.0 and dot(r, v) <= 0.0:
            return now, r, v
        if now >= longest:
            return now, r, v
        if now >= revolution and math.isnan(fall(r, v, environment)[0]):
            break
        h = min(h, longest - now)
        end, speed, error = _step(h, r, v, coefficient, environment, atmosphere)
        if error > 1.0 and h > _LEAST_STEP:
            h = max(_LEAST_STEP, h * max(0.2, 0.9 * error**-0.2))
            continue
        if altitude(end, environment) < 0.0 < altitude(r, environment):
            span, end, speed = _land(h, r, v, coefficient, environment, atmosphere)
            return now + span, end, speed
        now, r, v = now + h, end, speed
        h *= min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
    return math.nan, r, v


@kernel
def follow_fall(
    piece: Record,
    factor: float,
    environment: Record,
    atmosphere: NDArray[np.float64],
    found: Record,
) -> None:
    """Find where a piece comes down.

    Args:
        piece: record PIECE.
        factor: on its ballistic coefficient.
        environment: record ENVIRONMENT.
        atmosphere: as in ``kernels/environment.py``.
        found: record FALL with the state at the separation; the rest is filled.
    """
    coefficient = math.inf
    if piece.coefficient > 0.0:
        coefficient = piece.coefficient
    elif piece.area > 0.0:
        coefficient = found.mass / piece.area
    coefficient *= factor
    found.coefficient = coefficient
    start = load(found.position), load(found.velocity)
    span, r, v = come_down(start[0], start[1], coefficient, math.inf, environment, atmosphere)
    found.down_time = found.time + span
    if math.isnan(span):
        found.speed = found.latitude = found.longitude = math.nan
        store(found.place, (math.nan, math.nan, math.nan))
        return
    place = ground_direction(r, found.down_time, environment)
    store(found.place, place)
    found.speed = norm(relative_velocity(r, v, environment))
    across = math.sqrt(place[0] * place[0] + place[1] * place[1])
    found.latitude = math.atan2(vertical_stretch(environment) * place[2], across)
    found.longitude = math.atan2(place[1], place[0])
