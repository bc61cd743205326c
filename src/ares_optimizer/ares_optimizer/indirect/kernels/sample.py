# SPDX-License-Identifier: Apache-2.0
"""Sample the flight of a solved two-point problem."""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.vectors import Vector, axpy, dot, scale
from ares_optimizer.kernels.timetable import (
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    segment_flow,
    segment_mass,
    segment_thrust,
)
from ares_optimizer.two_point.arrays import RUNGE_KUTTA, Gravity
from ares_optimizer.two_point.kernels.gravity import gravity_terms
from ares_optimizer.two_point.kernels.held_burns import along_thrust
from ares_optimizer.two_point.kernels.shooting import (
    begin_flight,
    fly_segment,
    part_of,
    step_count,
)

TIME = 0
POSITION = 1
VELOCITY = 4
MASS = 7
LAMBDA_V = 8
LAMBDA_R = 11
THRUST = 14
FLOW = 15
HAMILTONIAN = 16
LOG_HEATING = 17
PIECE = 18
#: Integral of lambda_v . u T/m^2 with the thrust direction u, 1/s per kg: the mass costate plus a
#: constant.
MASS_COSTATE = 19
#: Thrust direction.
DIRECTION = 20
SAMPLE_COLUMNS = 23


@kernel
def _primer_between(p0: Vector, q0: Vector, p1: Vector, q1: Vector, h: float) -> Vector:
    """Interpolate the primer at the middle of a step by a Hermite cubic."""
    middle = scale(0.5, axpy(1.0, p0, p1))
    return axpy(0.125 * h, axpy(-1.0, q1, q0), middle)


@kernel
def _put(
    row: NDArray[np.float64],
    time: float,
    piece: int,
    costate: float,
    mission: MissionRecords,
    gravity: Gravity,
    work: Record,
) -> None:
    """Write one sample: ``work.state`` at a time within a segment."""
    state = work.state
    segment = work.segments[piece]
    thrust = segment_thrust(segment, time)
    mass = segment_mass(segment, time)
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    q = (state[9], state[10], state[11])
    g, _ = gravity_terms(r, gravity, p)
    size, u = along_thrust(segment, p, work)
    rate, _, _ = log_heating_gradient(r, v, mission.environment, mission.atmosphere)
    row[TIME] = time
    for i in range(3):
        row[POSITION + i] = r[i]
        row[VELOCITY + i] = v[i]
        row[LAMBDA_V + i] = p[i]
        row[LAMBDA_R + i] = -q[i]
        row[DIRECTION + i] = u[i]
    row[MASS] = mass
    row[THRUST] = thrust
    row[FLOW] = segment_flow(segment, time)
    row[HAMILTONIAN] = -dot(q, v) + dot(p, g) + size * thrust / mass
    row[LOG_HEATING] = rate
    row[PIECE] = piece
    row[MASS_COSTATE] = costate


@kernel
def _fly_part(part: Record, gravity: Gravity, options: Record, work: Record) -> float:
    """Fly one step; return the change of the mass costate integral by Simpson's rule."""
    state = work.state
    h = part.end - part.start
    p0 = (state[6], state[7], state[8])
    q0 = (state[9], state[10], state[11])
    # one step
    fly_segment(part, step_count(part, h), gravity, options, work)
    p1 = (state[6], state[7], state[8])
    q1 = (state[9], state[10], state[11])
    first, _ = along_thrust(part, p0, work)
    middle, _ = along_thrust(part, _primer_between(p0, q0, p1, q1, h), work)
    last, _ = along_thrust(part, p1, work)
    center = part.start + 0.5 * h
    thrust = segment_thrust(part, center)
    mass = segment_mass(part, center)
    mass_end = segment_mass(part, part.end)
    thrust_end = segment_thrust(part, part.end)
    return (h / 6.0) * (
        first * part.thrust / part.mass**2
        + 4.0 * middle * thrust / mass**2
        + last * thrust_end / mass_end**2
    )


@kernel
def sample_flight(
    start: Record,
    mission: MissionRecords,
    options: Record,
    unknowns: NDArray[np.float64],
    interval: float,
    out: NDArray[np.float64],
    work: Record,
) -> int:
    """Fly the unknowns and write samples, both ends of every segment included.

    Args:
        start: record NAVIGATION.
        mission: its records.
        options: record OPTIONS. In closed form samples are at the ends of its arcs only.
        unknowns: see :func:`shooting.shoot`; costates do not jump at a drop at the start.
        interval: longest interval between samples, s.
        out: shape (k, SAMPLE_COLUMNS), written.
        work: record WORK.

    Returns:
        number of rows; if negative, ``out`` is too small and needs that many.
    """
    gravity = begin_flight(start, mission, options, unknowns, work)
    work.columns = 0
    longest = options.step
    if options.propagator == RUNGE_KUTTA:
        longest = min(longest, interval)
    rows = 0
    for i in range(work.segment_count):
        rows += step_count(work.segments[i], longest) + 1
    if rows > out.shape[0]:
        return -rows
    state = work.state
    # the unused last segment holds the current step
    part = work.segments[work.segments.shape[0] - 1]
    rows = 0
    costate = 0.0
    for i in range(work.segment_count):
        segment = work.segments[i]
        steps = step_count(segment, longest)
        _put(out[rows], segment.start, i, costate, mission, gravity, work)
        rows += 1
        for k in range(steps):
            part_of(segment, k, steps, part)
            costate += _fly_part(part, gravity, options, work)
            _put(out[rows], part.end, i, costate, mission, gravity, work)
            rows += 1
        if segment.end_heating >= 0 and options.heating == HEATING_OPTIMAL:
            pi = unknowns[COLUMN_JETTISON + 2 * segment.end_heating + 1]
            r = (state[0], state[1], state[2])
            v = (state[3], state[4], state[5])
            _, by_r, by_v = log_heating_gradient(r, v, mission.environment, mission.atmosphere)
            for j in range(3):
                state[6 + j] -= pi * by_v[j]
                state[9 + j] += pi * by_r[j]
    return rows
