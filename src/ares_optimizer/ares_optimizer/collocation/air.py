# SPDX-License-Identifier: Apache-2.0
"""Compute the motion in the air at a Radau point, with its gradient by the local variables.

Local variables are position, velocity, length of the phase, mass at its begin and, where it is
free, the thrust direction. Everything is in the units of the program.
"""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import (
    body_force,
    body_force_with_gradient,
    local_vertical,
    pressure_loss_terms,
)
from ares_models.kernels.environment import altitude_gradient, vertical_stretch
from ares_models.kernels.vectors import Vector, add, axpy, norm, scale
from ares_optimizer.collocation.arrays import COASTING, VERTICAL
from ares_optimizer.collocation.thrust import acceleration_terms, mass_after
from ares_optimizer.two_point.arrays import Gravity
from ares_optimizer.two_point.kernels.gravity import gravity_terms

Array = NDArray[np.float64]

#: Share of the full thrust below which what pressure leaves of it fades.
_FADING = 1e-3
#: Most local variables of a point.
LOCALS = 11
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@kernel
def local_count(phase: Record) -> int:
    """Return the number of local variables of a point of a phase."""
    return 8 if phase.steering == COASTING or phase.steering == VERTICAL else LOCALS


@kernel
def vector_at(x: Array, i: int) -> Vector:
    """Return three variables from ``i`` on."""
    return (x[i], x[i + 1], x[i + 2])


@kernel
def _direction(
    point: Record, phase: Record, mission: MissionRecords, x: Array, r: Vector
) -> Vector:
    """Return the thrust direction at a point, at the position ``r`` in any unit."""
    if phase.steering == COASTING:
        return (0.0, 0.0, 0.0)
    if phase.steering == VERTICAL:
        return local_vertical(r, mission.environment)
    return vector_at(x, point.control)


@kernel
def net_thrust(thrust: float, lost: float, full: float) -> tuple[float, float]:
    """Return the thrust less ambient pressure, N, and its slope by that difference.

    It fades where a motor burns out, instead of pointing backwards.

    Args:
        thrust: in vacuum, N.
        lost: to the pressure, N.
        full: greatest thrust of the burn, N.
    """
    net, least = thrust - lost, _FADING * full
    if net >= least or lost == 0.0:
        return net, 1.0
    part = least / (2.0 * least - net)
    return least * part, part * part


@kernel
def air_motion(
    point: Record, phase: Record, mission: MissionRecords, units: Vector, x: Array
) -> Vector:
    """Return the acceleration by thrust and air at a point.

    Args:
        point: record POINT.
        phase: record PHASE.
        mission: its records.
        units: of length, m, speed, m/s, and mass, kg.
        x: shape (n,), variables.
    """
    at = 6 * (point.node + point.number)
    r, v = scale(units[0], vector_at(x, at)), scale(units[1], vector_at(x, at + 3))
    arc = mission.arcs[phase.arc]
    length, mass = x[phase.length], x[phase.mass]
    left, _, _ = mass_after(phase, point.fraction, length, mass)
    per = units[0] / (units[1] * units[1] * units[2] * left)
    u = _direction(point, phase, mission, x, r)
    motion = scale(per, body_force(arc, r, v, u, mission.environment, mission.atmosphere))
    if phase.steering == COASTING:
        return motion
    a = acceleration_terms(phase, point.fraction, length, mass)[0]
    lost, _ = pressure_loss_terms(arc, r, mission.environment, mission.atmosphere)
    net, _ = net_thrust(a / per, lost, arc.thrust)
    return axpy(per * net, u, motion)


@kernel
def local_gradient(
    point: Record,
    phase: Record,
    mission: MissionRecords,
    units: Vector,
    field: Gravity,
    x: Array,
    gradient: Array,
) -> Vector:
    """Return the whole acceleration at a point; write its gradient by the local variables.

    Args: as in :func:`air_motion`;
        field: gravity in the units of the program.
        gradient: shape (3, LOCALS), written.
    """
    environment, atmosphere = mission.environment, mission.atmosphere
    at = 6 * (point.node + point.number)
    r, v = vector_at(x, at), vector_at(x, at + 3)
    place, velocity = scale(units[0], r), scale(units[1], v)
    arc = mission.arcs[phase.arc]
    length, mass = x[phase.length], x[phase.mass]
    left, left_l, left_m = mass_after(phase, point.fraction, length, mass)
    per = units[0] / (units[1] * units[1] * units[2] * left)
    up = altitude_gradient(place, environment)
    total, _ = gravity_terms(r, field, r)
    for c in range(3):
        _, by_r = gravity_terms(r, field, AXES[c])
        for i in range(3):
            gradient[c, i] = by_r[i]
            gradient[c, 3 + i] = 0.0
            gradient[c, 8 + i] = 0.0
    # forces of air and thrust over the mass that is left
    falling = (0.0, 0.0, 0.0)
    u = _direction(point, phase, mission, x, place)
    if arc.drag_area > 0.0:
        force = body_force_with_gradient(arc, place, velocity, u, up, environment, atmosphere)
        falling = scale(per, force.force)
        by_place = (force.by_x, force.by_y, force.by_z)
        by_velocity = (force.by_u, force.by_v, force.by_w)
        for i in range(3):
            for c in range(3):
                gradient[c, i] += per * units[0] * by_place[i][c]
                gradient[c, 3 + i] += per * units[1] * by_velocity[i][c]
                gradient[c, 8 + i] = per * force.turned[i][c]
    by_l, by_m = 0.0, 0.0
    if phase.steering != COASTING:
        a, by_l, by_m, _, _, _ = acceleration_terms(phase, point.fraction, length, mass)
        lost, pressure_slope = pressure_loss_terms(arc, place, environment, atmosphere)
        net, slope = net_thrust(a / per, lost, arc.thrust)
        # force by length and mass, without what the mass that is left makes of it
        by_l = slope * (by_l + a * left_l / left)
        by_m = slope * (by_m + a * left_m / left)
        falling = axpy(per * net, u, falling)
        for c in range(3):
            for i in range(3):
                gradient[c, i] -= per * slope * pressure_slope * units[0] * up[i] * u[c]
            gradient[c, 8 + c] += per * net
        if phase.steering == VERTICAL:
            _add_turn(environment, r, u, gradient)
    for c in range(3):
        gradient[c, 6] = by_l * u[c] - falling[c] * left_l / left
        gradient[c, 7] = by_m * u[c] - falling[c] * left_m / left
    return add(falling, total)


@kernel
def _add_turn(environment: Record, r: Vector, u: Vector, gradient: Array) -> None:
    """Add the change of a vertical direction with the position."""
    stretch = vertical_stretch(environment)
    size = norm((r[0], r[1], stretch * r[2]))
    for i in range(3):
        k = (stretch if i == 2 else 1.0) / size
        across = axpy(-u[i], u, AXES[i])
        for c in range(3):
            for j in range(3):
                gradient[c, i] += k * gradient[c, 8 + j] * across[j]
