# SPDX-License-Identifier: Apache-2.0
"""Guess the unknowns of the two-point problem from the state alone."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.targets import (
    desired_state,
    plane_is_named,
    plane_normal,
    project_to_plane,
    two_planes,
)
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    cross,
    dot,
    load,
    norm,
    scale,
    sub,
    unit,
)
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    begin_mass,
    segment_mass,
    segment_thrust,
)
from ares_optimizer.two_point.kernels.newton import find_floors, prepare
from ares_optimizer.two_point.kernels.shooting import begin_flight, load_times, unknown_count

_PANEL = 60.0  # s, of Simpson's rule
_MOST_PANELS = 2000


@kernel
def steering_integrals(
    omega: float, origin: float, work: Record
) -> tuple[float, float, float, float]:
    """Integrate a, a cos^2, a cos sin, a sin^2 of omega (t - origin) over the flight.

    Args:
        omega: 1/s.
        origin: s.
        work: record WORK with its segments.

    Returns:
        m/s each.
    """
    total = 0.0
    cc = 0.0
    cs = 0.0
    ss = 0.0
    for i in range(work.segment_count):
        segment = work.segments[i]
        length = segment.end - segment.start
        panels = int(math.ceil(min(max(length / _PANEL, 1.0), _MOST_PANELS)))
        h = length / panels
        for j in range(2 * panels + 1):
            weight = h / 6.0
            if j % 2 == 1:
                weight = 4.0 * weight
            elif 0 < j < 2 * panels:
                weight = 2.0 * weight
            s = 0.5 * j * h
            t = segment.start + s
            wa = weight * segment_thrust(segment, t) / segment_mass(segment, t)
            angle = omega * (segment.start + s - origin)
            cos = math.cos(angle)
            sin = math.sin(angle)
            total += wa
            cc += wa * cos * cos
            cs += wa * cos * sin
            ss += wa * sin * sin
    return total, cc, cs, ss


class OwnStart(NamedTuple):
    """Hold the parameters of a built-in guess.

    Attributes:
        rounds: iterations; a few are enough.
        wait: s from the earliest drop to the guessed time of a heating jettison.
        branch: 1, or -1 for the other of two planes through the end point.
    """

    rounds: int
    wait: float
    branch: float


class _Burn(NamedTuple):
    """Hold times and thrust integrals of the current guess.

    Attributes:
        start: s.
        omega: 1/s, of linear gravity.
        end: end of thrust, s.
        total: integral of T/m, m/s; cc, cs, ss: the same times cos^2, cos sin, sin^2 of omega t.
    """

    start: float
    omega: float
    end: float
    total: float
    cc: float
    cs: float
    ss: float


@kernel
def _first_cutoff(
    start: Record, mission: MissionRecords, gain: float, work: Record
) -> tuple[float, float]:
    """Return a first cut-off time, s, and the least guessed burn of the last arc, s.

    Args:
        start: record NAVIGATION.
        mission: its records.
        gain: velocity to the target, m/s.
        work: record WORK with its floors.
    """
    arcs = mission.arcs
    floor = work.floor[COLUMN_CUTOFF]
    span = work.ceiling - floor
    if start.arc < arcs.shape[0] - 1:
        return floor + 0.5 * span, 0.02 * span
    # the last burn is running: its remainder may be short
    final = arcs[arcs.shape[0] - 1]
    mass = begin_mass(start, arcs)
    cutoff = floor - math.expm1(-gain / final.exhaust_velocity) * mass / final.mass_flow
    return cutoff, 1e-6 * span


@kernel
def _mean_rate(mu: float, begin: float, end: float) -> float:
    """Return omega of linear gravity at the mean of two radii, m: 1/s."""
    mean = 0.5 * (begin + min(end, 1.5 * begin))
    return math.sqrt(mu / (mean * mean * mean))


@kernel
def _longer_burn(mission: MissionRecords, gain: float, mass: float) -> float:
    """Return by how much the last burn is longer for a gain, m/s, at a mass, kg: s."""
    final = mission.arcs[mission.arcs.shape[0] - 1]
    return -math.expm1(-gain / final.exhaust_velocity) * mass / final.mass_flow


@kernel
def _first_end(start: Record, cutoff: float, wanted_v: Vector) -> Vector:
    """Return the end of a level flight, m, over half of the downrange angle at the mean speed."""
    r0 = load(start.position)
    v0 = load(start.velocity)
    radius = norm(r0)
    way = min(1.5, 0.5 * (norm(v0) + norm(wanted_v)) * (cutoff - start.time) / radius)
    ahead = unit(cross(cross(r0, v0), r0))
    return add(scale(math.cos(way), r0), scale(radius * math.sin(way), ahead))


@kernel
def _guess_times(cutoff: float, wait: float, unknowns: NDArray[np.float64], work: Record) -> None:
    """Write cut-off and jettison times into ``unknowns``."""
    unknowns[COLUMN_CUTOFF] = cutoff
    for i in range(COLUMN_JETTISON, work.first_free, 2):
        earliest = work.floor[i]
        unknowns[i] = earliest + min(wait, 0.5 * (cutoff - earliest))
        unknowns[i + 1] = 0.0


@kernel
def _rate_slope(burn: _Burn, middle: float, cos: float, sin: float) -> float:
    """Return the change of the primer's rate at the middle per metre of the wanted position."""
    cc, cs, ss = burn.cc, burn.cs, burn.ss
    move = burn.omega * (
        -math.cos(middle) * (cc * cos + cs * sin) - math.sin(middle) * (ss * sin + cs * cos)
    )
    return move / (cc * ss - cs * cs)


@kernel
def _steer(
    start: Record,
    mission: MissionRecords,
    burn: _Burn,
    normal: Vector,
    reached: Vector,
    unknowns: NDArray[np.float64],
) -> tuple[Vector, float]:
    """Write the steering to the target near a point into ``unknowns``.

    Args:
        start: record NAVIGATION.
        mission: its target is read.
        burn: times and integrals.
        normal: unit normal of the target plane.
        reached: estimated end of the flight, m.
        unknowns: lambda_v and lambda_r are written.

    Returns:
        end of the flight, m, and |lambda_v| at the middle of the impulse.
    """
    r0 = load(start.position)
    v0 = load(start.velocity)
    radius = norm(r0)
    target = mission.target
    omega, cc, cs, ss = burn.omega, burn.cc, burn.cs, burn.ss
    determinant = cc * ss - cs * cs
    # |lambda_v| is normalised at the middle of the impulse
    middle = math.atan2(cs, cc)
    angle = omega * (burn.end - burn.start)
    cos = math.cos(angle)
    sin = math.sin(angle)
    radial = project_to_plane(reached, normal)
    wanted, wanted_v, downrange = desired_state(target, mission.environment.mu, radial, normal)
    a = axpy(omega, wanted, scale(-1.0, axpy(omega * cos, r0, scale(sin, v0))))
    b = add(wanted_v, axpy(omega * sin, r0, scale(-cos, v0)))
    slope = _rate_slope(burn, middle, cos, sin)
    shift = 0.0
    lateral = 0.0
    p = q = v0
    size = 1.0
    for _ in range(3):
        x = axpy(omega, axpy(shift, downrange, scale(lateral, normal)), a)
        ic = add(scale(sin, x), scale(cos, b))
        js = sub(scale(sin, b), scale(cos, x))
        p = scale(1.0 / determinant, sub(scale(ss, ic), scale(cs, js)))
        q = scale(1.0 / determinant, sub(scale(cc, js), scale(cs, ic)))
        primer = add(scale(math.cos(middle), p), scale(math.sin(middle), q))
        rate = sub(scale(math.cos(middle), q), scale(math.sin(middle), p))
        size = norm(primer)
        shift -= dot(rate, primer) / (slope * dot(downrange, primer))
        shift = min(max(shift, -0.3 * radius), 0.3 * radius)
        if not plane_is_named(target):
            lateral -= dot(rate, normal) / slope
            lateral = min(max(lateral, -0.1 * radius), 0.1 * radius)
    length = norm(p)
    for i in range(3):
        unknowns[i] = p[i] / length
        unknowns[3 + i] = -omega * q[i] / length
    return axpy(shift, downrange, axpy(lateral, normal, wanted)), size


@kernel
def guess_two_point(
    start: Record,
    mission: MissionRecords,
    options: Record,
    own: OwnStart,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """Guess the unknowns from the state alone.

    Under linear gravity the primer is lambda_v = B cos wt + (A/w) sin wt (Eq. 3.34), and the
    integrals Ic, Is that lead to a wanted end state follow from Eqs. 3.27-3.29. They are linear in
    A and B if |lambda_v| = 1 inside them. The burn time is then adjusted until |lambda_v| is 1 at
    the middle of the impulse, and the downrange until the rate there is normal to the primer: a
    rate along the thrust gains nothing. With a free node the end point is moved across the plane
    until the rate has no component along its normal.

    Args:
        start, mission, options: record NAVIGATION, the mission's records, record OPTIONS.
        own: parameters of the guess.
        unknowns: shape (at least n,), written except for the ends of free arcs, which are read.
            Directions of held burns are set to 0.
        work: record WORK.

    Returns:
        False if the sequence has no possible timetable.
    """
    prepare(start, mission, options, work)
    for i in range(work.first_held, unknown_count(start, mission, options)):
        unknowns[i] = 0.0
    load_times(start, mission, options, unknowns, work)
    if not find_floors(start, mission, work):
        return False
    target = mission.target
    mu = mission.environment.mu
    r0 = load(start.position)
    v0 = load(start.velocity)
    # choose between two planes through a point: the one closer to this angular momentum
    towards = scale(own.branch if two_planes(target) else 1.0, cross(r0, v0))
    normal, _ = plane_normal(target, r0, towards)
    wanted, wanted_v, _ = desired_state(target, mu, project_to_plane(r0, normal), normal)
    omega = _mean_rate(mu, norm(r0), norm(wanted))
    cutoff, least = _first_cutoff(start, mission, norm(sub(wanted_v, v0)), work)
    reached = _first_end(start, cutoff, wanted_v)
    for _ in range(own.rounds):
        _guess_times(cutoff, own.wait, unknowns, work)
        begin_flight(start, mission, options, unknowns, work)
        if work.segment_count == 0:
            return False
        last = work.segments[work.segment_count - 1]
        total, cc, cs, ss = steering_integrals(omega, start.time, work)
        burn = _Burn(start.time, omega, last.end, total, cc, cs, ss)
        normal, _ = plane_normal(target, reached, towards)
        reached, size = _steer(start, mission, burn, normal, reached, unknowns)
        gain = (min(max(size, 0.5), 2.0) - 1.0) * total
        cutoff += _longer_burn(mission, gain, segment_mass(last, last.end))
        span = work.ceiling - work.floor[COLUMN_CUTOFF]
        cutoff = min(max(cutoff, work.floor[COLUMN_CUTOFF] + least), work.ceiling - 0.02 * span)
    return True
