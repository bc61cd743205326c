# SPDX-License-Identifier: Apache-2.0
"""Fly a trial flight by a few steering constants."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import body_force, local_vertical, pressure_loss
from ares_models.kernels.boost import boost_direction, is_over
from ares_models.kernels.environment import altitude, gravity, log_heating_gradient
from ares_models.kernels.vectors import Vector, add, axpy, cross, dot, load, norm, scale, unit
from ares_optimizer.kernels.timetable import (
    Times,
    fill_timetable,
    segment_mass,
    segment_thrust,
)

Array = NDArray[np.float64]

#: Columns of a track: time s, position m, velocity m/s, thrust direction, log heating, altitude m,
#: arc, mass kg.
TIME = 0
POSITION = 1
VELOCITY = 4
DIRECTION = 7
LOG_HEATING = 10
ALTITUDE = 11
ARC = 12
MASS = 13
TRACK_COLUMNS = 14
#: Columns of a steering law: its frame, time of its first angles, s, time from these to its last
#: ones, s, these pitch and yaw angles, rad, and the normal of the plane of FROM_PAD and TURN.
FRAME = 0
REFERENCE = 1
SPAN = 2
PITCH = 3
YAW = 4
PITCH_END = 5
YAW_END = 6
NORMAL = 7
LAW_COLUMNS = 10
#: Frames of a law: the horizon along the velocity, the velocity, or the horizon in a given plane.
#: From the pad the pitch falls from the vertical as a power of time; the exponent is its first
#: pitch angle. A zero-lift turn is along the velocity through the air up to thin air; its angles
#: are the first tilt off it, which fades, the pitch in thin air at begin and end, and the yaw.
#: By programme: as the mission's boost programme has it.
FROM_HORIZON = 0.0
FROM_VELOCITY = 1.0
FROM_PAD = 2.0
TURN = 3.0
BY_PROGRAMME = 4.0
#: Altitude of thin air, m, and time in which a tilt fades, s.
THIN_AIR_M = 4e4
_TILT_S = 10.0
_AT_REST_M_S = 1e-3
#: Least exponent.
_LEAST_POWER = 0.05
#: Part of a step that is rounding.
_WHOLE = 1e-6


@kernel
def thrust_direction(law: Array, t: float, r: Vector, v: Vector, environment: Record) -> Vector:
    """Return the thrust direction of a steering law."""
    if law[FRAME] == BY_PROGRAMME:
        return boost_direction(t, r, v, environment)
    part = (t - law[REFERENCE]) / law[SPAN]
    pitch = law[PITCH] + (law[PITCH_END] - law[PITCH]) * part
    yaw = law[YAW] + (law[YAW_END] - law[YAW]) * part
    normal = unit(cross(r, v))
    if law[FRAME] == TURN:
        pitch, yaw = law[YAW] + (law[PITCH_END] - law[YAW]) * part, law[YAW_END]
        up = unit(r)
        along = unit(cross((law[NORMAL], law[NORMAL + 1], law[NORMAL + 2]), up))
        if altitude(r, environment) < THIN_AIR_M:
            rate = environment.rotation_rate
            air = (v[0] + rate * r[1], v[1] - rate * r[0], v[2])
            # at rest it is upwards
            ahead = unit(axpy(_AT_REST_M_S, up, air))
            tilt = law[PITCH] * math.exp(min(0.0, (law[REFERENCE] - t) / _TILT_S))
            across = unit(axpy(-dot(along, ahead), ahead, along))
            return axpy(math.sin(tilt), across, scale(math.cos(tilt), ahead))
        normal = cross(up, along)
    elif law[FRAME] == FROM_PAD:
        turned = max(0.0, part) ** max(_LEAST_POWER, law[PITCH])
        pitch = 0.5 * math.pi + (law[PITCH_END] - 0.5 * math.pi) * turned
        up = unit(r)
        along = unit(cross((law[NORMAL], law[NORMAL + 1], law[NORMAL + 2]), up))
        normal = cross(up, along)
    elif law[FRAME] == FROM_VELOCITY:
        along = unit(v)
        up = cross(normal, along)
    else:
        up = unit(r)
        along = cross(normal, up)
    level = axpy(math.sin(yaw), normal, scale(math.cos(yaw), along))
    return axpy(math.sin(pitch), up, scale(math.cos(pitch), level))


@kernel
def acceleration(
    segment: Record, law: Array, mission: MissionRecords, t: float, r: Vector, v: Vector
) -> Vector:
    """Return the acceleration, m/s2; below ground gravity and air are those of the ground."""
    environment = mission.environment
    arc = mission.arcs[segment.arc]
    per = 1.0 / segment_mass(segment, t)
    r = scale(max(1.0, environment.polar_radius / max(norm(r), 1.0)), r)
    a = gravity(r, environment)
    thrust = segment_thrust(segment, t)
    u = thrust_direction(law, t, r, v, environment)
    if arc.vertical == 1:
        u = local_vertical(r, environment)
    if arc.drag_area > 0.0:
        a = axpy(per, body_force(arc, r, v, u, environment, mission.atmosphere), a)
    if thrust <= 0.0:
        return a
    if arc.exit_area > 0.0:
        thrust = max(0.0, thrust - pressure_loss(arc, r, environment, mission.atmosphere))
    return axpy(thrust * per, u, a)


@kernel
def fly_track(
    start: Record,
    mission: MissionRecords,
    times: Times,
    laws: Array,
    step: float,
    segments: NDArray[Any],
    layout: NDArray[Any],
    track: Array,
) -> int:
    """Fly by a steering law per arc, with Runge-Kutta 4.

    Args:
        start: record NAVIGATION.
        mission: its records.
        times: of the timetable.
        laws: shape (arcs, LAW_COLUMNS).
        step: longest step, s; of a coast, near the ground.
        segments: dtype SEGMENT, shape (MAX_SEGMENTS,), written.
        layout: dtype LAYOUT, shape (1,), written.
        track: shape (n, TRACK_COLUMNS), written.

    Returns:
        rows of the track, to the end of the programme in a law by that; 0 if the times are not
        possible or the track is too short.
    """
    count = fill_timetable(start, mission.arcs, mission.jettisons, times, segments, layout[0])
    r, v = load(start.position), load(start.velocity)
    environment = mission.environment
    rows = 0
    for i in range(count):
        segment = segments[i]
        law = laws[segment.arc]
        coasting = segment.thrust <= 0.0 and segment.thrust_slope <= 0.0
        t = segment.start
        while True:
            if rows >= track.shape[0]:
                return 0
            track[rows, TIME] = t
            u = thrust_direction(law, t, r, v, environment)
            if mission.arcs[segment.arc].vertical == 1:
                u = local_vertical(r, environment)
            for c in range(3):
                track[rows, POSITION + c] = r[c]
                track[rows, VELOCITY + c] = v[c]
                track[rows, DIRECTION + c] = u[c]
            above = scale(max(1.0, environment.polar_radius / max(norm(r), 1.0)), r)
            heating, _, _ = log_heating_gradient(above, v, environment, mission.atmosphere)
            track[rows, LOG_HEATING] = heating
            track[rows, ALTITUDE] = altitude(r, environment)
            track[rows, ARC] = segment.arc
            track[rows, MASS] = segment_mass(segment, t)
            rows += 1
            if law[FRAME] == BY_PROGRAMME and is_over(t, r, v, segment.arc, environment):
                return rows
            left = segment.end - t
            if left <= 0.0:
                break
            longest = step
            if coasting:
                # as long as they are near the ground, by the angle swept
                longest *= max(1.0, norm(r) / environment.equatorial_radius) ** 1.5
            steps = math.ceil(left / longest - _WHOLE)
            h = left / max(1.0, steps)
            a1 = acceleration(segment, law, mission, t, r, v)
            v2 = axpy(0.5 * h, a1, v)
            a2 = acceleration(segment, law, mission, t + 0.5 * h, axpy(0.5 * h, v, r), v2)
            v3 = axpy(0.5 * h, a2, v)
            a3 = acceleration(segment, law, mission, t + 0.5 * h, axpy(0.5 * h, v2, r), v3)
            v4 = axpy(h, a3, v)
            a4 = acceleration(segment, law, mission, t + h, axpy(h, v3, r), v4)
            r = axpy(h / 6.0, add(add(v, scale(2.0, v2)), add(scale(2.0, v3), v4)), r)
            v = axpy(h / 6.0, add(add(a1, scale(2.0, a2)), add(scale(2.0, a3), a4)), v)
            t = t + h if steps > 1.0 else segment.end
    return rows
