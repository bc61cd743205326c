# SPDX-License-Identifier: Apache-2.0
"""Compute the forces of the air: on the body, and of the ambient pressure on the nozzles.

``arc`` is a record of dtype ``arrays.ARC``; ``environment`` and ``atmosphere`` are as in
``kernels/environment.py``. The air turns with the body, and may have a wind.

The force on the body is -0.5 rho V S (P w + Q V u) with the velocity in the air w, V = |w|, and the
thrust direction u. By drag and lift P = CD + CL x and Q = -CL, by axial and normal force P = N and
Q = CA - N x, where x is the cosine of the angle of attack and CL, N are per unit of its sine. In a
coast the body is along the air.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import COAST, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import (
    AT_REST,
    air_velocity,
    altitude,
    cubic_above,
    is_calm,
    row_below,
    table_at,
    vertical_stretch,
    wind_at,
)
from ares_models.kernels.vectors import Vector, add, axpy, dot, scale, sub, unit

#: Ratio of specific heats of air.
GAMMA = 1.4


class Air(NamedTuple):
    """Hold the air at an altitude.

    Attributes:
        density: kg/m3.
        density_slope: of its logarithm, 1/m.
        pressure: Pa.
        pressure_slope: of its logarithm, 1/m.
        sound: speed of sound, m/s.
    """

    density: float
    density_slope: float
    pressure: float
    pressure_slope: float
    sound: float


class Force(NamedTuple):
    """Hold a force and its gradients by position and velocity.

    Attributes:
        force: N.
        by_x, by_y, by_z: changes of the force with each coordinate, N/m.
        by_u, by_v, by_w: changes of the force with each component of the velocity, N s/m.
        turned: changes of the force with each component of the thrust direction, N.
    """

    force: Vector
    by_x: Vector
    by_y: Vector
    by_z: Vector
    by_u: Vector
    by_v: Vector
    by_w: Vector
    turned: tuple[Vector, Vector, Vector]


class Shares(NamedTuple):
    """Hold P and Q of the force, see the module text, with slopes by Mach number and cosine."""

    p: float
    q: float
    p_mach: float
    q_mach: float
    p_cosine: float
    q_cosine: float


@kernel
def is_in_air(arc: Record) -> bool:
    """Return whether forces of the air or a vertical rise are part of an arc."""
    flag: bool = arc.drag_area > 0.0 or arc.exit_area > 0.0 or arc.vertical == 1
    return flag


@kernel
def air_at(h: float, environment: Record, atmosphere: NDArray[np.float64]) -> Air:
    """Return the air at an altitude, m; the density factor changes density and temperature."""
    row = row_below(h, atmosphere)
    log_density, density_slope = cubic_above(h, atmosphere, row, 1)
    log_pressure, pressure_slope = cubic_above(h, atmosphere, row, 5)
    density = environment.density_factor * math.exp(log_density)
    sound = math.sqrt(GAMMA / environment.density_factor * math.exp(log_pressure - log_density))
    return Air(density, density_slope, math.exp(log_pressure), pressure_slope, sound)


@kernel
def has_attitude(arc: Record) -> bool:
    """Return whether the force depends on the angle of attack."""
    flag: bool = arc.kind != COAST and (arc.body_axes == 1 or arc.across_knots > 0)
    return flag


@kernel
def shares_of_force(arc: Record, mach: float, cosine: float) -> Shares:
    """Return the shares of the force at a Mach number and a cosine of the angle of attack."""
    along, slope = table_at(mach, arc.drag_mach, arc.drag_cubic, arc.drag_knots)
    if not has_attitude(arc):
        return Shares(along, 0.0, slope, 0.0, 0.0, 0.0)
    across, across_slope = 0.0, 0.0
    if arc.across_knots > 0:
        tables = arc.across_mach, arc.across_cubic
        across, across_slope = table_at(mach, tables[0], tables[1], arc.across_knots)
    if arc.body_axes == 1:
        q_mach = slope - across_slope * cosine
        return Shares(across, along - across * cosine, across_slope, q_mach, 0.0, -across)
    p_mach = slope + across_slope * cosine
    return Shares(along + across * cosine, -across, p_mach, -across_slope, across, 0.0)


@kernel
def local_vertical(r: Vector, environment: Record) -> Vector:
    """Return the direction upwards: along the radius, or normal to the ellipsoid.

    The normal is that at the surface below; it is exact on the ground and 1e-6 rad off at 2 km.
    """
    return unit((r[0], r[1], vertical_stretch(environment) * r[2]))


@kernel
def body_force(
    arc: Record,
    r: Vector,
    v: Vector,
    u: Vector,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> Vector:
    """Compute the force of the air on the body, N; see the module text.

    Args:
        arc: record ARC.
        r: position, m.
        v: velocity, m/s.
        u: of the thrust, unit vector.
        environment: record ENVIRONMENT.
        atmosphere: see the module text.
    """
    if arc.drag_area <= 0.0:
        return (0.0, 0.0, 0.0)
    air = air_at(altitude(r, environment), environment, atmosphere)
    w = air_velocity(r, v, environment)
    speed = math.sqrt(dot(w, w))
    k = -0.5 * air.density * arc.drag_area
    if not has_attitude(arc):
        shares = shares_of_force(arc, speed / air.sound, 1.0)
        return scale(k * shares.p * speed, w)
    cosine = dot(u, w) / math.sqrt(max(dot(w, w), AT_REST))
    shares = shares_of_force(arc, speed / air.sound, cosine)
    return axpy(k * speed * speed * shares.q, u, scale(k * shares.p * speed, w))


@kernel
def pressure_loss_terms(
    arc: Record, r: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> tuple[float, float]:
    """Compute the thrust that the ambient pressure takes, N, and its slope by altitude, N/m."""
    if arc.exit_area <= 0.0:
        return 0.0, 0.0
    air = air_at(altitude(r, environment), environment, atmosphere)
    lost = air.pressure * arc.exit_area
    return lost, lost * air.pressure_slope


@kernel
def pressure_loss(
    arc: Record, r: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> float:
    """Compute the thrust that the ambient pressure takes, N: p times the exit area."""
    lost, _ = pressure_loss_terms(arc, r, environment, atmosphere)
    return lost


@kernel
def body_force_with_gradient(
    arc: Record,
    r: Vector,
    v: Vector,
    u: Vector,
    up: Vector,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> Force:
    """Compute :func:`body_force` with its gradients.

    Args: as there;
        up: gradient of the altitude.
    """
    air = air_at(altitude(r, environment), environment, atmosphere)
    w = air_velocity(r, v, environment)
    speed = math.sqrt(max(dot(w, w), AT_REST))
    mach = speed / air.sound
    attitude = has_attitude(arc)
    cosine = dot(u, w) / speed if attitude else 1.0
    shares = shares_of_force(arc, mach, cosine)
    k = -0.5 * air.density * arc.drag_area
    force = scale(k * shares.p * speed, w)
    # by the velocity in the air: P V I + (P / V + P' / a) w w^T
    even = k * shares.p * speed
    along = k * (shares.p / speed + shares.p_mach / air.sound)
    by_u = axpy(even, (1.0, 0.0, 0.0), scale(along * w[0], w))
    by_v = axpy(even, (0.0, 1.0, 0.0), scale(along * w[1], w))
    by_w = axpy(even, (0.0, 0.0, 1.0), scale(along * w[2], w))
    # by altitude: density, and the speed of sound in the Mach number
    sound_slope = 0.5 * (air.pressure_slope - air.density_slope)
    even_h = air.density_slope * shares.p - shares.p_mach * mach * sound_slope
    by_h = scale(k * speed * even_h, w)
    turned = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if attitude:
        push = k * speed * speed
        force = axpy(push * shares.q, u, force)
        turned_h = air.density_slope * shares.q - shares.q_mach * mach * sound_slope
        by_h = axpy(push * turned_h, u, by_h)
        # by the cosine, and by the speed at a fixed cosine
        swing = axpy(push * shares.q_cosine, u, scale(k * speed * shares.p_cosine, w))
        faster = scale(k * (2.0 * shares.q + mach * shares.q_mach), u)
        by_u = _by_speed(by_u, swing, faster, _cosine_by(0, u, w, cosine, speed), w[0])
        by_v = _by_speed(by_v, swing, faster, _cosine_by(1, u, w, cosine, speed), w[1])
        by_w = _by_speed(by_w, swing, faster, _cosine_by(2, u, w, cosine, speed), w[2])
        turned = (
            axpy(w[0] / speed, swing, (push * shares.q, 0.0, 0.0)),
            axpy(w[1] / speed, swing, (0.0, push * shares.q, 0.0)),
            axpy(w[2] / speed, swing, (0.0, 0.0, push * shares.q)),
        )
    rate = environment.rotation_rate
    by_x = axpy(up[0], by_h, scale(-rate, by_v))
    by_y = axpy(up[1], by_h, scale(rate, by_u))
    by_z = scale(up[2], by_h)
    if not is_calm(environment):
        wind = wind_at(r, environment)
        by_x = sub(by_x, _along(wind.by_x, by_u, by_v, by_w))
        by_y = sub(by_y, _along(wind.by_y, by_u, by_v, by_w))
        by_z = sub(by_z, _along(wind.by_z, by_u, by_v, by_w))
    return Force(force, by_x, by_y, by_z, by_u, by_v, by_w, turned)


@kernel
def _cosine_by(i: int, u: Vector, w: Vector, cosine: float, speed: float) -> float:
    """Return the change of the cosine of the angle of attack with a component of ``w``."""
    return (u[i] - cosine * w[i] / speed) / speed


@kernel
def _by_speed(
    before: Vector, swing: Vector, faster: Vector, cosine_by: float, component: float
) -> Vector:
    """Add what the thrust direction's share changes with a component of the velocity."""
    return axpy(cosine_by, swing, axpy(component, faster, before))


@kernel
def _along(change: Vector, by_u: Vector, by_v: Vector, by_w: Vector) -> Vector:
    """Return the change of a force with a change of the velocity."""
    return add(scale(change[0], by_u), axpy(change[1], by_v, scale(change[2], by_w)))


@kernel
def mach_number(
    r: Vector, v: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> float:
    """Compute the Mach number."""
    air = air_at(altitude(r, environment), environment, atmosphere)
    w = air_velocity(r, v, environment)
    return math.sqrt(dot(w, w)) / air.sound
