# SPDX-License-Identifier: Apache-2.0
"""Integrate the motion of the plant, Eq. 2.1, over one step without events.

Every discontinuity of the thrust and every knot of a thrust-time curve ends a step, so that the
impulse is exact.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import body_force, is_in_air, local_vertical, pressure_loss
from ares_models.kernels.environment import air_velocity, density, gravity
from ares_models.kernels.sequence import SAME_TIME
from ares_models.kernels.steering import steered_direction
from ares_models.kernels.throttle import LIMITED, mass_after, throttle, throttle_regime
from ares_models.kernels.thrust_curve import flow_value, start_length, start_value, tail_value
from ares_models.kernels.vectors import (
    Vector,
    add,
    angle_between,
    axpy,
    cross,
    load,
    norm,
    scale,
    store,
    sub,
    unit,
)
from ares_vehicle_sim.arrays import Vehicle

#: Density above which the forces of the air are integrated with the motion, kg/m3; at 97 km.
THIN_AIR = 1e-6
#: Speed in the air below which a vehicle has no angle of attack, m/s.
SLOW_AIR = 1e-3


@kernel
def thrust_now(plant: Record, arcs: NDArray[Any], t: float) -> tuple[float, float]:
    """Compute thrust, N, and mass flow, kg/s, at time ``t`` within the present arc."""
    thrust = 0.0
    flow = 0.0
    arc = arcs[plant.arc]
    if plant.complete == 0 and arc.kind == BURN and plant.inserted == 0:
        into = t - plant.arc_start_time
        part = throttle(arc, plant.mass)
        thrust += start_value(arc, into) * part * arc.thrust
        flow += flow_value(arc, into) * part * arc.mass_flow
    if plant.tail_arc >= 0:
        tail = arcs[plant.tail_arc]
        fraction = tail_value(tail, t - plant.tail_start_time)
        thrust += fraction * tail.thrust
        flow += fraction * tail.mass_flow
    return thrust, flow


@kernel
def burns_steadily(plant: Record, arc: Record, t: float) -> bool:
    """Return whether only the present arc burns, at full thrust from ``t`` to its end."""
    if plant.tail_arc >= 0 or plant.inserted == 1 or plant.complete == 1 or arc.kind != BURN:
        return False
    if math.isfinite(arc.max_acceleration):
        return False
    return t - plant.arc_start_time >= start_length(arc)


@kernel
def throttled(plant: Record, arc: Record, t: float) -> bool:
    """Return whether the present arc burns under an acceleration limit after its start."""
    if plant.inserted == 1 or plant.complete == 1 or arc.kind != BURN:
        return False
    started = t - plant.arc_start_time >= start_length(arc)
    return started and math.isfinite(arc.max_acceleration)


@kernel
def commanded_direction(plant: Record, arcs: NDArray[Any], t: float) -> Vector:
    """Return the thrust direction at ``t``: commanded, or held since ignition; unit vector."""
    held = arcs[plant.arc].held == 1
    if plant.tail_arc >= 0:
        held = held or arcs[plant.tail_arc].held == 1
    if held:
        return load(plant.held_direction)
    return steered_direction(plant.command, t)


@kernel
def air_acceleration(
    mission: MissionRecords,
    arc: Record,
    state: tuple[Vector, Vector],
    thrust: float,
    mass: float,
    u: Vector,
) -> Vector:
    """Return the acceleration by thrust less ambient pressure, and by the air, m/s2."""
    environment = mission.environment
    r, v = state
    net = 0.0
    if thrust > 0.0:
        net = max(0.0, thrust - pressure_loss(arc, r, environment, mission.atmosphere))
    force = body_force(arc, r, v, u, environment, mission.atmosphere)
    return axpy(net / mass, u, scale(1.0 / mass, force))


@kernel
def note_loads(mission: MissionRecords, plant: Record) -> None:
    """Keep the greatest dynamic pressure, and the greatest q sin(angle of attack) of burns."""
    arc = mission.arcs[plant.arc]
    r = load(plant.position)
    w = air_velocity(r, load(plant.velocity), mission.environment)
    speed = norm(w)
    pressure = 0.5 * density(r, mission.environment, mission.atmosphere) * speed * speed
    plant.most_dynamic_pressure = max(plant.most_dynamic_pressure, pressure)
    share = pressure / arc.max_dynamic_pressure
    plant.dynamic_pressure_share = max(plant.dynamic_pressure_share, share)
    if arc.kind == BURN and speed > SLOW_AIR:
        across = pressure * norm(cross(load(plant.direction), w)) / speed
        plant.most_q_alpha = max(plant.most_q_alpha, across)
        plant.q_alpha_share = max(plant.q_alpha_share, across / arc.max_q_alpha)


@kernel
def limited_thrust(
    acceleration: float, directions: tuple[Vector, Vector, Vector]
) -> tuple[Vector, Vector, Vector]:
    """Return the thrust accelerations of a step at constant magnitude."""
    u0, um, u1 = directions
    return scale(acceleration, u0), scale(acceleration, um), scale(acceleration, u1)


@kernel
def step_directions(
    plant: Record, arcs: NDArray[Any], end: float, rate_limit: float
) -> tuple[Vector, Vector, Vector]:
    """Return the thrust directions at begin, middle and end of a step, for a limit in rad/s."""
    t = plant.time
    h = end - t
    u1 = commanded_direction(plant, arcs, end)
    if not math.isfinite(rate_limit):
        u0 = commanded_direction(plant, arcs, t)
        return u0, commanded_direction(plant, arcs, t + 0.5 * h), u1
    u0 = load(plant.direction)
    angle = angle_between(u0, u1)
    reach = rate_limit * h
    if angle > reach:
        across = unit(axpy(-math.cos(angle), u0, u1))
        u1 = add(scale(math.cos(reach), u0), scale(math.sin(reach), across))
    return u0, unit(add(u0, u1)), u1


@kernel
def integrate_in_air(
    mission: MissionRecords,
    plant: Record,
    end: float,
    directions: tuple[Vector, Vector, Vector],
    thrusts: Vector,
    masses: Vector,
) -> None:
    """Integrate to ``end`` in one step of Runge-Kutta 4, with the forces of the air.

    Args:
        mission: its records.
        plant: record PLANT.
        end: s.
        directions: of the thrust at begin, middle and end, where it is not vertical.
        thrusts: in vacuum, likewise, N, where they are not limited.
        masses: likewise, kg.
    """
    environment = mission.environment
    arc = mission.arcs[plant.arc]
    h = end - plant.time
    r = load(plant.position)
    v = load(plant.velocity)
    if arc.vertical == 1:
        up = local_vertical(r, environment)
        directions = (up, up, up)
    if throttled(plant, arc, plant.time):
        engine = (arc.exhaust_velocity, arc.mass_flow)
        kind, _ = throttle_regime(arc, engine, plant.mass)
        if kind == LIMITED:
            middle = mass_after(arc, engine, kind, plant.mass, 0.5 * h)
            masses = (plant.mass, middle, mass_after(arc, engine, kind, plant.mass, h))
            thrusts = scale(arc.max_acceleration, masses)
    s1 = air_acceleration(mission, arc, (r, v), thrusts[0], masses[0], directions[0])
    a1 = add(s1, gravity(r, environment))
    r2, v2 = axpy(0.5 * h, v, r), axpy(0.5 * h, a1, v)
    s2 = air_acceleration(mission, arc, (r2, v2), thrusts[1], masses[1], directions[1])
    a2 = add(s2, gravity(r2, environment))
    r3, v3 = axpy(0.5 * h, v2, r), axpy(0.5 * h, a2, v)
    s3 = air_acceleration(mission, arc, (r3, v3), thrusts[1], masses[1], directions[1])
    a3 = add(s3, gravity(r3, environment))
    r4, v4 = axpy(h, v3, r), axpy(h, a3, v)
    s4 = air_acceleration(mission, arc, (r4, v4), thrusts[2], masses[2], directions[2])
    a4 = add(s4, gravity(r4, environment))
    sixth = h / 6.0
    moved = add(add(v, v4), scale(2.0, add(v2, v3)))
    store(plant.position, axpy(sixth, moved, r))
    gained = add(add(a1, a4), scale(2.0, add(a2, a3)))
    store(plant.velocity, axpy(sixth, gained, v))
    sensed = add(add(s1, s4), scale(2.0, add(s2, s3)))
    store(plant.sensed_delta_v, axpy(sixth, sensed, load(plant.sensed_delta_v)))
    store(plant.direction, directions[2])
    plant.propellant_used += plant.mass - masses[2]
    plant.mass = masses[2]
    plant.time = end


@kernel
def meets_air(mission: MissionRecords, plant: Record) -> bool:
    """Return whether the air is dense where an arc in the air is, or the arc is a vertical rise."""
    rises: bool = mission.arcs[plant.arc].vertical == 1
    here = density(load(plant.position), mission.environment, mission.atmosphere)
    return rises or here > THIN_AIR


@kernel
def integrate(mission: MissionRecords, vehicle: Vehicle, end: float) -> None:
    """Integrate to ``end`` in one Runge-Kutta-Nystroem step of order 4, thrust linear in time.

    Thrust and mass are known functions of time and gravity depends on position only, so that three
    accelerations suffice: at both ends and in the middle.
    """
    environment = mission.environment
    arcs = mission.arcs
    plant = vehicle.plant
    t = plant.time
    h = end - t
    arc = arcs[plant.arc]
    if arc.held == 1 and t - plant.arc_start_time <= SAME_TIME:
        store(plant.held_direction, steered_direction(plant.command, t))
    t0 = t1 = arc.thrust
    f0 = f1 = arc.mass_flow
    if not burns_steadily(plant, arc, t):
        # sample just inside the step, because a knot may be a jump
        inset = 1e-12 * h
        t0, f0 = thrust_now(plant, arcs, t + inset)
        t1, f1 = thrust_now(plant, arcs, end - inset)
    tm = 0.5 * (t0 + t1)
    fm = 0.5 * (f0 + f1)
    u0, um, u1 = step_directions(plant, arcs, end, vehicle.options.attitude_rate_limit)
    r = load(plant.position)
    v = load(plant.velocity)
    m = plant.mass
    m_end = m - h * fm
    in_air = is_in_air(arc)
    if in_air and meets_air(mission, plant):
        masses = (m, m - 0.25 * h * (f0 + fm), m_end)
        integrate_in_air(mission, plant, end, (u0, um, u1), (t0, tm, t1), masses)
        return
    s0 = scale(t0 / m, u0)
    sm = scale(tm / (m - 0.25 * h * (f0 + fm)), um)
    s1 = scale(t1 / m_end, u1)
    thin = s0
    if throttled(plant, arc, t):
        engine = (arc.exhaust_velocity, arc.mass_flow)
        kind, _ = throttle_regime(arc, engine, m)
        if kind == LIMITED:
            s0, sm, s1 = limited_thrust(arc.max_acceleration, (u0, um, u1))
            m_end = mass_after(arc, engine, kind, m, h)
    if in_air:
        # thin air acts as at the begin of the step
        thin = sub(air_acceleration(mission, arc, (r, v), t0, m, u0), thin)
        s0, sm, s1 = add(s0, thin), add(sm, thin), add(s1, thin)
    a0 = add(s0, gravity(r, environment))
    am = add(sm, gravity(axpy(0.5 * h, axpy(0.25 * h, a0, v), r), environment))
    a1 = add(s1, gravity(axpy(h, axpy(0.5 * h, am, v), r), environment))
    sixth = h / 6.0
    store(plant.position, axpy(h, axpy(sixth, axpy(2.0, am, a0), v), r))
    store(plant.velocity, axpy(sixth, add(a0, axpy(4.0, am, a1)), v))
    # the same rule for the thrust acceleration alone, as an accelerometer senses it
    sensed = add(s0, axpy(4.0, sm, s1))
    store(plant.sensed_delta_v, axpy(sixth, sensed, load(plant.sensed_delta_v)))
    store(plant.direction, u1)
    plant.mass = m_end
    plant.propellant_used += m - m_end
    plant.time = end
