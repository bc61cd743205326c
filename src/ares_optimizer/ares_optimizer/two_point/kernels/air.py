# SPDX-License-Identifier: Apache-2.0
"""Propagate an extremal through the air.

The thrust direction maximizes the Hamiltonian, within the limit of q alpha: with p = lambda_v,

    H = lambda_r . v + p . (g + (F + T u) / m),

F the force of the air on the body and T the thrust less ambient pressure, both of which change with
the state (Dukeman, AIAA 2002-4559; Lu and Pan, J. Guidance 33, 2010). A state is r, v, p, q with
q = -lambda_r, as in :mod:`.costates`.
"""

import math
from typing import NamedTuple

from ares_models.arrays import COAST, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import (
    air_at,
    body_force_with_gradient,
    has_attitude,
    local_vertical,
    pressure_loss_terms,
)
from ares_models.kernels.environment import (
    air_velocity,
    altitude,
    altitude_gradient,
    pulled_back,
)
from ares_models.kernels.vectors import Vector, add, axpy, dot, norm, scale, unit
from ares_optimizer.kernels.timetable import segment_mass, segment_thrust
from ares_optimizer.two_point.arrays import Gravity
from ares_optimizer.two_point.kernels.gravity import gravity_terms

#: Longest steps in the air and above it, s.
STEP, STEP_ABOVE = 3.0, 20.0
#: Least sine between the primer and the velocity in the air that has a plane.
_LEAST_SINE = 1e-9


class Extremal(NamedTuple):
    """Hold position, m, velocity, m/s, primer, and its rate in vacuum, -lambda_r, 1/s."""

    r: Vector
    v: Vector
    p: Vector
    q: Vector


class BestDirection(NamedTuple):
    """Hold the direction that maximizes the Hamiltonian, within the limit of q alpha.

    Attributes:
        u: unit vector.
        by_w: change of its part along the primer with the velocity in the air, s/m; 0: unlimited.
        by_h: the same with the altitude, 1/m.
    """

    u: Vector
    by_w: Vector
    by_h: float


@kernel
def _limited(
    wanted: Vector, w: Vector, limit: float, pressure: float, slope: float
) -> BestDirection:
    """Return the direction next to ``wanted`` whose sine of the angle of attack is limited.

    Args:
        wanted: unit vector.
        w: velocity in the air, m/s.
        limit: of q sin(angle of attack), Pa.
        pressure: dynamic pressure q, Pa.
        slope: of the logarithm of density, 1/m.
    """
    speed = norm(w)
    ahead = scale(1.0 / speed, w)
    along = dot(wanted, ahead)
    across = axpy(-along, ahead, wanted)
    size = norm(across)
    sine = limit / pressure
    free = (0.0, 0.0, 0.0)
    if sine >= 1.0 or size < _LEAST_SINE or (size <= sine and along > 0.0):
        return BestDirection(wanted, free, 0.0)
    cosine = math.sqrt(1.0 - sine * sine)
    u = axpy(sine / size, across, scale(cosine, ahead))
    # by the direction of the air, and by the limit as q changes: d sine = -sine d(ln q)
    turn = (cosine - sine * along / size) / speed
    gain = size * cosine - sine * along
    shrink = -gain * sine / cosine
    by_w = axpy(turn, across, scale(2.0 * shrink / (speed * speed), w))
    return BestDirection(u, by_w, shrink * slope)


@kernel
def steering_in_air(
    arc: Record, r: Vector, v: Vector, p: Vector, thrust: float, mission: MissionRecords
) -> BestDirection:
    """Return the thrust direction of an extremal.

    Args:
        arc: record ARC.
        r: position, m.
        v: velocity, m/s.
        p: primer.
        thrust: less ambient pressure, N.
        mission: environment and atmosphere are read.
    """
    environment, atmosphere = mission.environment, mission.atmosphere
    if arc.vertical == 1:
        return BestDirection(local_vertical(r, environment), (0.0, 0.0, 0.0), 0.0)
    wanted = unit(p)
    if has_attitude(arc):
        up = altitude_gradient(r, environment)
        force = body_force_with_gradient(arc, r, v, wanted, up, environment, atmosphere)
        pull = (dot(force.turned[0], p), dot(force.turned[1], p), dot(force.turned[2], p))
        wanted = unit(axpy(thrust, p, pull))
    if math.isinf(arc.max_q_alpha):
        return BestDirection(wanted, (0.0, 0.0, 0.0), 0.0)
    air = air_at(altitude(r, environment), environment, atmosphere)
    w = air_velocity(r, v, environment)
    pressure = 0.5 * air.density * dot(w, w)
    return _limited(wanted, w, arc.max_q_alpha, pressure, air.density_slope)


@kernel
def rates(
    arc: Record, x: Extremal, thrust: float, mass: float, gravity: Gravity, mission: MissionRecords
) -> Extremal:
    """Return the derivatives of an extremal by time.

    Args:
        arc: record ARC.
        x: the extremal.
        thrust: in vacuum, N.
        mass: kg.
        gravity: the field.
        mission: environment and atmosphere are read.
    """
    environment, atmosphere = mission.environment, mission.atmosphere
    r, v, p = x.r, x.v, x.p
    up = altitude_gradient(r, environment)
    g, by_place = gravity_terms(r, gravity, p)
    acceleration, p_rate, q_rate = g, x.q, by_place
    per = 1.0 / mass
    steering = BestDirection((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
    if arc.kind != COAST and thrust > 0.0:
        lost, slope = pressure_loss_terms(arc, r, environment, atmosphere)
        net = thrust - lost
        steering = steering_in_air(arc, r, v, p, net, mission)
        u = steering.u
        acceleration = axpy(per * net, u, acceleration)
        q_rate = axpy(-per * slope * dot(u, p), up, q_rate)
        # the limit of q alpha moves with the state
        k = per * net * norm(p)
        by_w = scale(k, steering.by_w)
        p_rate = axpy(-1.0, by_w, p_rate)
        q_rate = add(q_rate, axpy(k * steering.by_h, up, pulled_back(r, by_w, environment)))
    if arc.drag_area > 0.0:
        force = body_force_with_gradient(arc, r, v, steering.u, up, environment, atmosphere)
        acceleration = axpy(per, force.force, acceleration)
        by_r = (dot(force.by_x, p), dot(force.by_y, p), dot(force.by_z, p))
        by_v = (dot(force.by_u, p), dot(force.by_v, p), dot(force.by_w, p))
        p_rate = axpy(-per, by_v, p_rate)
        q_rate = axpy(per, by_r, q_rate)
    return Extremal(v, acceleration, p_rate, q_rate)


@kernel
def moved(x: Extremal, h: float, k: Extremal) -> Extremal:
    """Return an extremal after a step along some derivatives."""
    return Extremal(axpy(h, k.r, x.r), axpy(h, k.v, x.v), axpy(h, k.p, x.p), axpy(h, k.q, x.q))


@kernel
def step_in_air(
    arc: Record,
    segment: Record,
    t: float,
    h: float,
    x: Extremal,
    gravity: Gravity,
    mission: MissionRecords,
) -> Extremal:
    """Return an extremal after one Runge-Kutta step of ``h`` s from the time ``t`` on.

    Args: as in :func:`rates`;
        segment: record SEGMENT, with thrust and mass.
        t: s.
        h: s.
    """
    half, end = t + 0.5 * h, t + h
    mass, thrust = segment_mass(segment, half), segment_thrust(segment, half)
    k1 = rates(arc, x, segment_thrust(segment, t), segment_mass(segment, t), gravity, mission)
    k2 = rates(arc, moved(x, 0.5 * h, k1), thrust, mass, gravity, mission)
    k3 = rates(arc, moved(x, 0.5 * h, k2), thrust, mass, gravity, mission)
    ahead = moved(x, h, k3)
    k4 = rates(
        arc, ahead, segment_thrust(segment, end), segment_mass(segment, end), gravity, mission
    )
    x = moved(moved(x, h / 6.0, k1), h / 3.0, k2)
    return moved(moved(x, h / 3.0, k3), h / 6.0, k4)


@kernel
def fly_in_air(
    segment: Record, air_end: float, gravity: Gravity, mission: MissionRecords, work: Record
) -> int:
    """Propagate ``work.state`` over a segment; return the number of steps.

    Args:
        segment: record SEGMENT.
        air_end: time from which the forces of the air are small, s.
        gravity: the field.
        mission: its records.
        work: record WORK; the greatest share of a limit of q is kept.
    """
    state = work.state
    arc = mission.arcs[segment.arc]
    x = Extremal(
        (state[0], state[1], state[2]),
        (state[3], state[4], state[5]),
        (state[6], state[7], state[8]),
        (state[9], state[10], state[11]),
    )
    t, count = segment.start, 0
    while t < segment.end - 1e-9:
        within = min(segment.end, air_end) - t if t < air_end - 1e-9 else segment.end - t
        longest = STEP if t < air_end - 1e-9 else STEP_ABOVE
        h = within / math.ceil(within / longest)
        x = step_in_air(arc, segment, t, h, x, gravity, mission)
        t += h
        count += 1
        if math.isfinite(arc.max_dynamic_pressure):
            air = air_at(
                altitude(x.r, mission.environment), mission.environment, mission.atmosphere
            )
            w = air_velocity(x.r, x.v, mission.environment)
            share = 0.5 * air.density * dot(w, w) / arc.max_dynamic_pressure
            work.pressure_share = max(work.pressure_share, share)
    for i in range(3):
        state[i] = x.r[i]
        state[3 + i] = x.v[i]
        state[6 + i] = x.p[i]
        state[9 + i] = x.q[i]
    return count
