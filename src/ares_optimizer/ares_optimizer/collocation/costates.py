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
from ares_models.kernels.aerodynamics import body_force, has_attitude, local_vertical, pressure_loss
from ares_models.kernels.environment import gravity
from ares_optimizer.collocation.air import net_thrust
from ares_optimizer.collocation.arrays import COASTING, GUIDED, VERTICAL
from ares_optimizer.collocation.radau import radau
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.thrust import acceleration_terms, mass_after
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.solution import Costates

Array = NDArray[np.float64]
#: Force, relative to the thrust of a burn, at which the direction of the thrust is not settled.
_LITTLE = 1e-3


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
    """Hold the motion by thrust and air at one point.

    Attributes:
        acceleration: m/s2.
        direction: of the thrust, unit vector.
        flow: kg/s.
        slope: rate of the mass costate, kg/kg/s.
    """

    acceleration: Array
    direction: Array
    flow: float
    slope: float


def _terms(
    program: CollocationProgram,
    p: int,
    fraction: float,
    point: StoppingPoint,
    sample: tuple[Array, Array, Array],
) -> _Terms:
    """Return the motion by thrust and air in phase ``p``.

    Args:
        program: the program.
        p: phase.
        fraction: of the phase that has passed.
        point: solution of the program.
        sample: state, m and m/s, its costate, and the thrust direction of the solution. The thrust
            of a guided phase is along the primer, where the angle of attack changes nothing else,
            or where there is next to no force; not if a cost of waste settles it.
    """
    phase = program.phases[p]
    state, costate, u = sample
    primer = costate[3:]
    mass = float(point.x[program.masses[p]])
    length = float(point.x[program.lengths[p]])
    left = mass_after(phase, fraction, length, mass)[0] * program.mass
    thrust = flow = 0.0
    arc = program.arrays.arcs[phase["arc"]]
    surroundings = program.arrays.environment[0], program.arrays.atmosphere
    r, v = tuple(state[:3].tolist()), tuple(state[3:].tolist())
    if phase["steering"] != COASTING:
        terms = acceleration_terms(phase, fraction, length, mass)
        thrust = terms[0] * program.speed / program.time * left
        if phase["in_air"]:
            lost = pressure_loss(arc, r, *surroundings)
            thrust, _ = net_thrust(thrust, lost, float(arc["thrust"]))
        s = (fraction - float(phase["from_end"])) * length
        flow = float(phase["flow"] + s * phase["flow_slope"]) * program.mass / program.time

    def force_of_air(along: Array) -> Array:
        if not phase["in_air"]:
            return np.zeros(3)
        return np.array(body_force(arc, r, v, tuple(along.tolist()), *surroundings))

    if phase["steering"] == VERTICAL:
        u = np.array(local_vertical(r, surroundings[0]))
    force = force_of_air(u)
    angled = phase["in_air"] and (has_attitude(arc) or math.isfinite(arc["max_q_alpha"]))
    pushed = thrust + float(np.linalg.norm(force)) > _LITTLE * float(arc["thrust"])
    size = float(np.linalg.norm(primer))
    primed = phase["steering"] == GUIDED and size > 0.0 and program.added_cost.nnz == 0
    if primed and not (angled and pushed):
        u = primer / size
        force = force_of_air(u)
    force = force + thrust * u if phase["steering"] != COASTING else force
    return _Terms(force / left, u, flow, float(primer @ force) / left**2)


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
                sample = state, costate, u
                terms = _terms(program, p, fractions[number], point, sample)
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
