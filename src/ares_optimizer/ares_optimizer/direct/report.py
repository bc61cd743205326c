# SPDX-License-Identifier: Apache-2.0
"""Convert the result of a direct search to times, states and steering laws."""

import math
from itertools import pairwise

import numpy as np

from ares_optimizer.direct.kernels.evaluate import evaluate, make_point, make_scratch
from ares_optimizer.direct.kernels.problem import (
    D_MASS,
    P_FLOW,
    P_FLOW_SLOPE,
    P_MASS,
    P_THRUST,
    P_THRUST_SLOPE,
    P_TIME,
    Problem,
)
from ares_optimizer.direct.kernels.scratch import N_MASS, N_POSITION, N_TIME, STORED
from ares_optimizer.direct.search import Array, SearchResult, SteeringLaw, steering_laws
from ares_optimizer.results import steering_arc
from ares_optimizer.solution import SteeringArc

_SIDE = 1e-9  # either side of an event, s
_GAUSS = np.polynomial.legendre.leggauss(10)


def _law_in_force(found: SearchResult, laws: list[SteeringLaw], t: float) -> SteeringLaw:
    """Return the law just after ``t``: of a held burn, or the last that has begun."""
    problem = found.transcription.problem
    for column, (begin, end) in zip(problem.held, problem.held_time, strict=True):
        if begin <= t + _SIDE < end:
            return SteeringLaw(t, found.variables[column : column + 3], np.zeros(3))
    return [law for law in laws if law.time <= t + _SIDE][-1]


def solver_nodes(found: SearchResult) -> Array:
    """Return the states at the ends of the solver's steps, shape (k, 8): s, m, m/s, kg."""
    problem = found.transcription.problem
    scratch = make_scratch(problem)
    evaluate(found.variables, problem, scratch, make_point(problem))
    used = scratch.nodes[: int(scratch.counts[STORED])]
    nodes = np.empty((len(used), 8))
    nodes[:, 0] = used[:, N_TIME] + problem.start_time
    nodes[:, 1:7] = used[:, N_POSITION : N_POSITION + 6]
    nodes[:, 7] = used[:, N_MASS]
    # between two events at one instant the state is not defined
    before = np.diff(nodes[:, 0], prepend=-math.inf) > _SIDE
    after = np.diff(nodes[:, 0], append=math.inf) > _SIDE
    return nodes[before | after]


def _profile_at(problem: Problem, cutoff: float, t: float, late: bool) -> tuple[float, float]:
    """Return thrust, N, and mass with every free drop aboard, kg, at a time.

    Args:
        problem: the flight.
        cutoff: s.
        t: s.
        late: take the value after a boundary, not before it.
    """
    side = _SIDE if late else -_SIDE
    profile = problem.profile
    k = max(int(np.searchsorted(profile[:, P_TIME], min(t + side, cutoff), side="right")) - 1, 0)

    def mass_of(k: int, s: float) -> float:
        row = profile[k]
        return float(row[P_MASS] - s * (row[P_FLOW] + 0.5 * s * row[P_FLOW_SLOPE]))

    if t + side < cutoff or not len(problem.tail):
        s = min(t, cutoff) - profile[k, P_TIME]
        return float(profile[k, P_THRUST] + s * profile[k, P_THRUST_SLOPE]), mass_of(k, s)
    mass = mass_of(k, cutoff - profile[k, P_TIME])
    thrust = 0.0
    begins = cutoff + problem.tail[:, P_TIME]
    for row, begin, end in zip(problem.tail, begins, [*begins[1:], math.inf], strict=True):
        s = min(t, end) - begin
        if s < 0.0 or (s <= 0.0 and not late):
            break
        thrust = float(row[P_THRUST] + s * row[P_THRUST_SLOPE])
        mass -= float(s * (row[P_FLOW] + 0.5 * s * row[P_FLOW_SLOPE]))
    return thrust, mass


def steering_arcs(found: SearchResult) -> tuple[SteeringArc, ...]:
    """Return steering law, masses and velocity gain of each piece of the flight."""
    problem = found.transcription.problem
    laws = steering_laws(found.transcription, found.variables)
    cutoff = found.cutoff_s
    drops = found.drop_times_s
    finish = problem.start_time + float(found.final[0])
    edges = {float(t) for t in problem.profile[:, P_TIME] if t < cutoff}
    edges |= {law.time for law in laws} | set(drops) | {cutoff, finish}
    edges |= {cutoff + float(t) for t in problem.tail[:, P_TIME]}
    arcs = []
    for begin, end in pairwise(sorted(t for t in edges if problem.start_time <= t <= finish)):
        if end - begin <= _SIDE:
            continue
        gone = sum(
            float(row[D_MASS])
            for row, t in zip(problem.drops, drops, strict=True)
            if t <= begin + _SIDE
        )
        law = _law_in_force(found, laws, begin)
        vector = law.at(begin)
        size = float(np.linalg.norm(vector))
        thrust, mass = _profile_at(problem, cutoff, begin, True)
        last_thrust, last_mass = _profile_at(problem, cutoff, end, False)
        if thrust != last_thrust:
            gain = _ramp_gain(problem, cutoff, begin, end, gone)
        elif mass > last_mass:
            exhaust_velocity = thrust * (end - begin) / (mass - last_mass)
            gain = exhaust_velocity * math.log((mass - gone) / (last_mass - gone))
        else:
            gain = 0.0
        arcs.append(
            steering_arc(
                (begin, end),
                vector / size,
                law.rate / size,
                (mass - gone, last_mass - gone),
                gain,
            )
        )
    return tuple(arcs)


def _ramp_gain(problem: Problem, cutoff: float, begin: float, end: float, gone: float) -> float:
    """Integrate the thrust acceleration under varying thrust, m/s."""
    half = 0.5 * (end - begin)
    gain = 0.0
    for x, w in zip(*_GAUSS, strict=True):
        thrust, mass = _profile_at(problem, cutoff, begin + half * (1.0 + x), True)
        gain += float(half * w * thrust / (mass - gone))
    return gain


def jettison_times(found: SearchResult, count: int) -> tuple[float, ...]:
    """Return the time of every jettison of the mission, s; nan if it does not happen."""
    times = [math.nan] * count
    for j, t in found.transcription.fixed_jettisons:
        if t <= found.cutoff_s:
            times[j] = t
    for j, t in zip(found.transcription.heating_jettisons, found.drop_times_s, strict=True):
        times[j] = t
    return tuple(times)
