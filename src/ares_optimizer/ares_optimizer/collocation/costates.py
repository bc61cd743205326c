# SPDX-License-Identifier: Apache-2.0
"""Compute costates and Hamiltonian from the multipliers of the sparse program.

With defects D x = h f and multipliers L_i of an interval, the costate at Radau point i is L_i
divided by its quadrature weight, and that at the begin of the interval is - sum_i D_i0 L_i (Garg
and others, Comput. Optim. Appl. 49, 2011). Units are kg of final mass per unit of the state; the
thrust is along the velocity costate.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import HEATING_LIMIT
from ares_models.kernels.environment import gravity
from ares_optimizer.collocation.arrays import COASTING, GUIDED
from ares_optimizer.collocation.kernels import acceleration_terms
from ares_optimizer.collocation.radau import radau
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.solution import Costates

Array = NDArray[np.float64]


class Adjoint(NamedTuple):
    """Hold costates along a flight.

    Attributes:
        phase: shape (n,), phase of each sample.
        time: s, shape (n,), with both ends of each phase.
        state: shape (n, 6), m and m/s.
        by_position: kg/m, shape (n, 3).
        by_velocity: kg s/m, shape (n, 3).
        direction: of the thrust, shape (n, 3); nan in a coast.
        hamiltonian: kg/s, shape (n,), without the mass costate term.
        whole: kg/s, shape (n,), with it, up to a constant in each stage.
    """

    phase: NDArray[np.int64]
    time: Array
    state: Array
    by_position: Array
    by_velocity: Array
    direction: Array
    hamiltonian: Array
    whole: Array


class _Terms(NamedTuple):
    """Hold the thrust at one point: m/s2, unit vector, kg/s, rate of the mass costate."""

    acceleration: Array
    direction: Array
    flow: float
    slope: float


def _terms(
    program: CollocationProgram, p: int, s: float, point: StoppingPoint, primer: Array, u: Array
) -> _Terms:
    """Return the thrust of phase ``p`` at the scaled time ``s``, along the primer or held."""
    phase = program.phases[p]
    if phase["steering"] == COASTING:
        return _Terms(np.zeros(3), u, 0.0, 0.0)
    if phase["steering"] == GUIDED:
        size = float(np.linalg.norm(primer))
        u = primer / size if size > 0.0 else u
    mass = float(point.x[program.masses[p]])
    a = acceleration_terms(phase, s, mass)[0] * program.speed / program.time
    left = mass - s * (phase["flow"] + 0.5 * s * phase["flow_slope"])
    flow = float(phase["flow"] + s * phase["flow_slope"]) * program.mass / program.time
    return _Terms(a * u, u, flow, a * float(primer @ u) / float(left * program.mass))


def adjoint_of(program: CollocationProgram, point: StoppingPoint) -> Adjoint:
    """Compute costates and Hamiltonian at the begin and the Radau points of each phase."""
    nodes, derivative, integral = radau(program.degree)
    weights = integral[-1]
    d = program.degree
    x = point.x
    states = x[: 6 * program.nodes].reshape(-1, 6) * np.repeat((program.radius, program.speed), 3)
    multipliers = point.multipliers[: 6 * len(program.points)].reshape(-1, d, 6)
    units = program.mass / np.repeat((program.radius, program.speed), 3)
    begin = float(program.start["time"][0])
    environment = program.arrays.environment[0]
    samples: list[Array] = []
    phases: list[int] = []
    interval = 0
    for p, count in enumerate(program.intervals):
        length = float(x[program.lengths[p]])
        first = int(program.first[p])
        heavy = 0.0
        for k in range(int(count)):
            block = multipliers[interval]
            costates = np.vstack((-derivative[:, 0] @ block, block / weights[:, None])) * units
            width = float(program.breaks[p][k + 1] - program.breaks[p][k])
            fractions = program.breaks[p][k] + width * nodes
            rows, slopes = [], []
            for number in range(d + 1):
                costate, state = costates[number], states[first + k * d + number]
                at = program.control_of[p][max(0, k * d + number - 1)]
                u = x[at : at + 3] if at >= 0 else np.full(3, math.nan)
                terms = _terms(program, p, fractions[number] * length, point, costate[3:], u)
                motion = np.array(gravity(tuple(state[:3]), environment)) + terms.acceleration
                hamiltonian = float(costate[:3] @ state[3:] + costate[3:] @ motion)
                time = begin + fractions[number] * length * program.time
                rows.append((time, *state, *costate, *terms.direction, hamiltonian, terms.flow))
                slopes.append(terms.slope)
            table = np.array(rows)
            # the mass costate falls by the integral of lambda_v . u T/m^2
            step = width * length * program.time
            gained = np.concatenate(([0.0], step * (integral @ np.array(slopes[1:]))))
            whole = table[:, -2] - table[:, -1] * (heavy + gained)
            heavy += gained[-1]
            table[:, -1] = whole
            samples.append(table if k == 0 else table[1:])
            phases += [p] * len(samples[-1])
            interval += 1
        begin += length * program.time
    table = np.vstack(samples)
    return Adjoint(
        np.array(phases),
        table[:, 0],
        table[:, 1:7],
        table[:, 7:10],
        table[:, 10:13],
        table[:, 13:16],
        table[:, 16],
        table[:, 17],
    )


def spread_of(program: CollocationProgram, adjoint: Adjoint) -> dict[int, float]:
    """Return the relative spread of the Hamiltonian in each phase of constant flow."""
    size = max(float(np.abs(adjoint.hamiltonian).max()), 1e-300)
    return {
        p: float(np.ptp(adjoint.whole[adjoint.phase == p])) / size
        for p, phase in enumerate(program.phases)
        if phase["thrust_slope"] == 0.0 and phase["fading"] == 0.0
    }


def costates_of(program: CollocationProgram, point: StoppingPoint, adjoint: Adjoint) -> Costates:
    """Scale the costates to |lambda_v| = 1 at the start, for a solution."""
    size = max(float(np.linalg.norm(adjoint.by_velocity[0])), 1e-300)
    pis = []
    for j, jettison in enumerate(program.arrays.jettisons):
        row = program.heating_rows.get(j)
        if jettison["criterion"] == HEATING_LIMIT and row is not None:
            pi = float(point.multipliers[row]) * program.mass / size
            pis.append(pi / float(jettison["value"]))
    return Costates(
        adjoint.time,
        adjoint.by_position / size,
        adjoint.by_velocity / size,
        adjoint.hamiltonian / size,
        tuple(spread_of(program, adjoint).values()),
        tuple(pis),
    )
