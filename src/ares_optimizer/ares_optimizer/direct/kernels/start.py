# SPDX-License-Identifier: Apache-2.0
"""Find a first guess: the best of a coarse sweep of linear-tangent laws.

The sweep stays in the vertical plane of the motion, or in the plane of the target where its node
is given. It varies the thrust elevation at the start and at the end, and the ideal velocity gain,
which gives the cut-off time. The fairing is dropped where the heating first allows it.
"""

import math

import numpy as np

from ares_models.arrays import Record
from ares_models.jit import allocating, kernel
from ares_models.kernels.targets import (
    desired_state,
    named_plane,
    plane_is_named,
    project_to_plane,
)
from ares_models.kernels.vectors import Vector, add, axpy, cross, load, norm, scale, store, unit
from ares_optimizer.direct.kernels.breaks import drop_column
from ares_optimizer.direct.kernels.evaluate import Point, evaluate
from ares_optimizer.direct.kernels.heating import heating_at_node
from ares_optimizer.direct.kernels.problem import (
    AT_DROP,
    D_EARLIEST,
    D_LOG_LIMIT,
    L_BEGINS,
    L_DIRECTION,
    L_DROP,
    L_RATE,
    P_FLOW,
    P_FLOW_SLOPE,
    P_MASS,
    P_THRUST,
    P_THRUST_SLOPE,
    P_TIME,
    RATE_SCALE,
    TIME_SCALE,
    Problem,
)
from ares_optimizer.direct.kernels.scratch import N_TIME, STORED, Scratch
from ares_optimizer.direct.kernels.sqp import into_bounds
from ares_optimizer.kernels.algebra import Array

_SLICES = 32
_PASSES = 3  # iterations of the jettison time


@kernel
def cutoff_for(problem: Problem, delta_v: float) -> float:
    """Return the cut-off time, s, at which the ideal velocity gain is ``delta_v`` m/s."""
    gained = 0.0
    last = problem.profile.shape[0] - 1
    for k in range(last + 1):
        row = problem.profile[k]
        begin = row[P_TIME]
        end = problem.profile[k + 1, P_TIME] if k < last else problem.latest_cutoff
        if k == last:
            # constant thrust: in closed form
            speed = row[P_THRUST] / row[P_FLOW]
            ratio = math.exp(-max(delta_v - gained, 0.0) / speed)
            time = begin + row[P_MASS] * (1.0 - ratio) / row[P_FLOW]
            return min(max(time, problem.earliest_cutoff), end)
        h = (end - begin) / _SLICES
        for i in range(_SLICES):
            s = (i + 0.5) * h
            mass = row[P_MASS] - s * (row[P_FLOW] + 0.5 * s * row[P_FLOW_SLOPE])
            gained += h * (row[P_THRUST] + s * row[P_THRUST_SLOPE]) / mass
    return problem.latest_cutoff


@kernel
def set_law(p: Array, problem: Problem, direction: Vector, rate: Vector, cutoff: float) -> None:
    """Set the variables to one linear-tangent law over the whole flight.

    Args:
        p: shape (n,), written except for the times of the drops, which are read. A held burn
            gets the law's direction at its middle.
        problem: the flight.
        direction: steering vector at the start.
        rate: its rate, 1/s.
        cutoff: s, mission elapsed time.
    """
    n = problem.variables
    p[n - 1] = (cutoff - problem.start_time) / TIME_SCALE
    size = 1.0
    for k in range(problem.laws.shape[0]):
        at = problem.law_time[k] - problem.start_time
        if problem.laws[k, L_BEGINS] == AT_DROP:
            at = p[drop_column(problem, problem.laws[k, L_DROP])] * TIME_SCALE
        now = axpy(at, rate, direction)
        column = problem.laws[k, L_DIRECTION]
        if column >= 0:
            size = norm(now)
            for c in range(3):
                p[column + c] = now[c] / size
        column = problem.laws[k, L_RATE]
        if column >= 0:
            for c in range(3):
                p[column + c] = rate[c] / (RATE_SCALE * size)
    for k in range(problem.held.shape[0]):
        middle = 0.5 * (problem.held_time[k, 0] + min(problem.held_time[k, 1], cutoff))
        now = unit(axpy(middle - problem.start_time, rate, direction))
        store(p[problem.held[k] :], now)


@kernel
def place_drops(p: Array, problem: Problem, scratch: Scratch) -> None:
    """Move the free drops to the times at which the heating of a flight allows them.

    Args:
        p: shape (n,), drop times written.
        problem: the flight.
        scratch: holds the nodes of the flight.
    """
    environment = problem.environment[0]
    for d in range(problem.drops.shape[0]):
        column = drop_column(problem, d)
        earliest = problem.drops[d, D_EARLIEST] - problem.start_time
        limit = problem.drops[d, D_LOG_LIMIT]
        before = math.nan
        least = math.inf
        for i in range(scratch.counts[STORED]):
            t = scratch.nodes[i, N_TIME]
            if t < earliest:
                continue
            level, slope = heating_at_node(scratch.nodes[i], environment, problem.atmosphere)
            if level < least:
                least = level
                p[column] = t / TIME_SCALE
            if level <= limit:
                if slope < 0.0 and math.isfinite(before):
                    p[column] = max(t + (limit - level) / slope, before) / TIME_SCALE
                break
            before = t
    into_bounds(p, problem)


@kernel
def plane_of_sweep(target: Record, r: Vector, v: Vector) -> Vector:
    """Return the normal of the target's plane where it is named, else of the motion; unit vector.

    A vertical motion goes on to the east.
    """
    if plane_is_named(target):
        return named_plane(target)
    normal = cross(r, v)
    if norm(normal) < 1e-6 * norm(r) * norm(v):
        normal = cross(r, cross((0.0, 0.0, 1.0), r))
    return unit(normal)


@allocating
def keep_if_best(p: Array, miss: float, found: int, starts: Array, misses: Array) -> int:
    """Put a start among the best ``found`` if it is one, best first; return their number."""
    if found == misses.size and miss >= misses[found - 1]:
        return found
    k = min(found, misses.size - 1)
    while k > 0 and misses[k - 1] > miss:
        misses[k] = misses[k - 1]
        starts[k] = starts[k - 1]
        k -= 1
    misses[k] = miss
    starts[k] = p
    return min(found + 1, misses.size)


@allocating
def sweep(problem: Problem, scratch: Scratch, point: Point, starts: Array, misses: Array) -> int:
    """Find starts for the solver.

    Args:
        problem: the flight.
        scratch: from ``make_scratch``.
        point: from ``make_point``.
        starts: shape (k, n), written: the best, best first.
        misses: shape (k,), written: sum of squares of the terminal residuals.

    Returns:
        number of starts found.
    """
    n = problem.variables
    target = problem.target[0]
    mu = problem.environment[0].mu
    r = load(problem.state)
    v = load(problem.state[3:])
    up = unit(r)
    radius = norm(r)
    normal = plane_of_sweep(target, r, v)
    along = unit(cross(normal, up))
    _, wanted, _ = desired_state(target, mu, project_to_plane(r, normal), normal)
    needed = norm(axpy(-1.0, v, wanted))
    found = 0
    p = np.zeros(n)
    for a in range(4):
        if found > 0 and problem.stop[0] != 0:
            break
        cutoff = cutoff_for(problem, needed * (1.05 + 0.1 * a))
        time = cutoff - problem.start_time
        angle = 0.5 * (norm(v) + norm(wanted)) * time / radius
        up_end = add(scale(math.cos(angle), up), scale(math.sin(angle), along))
        along_end = add(scale(-math.sin(angle), up), scale(math.cos(angle), along))
        for b in range(6):
            first = math.radians(-10.0 + 15.0 * b)
            direction = add(scale(math.cos(first), along), scale(math.sin(first), up))
            for c in range(5):
                second = math.radians(-40.0 + 20.0 * c)
                end = add(scale(math.cos(second), along_end), scale(math.sin(second), up_end))
                rate = scale(1.0 / time, axpy(-1.0, direction, end))
                for d in range(problem.drops.shape[0]):
                    p[drop_column(problem, d)] = 0.5 * time / TIME_SCALE
                set_law(p, problem, direction, rate, cutoff)
                into_bounds(p, problem)
                evaluate(p, problem, scratch, point)
                s = 0.0
                for e in point.equations:
                    s += e * e
                if math.isfinite(s):
                    found = keep_if_best(p, s, found, starts, misses)
    for k in range(found):
        for _ in range(_PASSES):
            evaluate(starts[k], problem, scratch, point)
            place_drops(starts[k], problem, scratch)
    return found
