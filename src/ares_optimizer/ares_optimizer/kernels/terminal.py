# SPDX-License-Identifier: Apache-2.0
"""Write terminal sets (Eq. 3.1) as equations with gradients.

Every row is scaled: 1 is one hundredth of the size of the orbit, of its speed, or of a radian. All
rows are smooth where the elements are singular: a plane is two components of the unit normal, an
apse line two components of the eccentricity vector.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, axpy, cross, dot, norm, scale
from ares_optimizer.kernels.elements import element_rows

Array = NDArray[np.float64]

MAX_ROWS = 6
SCALE = 100.0
_EQUATORIAL = 1e-6  # sine of the inclination below which the node is undefined


@kernel
def put_row(row: Array, by_position: Vector, by_velocity: Vector) -> None:
    """Write one row of the gradient by position and velocity."""
    for c in range(3):
        row[c] = by_position[c]
        row[3 + c] = by_velocity[c]


@kernel
def normal_component(r: Vector, v: Vector, axis: Vector, row: Array) -> float:
    """Return a component of the unit normal of the orbit; write its gradient."""
    h = cross(r, v)
    size = norm(h)
    value = dot(h, axis) / size
    w = scale(SCALE / size, axpy(-value / size, h, axis))
    put_row(row, cross(v, w), cross(w, r))
    return value


@kernel
def point_rows(target: Record, r: Vector, v: Vector, c: Array, gradient: Array) -> None:
    """Write the first three rows of a point of an orbit: radius, speed, flight-path angle."""
    radius = norm(r)
    speed = norm(v)
    zero = (0.0, 0.0, 0.0)
    s = SCALE / target.radius
    c[0] = s * (radius - target.radius)
    put_row(gradient[0], scale(s / radius, r), zero)
    s = SCALE / target.speed
    c[1] = s * (speed - target.speed)
    put_row(gradient[1], zero, scale(s / speed, v))
    sine = dot(r, v) / (radius * speed)
    c[2] = SCALE * (sine - math.sin(target.flight_path_angle))
    s = SCALE / (radius * speed)
    put_row(
        gradient[2],
        scale(s, axpy(-sine * speed / radius, r, v)),
        scale(s, axpy(-sine * radius / speed, v, r)),
    )


@kernel
def eccentricity_component(mu: float, r: Vector, v: Vector, axis: Vector, row: Array) -> float:
    """Return a component of the eccentricity vector; write its gradient."""
    radius = norm(r)
    speed = norm(v)
    along = dot(r, v)
    x = dot(r, axis)
    y = dot(v, axis)
    q = speed * speed / mu - 1.0 / radius
    by_position = axpy(q, axis, axpy(x / (radius * radius * radius), r, scale(-y / mu, v)))
    by_velocity = axpy(2.0 * x / mu, v, axpy(-y / mu, r, scale(-along / mu, axis)))
    put_row(row, scale(SCALE, by_position), scale(SCALE, by_velocity))
    return q * x - along * y / mu


@kernel
def terminal_rows(
    target: Record, mu: float, r: Vector, v: Vector, c: Array, gradient: Array
) -> int:
    """Write values and gradients of the terminal equations; return the number of rows.

    Args:
        target: record TARGET.
        mu: m3/s2.
        r: m.
        v: m/s.
        c: shape (MAX_ROWS,), written: scaled residuals, zero on the target.
        gradient: shape (MAX_ROWS, 6), written: by position (1/m) and velocity (s/m).

    Returns:
        number of rows. TARGET_RADIUS_SPEED_ANGLE_*: radius, speed, flight-path angle, then
        inclination or plane. TARGET_KEPLERIAN: energy, two components of the eccentricity
        vector, plane. TARGET_ELEMENTS: the elements named, see ``elements``.
    """
    if target.kind == TARGET_ELEMENTS:
        return element_rows(target, mu, r, v, c, gradient, SCALE)
    radius = norm(r)
    speed = norm(v)
    if target.kind == TARGET_KEPLERIAN:
        a = target.semi_major_axis
        s = SCALE * a / mu
        c[0] = s * (0.5 * speed * speed - mu / radius + 0.5 * mu / a)
        put_row(gradient[0], scale(s * mu / (radius * radius * radius), r), scale(s, v))
    else:
        point_rows(target, r, v, c, gradient)
    si = math.sin(target.inclination)
    ci = math.cos(target.inclination)
    if target.kind == TARGET_RADIUS_SPEED_ANGLE_INCLINATION and abs(si) > _EQUATORIAL:
        c[3] = SCALE * (normal_component(r, v, (0.0, 0.0, 1.0), gradient[3]) - ci)
        return 4
    node = (math.cos(target.ascending_node), math.sin(target.ascending_node), 0.0)
    if target.kind == TARGET_RADIUS_SPEED_ANGLE_INCLINATION:
        node = (1.0, 0.0, 0.0)
    across = (-ci * node[1], ci * node[0], si)
    c[3] = SCALE * normal_component(r, v, node, gradient[3])
    c[4] = SCALE * normal_component(r, v, across, gradient[4])
    if target.kind != TARGET_KEPLERIAN:
        return 5
    cw = math.cos(target.argument_of_perigee)
    sw = math.sin(target.argument_of_perigee)
    # components towards perigee, and 90 deg ahead of it
    towards = axpy(sw, across, scale(cw, node))
    ahead = axpy(cw, across, scale(-sw, node))
    c[1] = SCALE * (eccentricity_component(mu, r, v, towards, gradient[1]) - target.eccentricity)
    c[2] = SCALE * eccentricity_component(mu, r, v, ahead, gradient[2])
    return 5
