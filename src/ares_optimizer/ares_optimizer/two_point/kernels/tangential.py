# SPDX-License-Identifier: Apache-2.0
"""Guess the costates at the next ignition of a flight in orbit, and propagate them back."""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import COAST, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.kepler import kepler
from ares_models.kernels.vectors import Vector, axpy, dot, load, norm, scale
from ares_optimizer.kernels.timetable import ends_by_plan, free_index
from ares_optimizer.two_point.kernels.gravity import field_of, gravity_terms

#: Primer and its rate.
Costates = tuple[Vector, Vector]

_STEP = 60.0  # s
_MOST_STEPS = 400.0


@kernel
def next_ignition(start: Record, mission: MissionRecords, ends: NDArray[np.float64]) -> float:
    """Return the time of the next ignition, s; the start if a burn is running.

    Args:
        start: record NAVIGATION.
        mission: its records.
        ends: ends of the free arcs before the last, s.
    """
    k = start.arc
    time = start.time
    begin = start.arc_start_time
    while mission.arcs[k].kind == COAST and k + 1 < mission.arcs.shape[0]:
        if ends_by_plan(k, mission.arcs):
            begin = ends[free_index(start, mission.arcs, k)]
        else:
            begin += mission.arcs[k].duration
        time = max(time, begin)
        k += 1
    return time


@kernel
def tangential_primer(start: Record, mission: MissionRecords, ignition: float) -> Costates:
    """Return primer and rate at an ignition for thrust along the velocity.

    The primer has length 1 and turns with the velocity; ``ignition`` in s.
    """
    mu = mission.environment.mu
    r, v = kepler(load(start.position), load(start.velocity), ignition - start.time, mu)
    speed = norm(v)
    p = scale(1.0 / speed, v)
    g, _ = gravity_terms(r, field_of(mission.environment), p)
    return p, scale(1.0 / speed, axpy(-dot(p, g), p, g))


@kernel
def propagated_back(
    start: Record, mission: MissionRecords, ignition: float, costates: Costates
) -> Costates:
    """Propagate primer and rate from an ignition back to the start, over the coast.

    The coast is a conic; the linear equation of the primer along it is integrated by the classical
    Runge-Kutta method.

    Args:
        start: record NAVIGATION.
        mission: its gravity is read.
        ignition: s.
        costates: primer and rate at the ignition.

    Returns:
        a primer of length 1, and its rate, 1/s.
    """
    gravity = field_of(mission.environment)
    mu = gravity.mu
    r0 = load(start.position)
    v0 = load(start.velocity)
    coast = ignition - start.time
    r, _ = kepler(r0, v0, coast, mu)
    p, q = costates
    steps = int(min(_MOST_STEPS, np.ceil(coast / _STEP)))
    for i in range(steps):
        h = -coast / steps
        after = coast * (steps - i) / steps
        middle, _ = kepler(r0, v0, after + 0.5 * h, mu)
        before, _ = kepler(r0, v0, after + h, mu)
        _, k1 = gravity_terms(r, gravity, p)
        _, k2 = gravity_terms(middle, gravity, axpy(0.5 * h, q, p))
        _, k3 = gravity_terms(middle, gravity, axpy(0.5 * h, axpy(0.5 * h, k1, q), p))
        _, k4 = gravity_terms(before, gravity, axpy(h, axpy(0.5 * h, k2, q), p))
        rise = axpy(1.0, k1, axpy(1.0, k2, k3))
        fall = axpy(1.0, k1, axpy(2.0, k2, axpy(2.0, k3, k4)))
        p = axpy(h, axpy(h / 6.0, rise, q), p)
        q = axpy(h / 6.0, fall, q)
        r = before
    size = 1.0 / norm(p)
    return scale(size, p), scale(size, q)
