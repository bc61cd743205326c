"""The flight of a solved two-point problem, sampled."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.vectors import Vector, axpy, dot, norm, scale
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    build_timetable,
)
from ares_optimizer.two_point.arrays import RUNGE_KUTTA
from ares_optimizer.two_point.kernels.shooting import (
    begin_state,
    fly_segment,
    gravity_terms,
    unknown_count,
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
#: Integral of |lambda_v| T/m^2, the mass costate but for a constant, 1/s per kg.
MASS_COSTATE = 19
SAMPLE_COLUMNS = 20


@kernel
def _primer_between(p0: Vector, q0: Vector, p1: Vector, q1: Vector, h: float) -> Vector:
    """Primer in the middle of a step: cubic through both ends with their rates."""
    middle = scale(0.5, axpy(1.0, p0, p1))
    return axpy(0.125 * h, axpy(-1.0, q1, q0), middle)


@kernel
def _put(
    row: NDArray[np.float64],
    time: float,
    piece: int,
    segment: Record,
    omega_square: float,
    costate: float,
    environment: Record,
    atmosphere: NDArray[np.float64],
    options: Record,
    state: NDArray[np.float64],
) -> None:
    """Write one sample."""
    s = time - segment.start
    thrust = segment.thrust + segment.thrust_slope * s
    mass = segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    q = (state[9], state[10], state[11])
    g, _ = gravity_terms(r, environment.mu, omega_square, options.gravity, p)
    rate, _, _ = log_heating_gradient(r, v, environment, atmosphere)
    row[TIME] = time
    for i in range(3):
        row[POSITION + i] = r[i]
        row[VELOCITY + i] = v[i]
        row[LAMBDA_V + i] = p[i]
        row[LAMBDA_R + i] = -q[i]
    row[MASS] = mass
    row[THRUST] = thrust
    row[FLOW] = segment.flow + segment.flow_slope * s
    row[HAMILTONIAN] = -dot(q, v) + dot(p, g) + norm(p) * thrust / mass
    row[LOG_HEATING] = rate
    row[PIECE] = piece
    row[MASS_COSTATE] = costate


@kernel
def sample_flight(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    options: Record,
    unknowns: NDArray[np.float64],
    interval: float,
    out: NDArray[np.float64],
    work: Record,
) -> int:
    """Fly the unknowns and write samples; both ends of every segment are among them.

    Args:
        start: record NAVIGATION.
        environment: record ENVIRONMENT.
        atmosphere: log-density table.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        options: record OPTIONS. In closed form samples stand at the ends of its arcs only.
        unknowns: see :func:`two_point.shoot`; a drop at its earliest time makes no jump.
        interval: s, longest between samples.
        out: shape (k, SAMPLE_COLUMNS), written.
        work: record WORK.

    Returns:
        number of rows; negative: that many rows are needed.
    """
    n = unknown_count(start, jettisons, options)
    for i in range((n - COLUMN_JETTISON) // 2):
        work.heating_times[i] = unknowns[COLUMN_JETTISON + 2 * i]
    count = build_timetable(
        start,
        arcs,
        jettisons,
        options.heating,
        work.heating_times,
        unknowns[COLUMN_CUTOFF],
        work.segments,
    )
    rows = 0
    for i in range(count):
        length = work.segments[i].end - work.segments[i].start
        longest = options.step
        if options.propagator == RUNGE_KUTTA:
            longest = min(longest, interval)
        rows += max(1, int(math.ceil(length / longest - 1e-9))) + 1
    if rows > out.shape[0]:
        return -rows
    mu = environment.mu
    omega_square = begin_state(start, mu, options, unknowns, work)
    state = work.state
    # the spare segment carries the steps
    step = work.segments[work.segments.shape[0] - 1]
    rows = 0
    costate = 0.0
    for i in range(count):
        segment = work.segments[i]
        length = segment.end - segment.start
        longest = options.step
        if options.propagator == RUNGE_KUTTA:
            longest = min(longest, interval)
        steps = max(1, int(math.ceil(length / longest - 1e-9)))
        _put(
            out[rows],
            segment.start,
            i,
            segment,
            omega_square,
            costate,
            environment,
            atmosphere,
            options,
            state,
        )
        rows += 1
        step.start_column = -1
        step.end_column = -1
        step.thrust_slope = segment.thrust_slope
        step.flow_slope = segment.flow_slope
        for k in range(steps):
            s = length * k / steps
            h = length / steps
            step.start = segment.start + s
            step.end = segment.end if k == steps - 1 else step.start + h
            step.thrust = segment.thrust + segment.thrust_slope * s
            step.flow = segment.flow + segment.flow_slope * s
            step.mass = segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)
            p0 = (state[6], state[7], state[8])
            q0 = (state[9], state[10], state[11])
            fly_segment(step, 1, mu, omega_square, options, 0, work)
            p1 = (state[6], state[7], state[8])
            q1 = (state[9], state[10], state[11])
            middle = norm(_primer_between(p0, q0, p1, q1, h))
            thrust = step.thrust + 0.5 * h * step.thrust_slope
            mass = step.mass - 0.5 * h * (step.flow + 0.25 * h * step.flow_slope)
            mass_end = step.mass - h * (step.flow + 0.5 * h * step.flow_slope)
            thrust_end = step.thrust + h * step.thrust_slope
            # Simpson's rule
            costate += (h / 6.0) * (
                norm(p0) * step.thrust / step.mass**2
                + 4.0 * middle * thrust / mass**2
                + norm(p1) * thrust_end / mass_end**2
            )
            _put(
                out[rows],
                step.end,
                i,
                segment,
                omega_square,
                costate,
                environment,
                atmosphere,
                options,
                state,
            )
            rows += 1
        if segment.end_heating >= 0 and options.heating == HEATING_OPTIMAL:
            pi = unknowns[COLUMN_JETTISON + 2 * segment.end_heating + 1]
            r = (state[0], state[1], state[2])
            v = (state[3], state[4], state[5])
            _, by_r, by_v = log_heating_gradient(r, v, environment, atmosphere)
            for j in range(3):
                state[6 + j] -= pi * by_v[j]
                state[9 + j] += pi * by_r[j]
    return rows
