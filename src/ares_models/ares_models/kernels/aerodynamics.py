# SPDX-License-Identifier: Apache-2.0
"""Compute the forces of the air: drag along the air speed, ambient pressure on the nozzles.

``arc`` is a record of dtype ``arrays.ARC``; ``environment`` and ``atmosphere`` are as in
``kernels/environment.py``. The air turns with the body, and may have a wind.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
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
    """

    force: Vector
    by_x: Vector
    by_y: Vector
    by_z: Vector
    by_u: Vector
    by_v: Vector
    by_w: Vector


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
def drag_coefficient(arc: Record, mach: float) -> tuple[float, float]:
    """Return the drag coefficient of an arc and its derivative by the Mach number."""
    return table_at(mach, arc.drag_mach, arc.drag_cubic, arc.drag_knots)


@kernel
def local_vertical(r: Vector, environment: Record) -> Vector:
    """Return the direction upwards: along the radius, or normal to the ellipsoid.

    The normal is that at the surface below; it is exact on the ground and 1e-6 rad off at 2 km.
    """
    return unit((r[0], r[1], vertical_stretch(environment) * r[2]))


@kernel
def drag(
    arc: Record, r: Vector, v: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> Vector:
    """Compute the drag, N: 0.5 rho V^2 S Cd(Mach) against the velocity in the air."""
    if arc.drag_area <= 0.0:
        return (0.0, 0.0, 0.0)
    air = air_at(altitude(r, environment), environment, atmosphere)
    w = air_velocity(r, v, environment)
    speed = math.sqrt(dot(w, w))
    coefficient, _ = drag_coefficient(arc, speed / air.sound)
    return scale(-0.5 * air.density * arc.drag_area * coefficient * speed, w)


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
def drag_with_gradient(
    arc: Record,
    r: Vector,
    v: Vector,
    up: Vector,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> Force:
    """Compute :func:`drag` with its gradients.

    Args:
        arc: record ARC.
        r: position, m.
        v: velocity, m/s.
        up: gradient of the altitude.
        environment: record ENVIRONMENT.
        atmosphere: see the module text.
    """
    air = air_at(altitude(r, environment), environment, atmosphere)
    w = air_velocity(r, v, environment)
    speed = math.sqrt(max(dot(w, w), AT_REST))
    mach = speed / air.sound
    coefficient, slope = drag_coefficient(arc, mach)
    k = -0.5 * air.density * arc.drag_area
    force = scale(k * coefficient * speed, w)
    # by the velocity in the air: Cd V I + (Cd / V + Cd' / a) w w^T
    even = k * coefficient * speed
    along = k * (coefficient / speed + slope / air.sound)
    by_u = axpy(even, (1.0, 0.0, 0.0), scale(along * w[0], w))
    by_v = axpy(even, (0.0, 1.0, 0.0), scale(along * w[1], w))
    by_w = axpy(even, (0.0, 0.0, 1.0), scale(along * w[2], w))
    # by altitude: density, and the speed of sound in the Mach number
    sound_slope = 0.5 * (air.pressure_slope - air.density_slope)
    by_h = scale(k * speed * (air.density_slope * coefficient - slope * mach * sound_slope), w)
    rate = environment.rotation_rate
    by_x = axpy(up[0], by_h, scale(-rate, by_v))
    by_y = axpy(up[1], by_h, scale(rate, by_u))
    by_z = scale(up[2], by_h)
    if not is_calm(environment):
        wind = wind_at(r, environment)
        by_x = sub(by_x, _along(wind.by_x, by_u, by_v, by_w))
        by_y = sub(by_y, _along(wind.by_y, by_u, by_v, by_w))
        by_z = sub(by_z, _along(wind.by_z, by_u, by_v, by_w))
    return Force(force, by_x, by_y, by_z, by_u, by_v, by_w)


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
