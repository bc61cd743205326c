# SPDX-License-Identifier: Apache-2.0
"""Compute values, Jacobian and Hessian of the sparse program.

Radau IIA collocation: in an interval of width h, the derivative of the polynomial through the
states at its begin and at its d points equals the motion at each point,

    sum_j D_ij x_j = h f(x_i, u_i)          (Garg and others, Automatica 46, 2010).

The motion is r' = v, v' = g(r) + a u. The thrust acceleration a is a closed form of the time into
the phase and of the mass at its begin, so the mass is not a state.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionRecords, Record
from ares_models.jit import allocating, kernel
from ares_models.kernels.aerodynamics import air_at
from ares_models.kernels.environment import (
    air_velocity,
    altitude,
    altitude_gradient,
    log_heating_gradient,
    pulled_back,
)
from ares_models.kernels.vectors import Vector, add, axpy, cross, dot, norm, scale
from ares_optimizer.collocation.air import (
    AXES,
    LOCALS,
    air_motion,
    local_count,
    local_gradient,
    vector_at,
)
from ares_optimizer.collocation.arrays import (
    COASTING,
    DYNAMIC_PRESSURE_RULE,
    FLOOR_RULE,
    HEATING_RULE,
    PERIGEE_RULE,
    Q_ALPHA_RULE,
)
from ares_optimizer.collocation.thrust import acceleration_terms, burnt_terms, mass_after
from ares_optimizer.kernels.terminal import MAX_ROWS, SCALE, terminal_rows
from ares_optimizer.two_point.arrays import INVERSE_SQUARE, Gravity
from ares_optimizer.two_point.kernels.gravity import gravity_terms, oblate_curvature

Array = NDArray[np.float64]

#: Difference step for second derivatives, in the units of the program.
_STEP = 1e-5
#: Share of the least perigee by which an orbit is above the circle there, whose constraint has no
#: gradient. An ellipse exceeds the perigee by far less.
_ROUNDED = 1.2e-6
#: Number of variables of a constraint: position, velocity, thrust direction.
RULE_LOCALS = 9


class Program(NamedTuple):
    """Hold the program for the kernels.

    Attributes:
        phases: dtype PHASE.
        points: dtype POINT.
        rules: dtype RULE.
        targets: dtype TARGET: the mission's, then the orbits that coasts name.
        derivative: shape (d, d + 1), D.
        controls: shape (n,), index of the first variable of each direction.
        oblateness: 1.5 J2, with mu and the equatorial radius 1.
        radius: unit of length, m.
        speed: unit of speed, m/s.
        mass: unit of mass, kg.
    """

    phases: NDArray[Any]
    points: NDArray[Any]
    rules: NDArray[Any]
    targets: NDArray[Any]
    derivative: Array
    controls: NDArray[np.int64]
    oblateness: float
    radius: float
    speed: float
    mass: float


@kernel
def units_of(program: Program) -> tuple[float, float, float]:
    """Return the units of length, m, speed, m/s, and mass, kg."""
    return (program.radius, program.speed, program.mass)


@kernel
def field_in_units(oblateness: float) -> Gravity:
    """Return the gravity field with mu = 1."""
    return Gravity(1.0, 0.0, INVERSE_SQUARE, oblateness)


@kernel
def curvature_times(r: Vector, oblateness: float, p: Vector, a: Vector) -> Vector:
    """Return the change of the gravity gradient along ``a``, times ``p``."""
    square = dot(r, r)
    k = 1.0 / (square * math.sqrt(square))
    rp, ra, pa = dot(r, p), dot(r, a), dot(p, a)
    first = 3.0 * k / square
    change = axpy(first * ra, p, axpy(first * rp, a, scale(first * pa, r)))
    change = axpy(-5.0 * first * ra * rp / square, r, change)
    if oblateness != 0.0:
        change = axpy(1.0, oblate_curvature(r, oblateness, p, a), change)
    return change


@kernel
def pressure_row(
    rule: Record,
    mission: MissionRecords,
    scales: tuple[float, float],
    state: tuple[Vector, Vector, Vector],
    c: Array,
    gradient: Array,
) -> None:
    """Write the row of a limit of q, or of q sin(angle of attack) squared; as in `rule_rows`.

    The square, 0.25 rho^2 w^2 |u x w|^2 with the air speed w, is smooth at all angles.
    """
    environment = mission.environment
    r, v, u = state
    air = air_at(altitude(r, environment), environment, mission.atmosphere)
    up = altitude_gradient(r, environment)
    w = air_velocity(r, v, environment)
    square = dot(w, w)
    by_u = (0.0, 0.0, 0.0)
    if rule.kind == DYNAMIC_PRESSURE_RULE:
        k = 0.5 * air.density / rule.level
        value = k * square
        by_w = scale(2.0 * k, w)
        by_h = value * air.density_slope
    else:
        k = 0.25 * air.density * air.density / (rule.level * rule.level)
        length, along = dot(u, u), dot(u, w)
        across = length * square - along * along
        value = k * square * across
        by_w = axpy(2.0 * k * across, w, scale(2.0 * k * square * length, w))
        by_w = axpy(-2.0 * k * square * along, u, by_w)
        by_u = axpy(-2.0 * k * square * along, w, scale(2.0 * k * square * square, u))
        by_h = 2.0 * value * air.density_slope
    c[0] = 1.0 - value
    by_r = axpy(by_h, up, pulled_back(r, by_w, environment))
    for i in range(3):
        gradient[0, i] = -scales[0] * by_r[i]
        gradient[0, 3 + i] = -scales[1] * by_w[i]
        gradient[0, 6 + i] = -by_u[i]


@kernel
def rule_state(rule: Record, x: Array) -> tuple[Vector, Vector, Vector]:
    """Return position, velocity and thrust direction of a constraint; scaled."""
    at = 6 * rule.node
    u = (0.0, 0.0, 0.0)
    if rule.control >= 0:
        u = vector_at(x, rule.control)
    return vector_at(x, at), vector_at(x, at + 3), u


@kernel
def rule_width(rule: Record) -> int:
    """Return the number of variables of a constraint."""
    return RULE_LOCALS if rule.control >= 0 else 6


@kernel
def rule_rows(
    rule: Record,
    targets: NDArray[Any],
    mission: MissionRecords,
    scales: tuple[float, float],
    state: tuple[Vector, Vector, Vector],
    c: Array,
    gradient: Array,
) -> None:
    """Write the values of a constraint on one state, and gradients by its scaled variables.

    Args:
        rule: record RULE.
        targets: dtype TARGET, of the program.
        mission: its records.
        scales: unit of length, m, and of speed, m/s.
        state: position and velocity, scaled, and thrust direction.
        c: shape (MAX_ROWS,), written: a target is met at 0, a limit at values >= 0.
        gradient: shape (MAX_ROWS, RULE_LOCALS), written.
    """
    r, v = scale(scales[0], state[0]), scale(scales[1], state[1])
    if rule.kind == DYNAMIC_PRESSURE_RULE or rule.kind == Q_ALPHA_RULE:
        pressure_row(rule, mission, scales, (r, v, state[2]), c, gradient)
        return
    mu = mission.environment.mu
    if rule.kind == HEATING_RULE:
        value, by_r, by_v = log_heating_gradient(r, v, mission.environment, mission.atmosphere)
        c[0] = rule.level - value
        for i in range(3):
            gradient[0, i] = -scales[0] * by_r[i]
            gradient[0, 3 + i] = -scales[1] * by_v[i]
        return
    if rule.kind == FLOOR_RULE:
        up = altitude_gradient(r, mission.environment)
        c[0] = (altitude(r, mission.environment) - rule.level) / scales[0]
        for i in range(3):
            gradient[0, i] = up[i]
            gradient[0, 3 + i] = 0.0
        return
    if rule.kind == PERIGEE_RULE:
        # h^2 - p^2 (v^2 - 2 mu / r) - 2 mu p = (r_p - p) (r_a - p) mu / a, with h^2 > mu p
        p = rule.level
        h = cross(r, v)
        size = norm(r)
        per = 1.0 / (2.0 * mu * p)
        c[0] = per * (dot(h, h) - mu * p)
        c[1] = per * (dot(h, h) - p * p * (dot(v, v) - 2.0 * mu / size) - 2.0 * mu * p)
        c[1] -= 0.5 * _ROUNDED * _ROUNDED
        by_r, by_v = scale(2.0, cross(v, h)), scale(2.0, cross(h, r))
        for i in range(3):
            gradient[0, i] = per * scales[0] * by_r[i]
            gradient[0, 3 + i] = per * scales[1] * by_v[i]
        by_r = axpy(-2.0 * p * p * mu / (size * size * size), r, by_r)
        by_v = axpy(-2.0 * p * p, v, by_v)
        for i in range(3):
            gradient[1, i] = per * scales[0] * by_r[i]
            gradient[1, 3 + i] = per * scales[1] * by_v[i]
        return
    rows = terminal_rows(targets[rule.target], mu, r, v, c, gradient)
    for row in range(rows):
        c[row] /= SCALE
        for i in range(3):
            gradient[row, i] *= scales[0] / SCALE
            gradient[row, 3 + i] *= scales[1] / SCALE


@kernel
def fill_rows(x: Array, program: Program, mission: MissionRecords, g: Array) -> None:
    """Write the defects, the lengths of the directions and the masses.

    Args:
        x: shape (n,), variables.
        program: see :class:`Program`.
        mission: its records.
        g: shape (m,), written except for linear rows and those of :func:`fill_rules`.
    """
    field = field_in_units(program.oblateness)
    d = program.derivative.shape[0]
    for i in range(program.points.shape[0]):
        point = program.points[i]
        phase = program.phases[point.phase]
        at = 6 * (point.node + point.number)
        h = point.width * x[phase.length]
        r, v = vector_at(x, at), vector_at(x, at + 3)
        motion, _ = gravity_terms(r, field, r)
        if phase.in_air == 1:
            motion = add(motion, air_motion(point, phase, mission, units_of(program), x))
        elif phase.steering != COASTING:
            length, mass = x[phase.length], x[phase.mass]
            a = acceleration_terms(phase, point.fraction, length, mass)[0]
            motion = axpy(a, vector_at(x, point.control), motion)
        for c in range(3):
            rate_r = 0.0
            rate_v = 0.0
            for j in range(d + 1):
                weight = program.derivative[point.number - 1, j]
                rate_r += weight * x[6 * (point.node + j) + c]
                rate_v += weight * x[6 * (point.node + j) + 3 + c]
            g[6 * i + c] = rate_r - h * v[c]
            g[6 * i + 3 + c] = rate_v - h * motion[c]
    row = 6 * program.points.shape[0]
    for i in range(program.controls.shape[0]):
        u = vector_at(x, program.controls[i])
        g[row + i] = 0.5 * (dot(u, u) - 1.0)
    for p in range(program.phases.shape[0]):
        phase = program.phases[p]
        end, _, _ = mass_after(phase, 1.0, x[phase.length], x[phase.mass])
        g[phase.link] = x[phase.end] - end


@allocating
def fill_rules(x: Array, program: Program, mission: MissionRecords, g: Array) -> None:
    """Write the rows of the constraints on single states."""
    c = np.zeros(MAX_ROWS)
    gradient = np.zeros((MAX_ROWS, RULE_LOCALS))
    scales = (program.radius, program.speed)
    for i in range(program.rules.shape[0]):
        rule = program.rules[i]
        state = rule_state(rule, x)
        rule_rows(rule, program.targets, mission, scales, state, c, gradient)
        for row in range(rule.rows):
            g[rule.row + row] = c[row]


@kernel
def fill_derivatives(program: Program, point: Record, values: Array, k: int) -> int:
    """Write the derivatives of the polynomials in the six defects of a point; return next index."""
    for _ in range(6):
        for j in range(program.derivative.shape[1]):
            values[k] = program.derivative[point.number - 1, j]
            k += 1
    return k


@kernel
def fill_air_jacobian(
    x: Array,
    program: Program,
    mission: MissionRecords,
    i: int,
    values: Array,
    k: int,
    gradient: Array,
) -> int:
    """Write the entries of the defects of a point in the air; return the next index.

    Args:
        x: shape (n,), variables.
        program: see :class:`Program`.
        mission: its records.
        i: index of the point.
        values: written from ``k`` on.
        k: first index.
        gradient: shape (3, LOCALS), scratch.
    """
    point = program.points[i]
    phase = program.phases[point.phase]
    h = point.width * x[phase.length]
    at = 6 * (point.node + point.number)
    v = vector_at(x, at + 3)
    k = fill_derivatives(program, point, values, k)
    field = field_in_units(program.oblateness)
    motion = local_gradient(point, phase, mission, units_of(program), field, x, gradient)
    for c in range(3):
        values[k] = -h
        values[k + 1] = -point.width * v[c]
        k += 2
        for j in range(local_count(phase)):
            values[k + j] = -h * gradient[c, j]
        values[k + 6] -= point.width * motion[c]
        k += local_count(phase)
    return k


@kernel
def fill_point_jacobian(
    x: Array, program: Program, i: int, values: Array, k: int, field: Gravity
) -> int:
    """Write the entries of the defects of a point; return the next index."""
    point = program.points[i]
    phase = program.phases[point.phase]
    length = x[phase.length]
    h = point.width * length
    at = 6 * (point.node + point.number)
    r, v = vector_at(x, at), vector_at(x, at + 3)
    motion, _ = gravity_terms(r, field, r)
    a, by_l, by_m = 0.0, 0.0, 0.0
    u = (0.0, 0.0, 0.0)
    if phase.steering != COASTING:
        terms = acceleration_terms(phase, point.fraction, length, x[phase.mass])
        a, by_l, by_m, _, _, _ = terms
        u = vector_at(x, point.control)
        motion = axpy(a, u, motion)
    k = fill_derivatives(program, point, values, k)
    for c in range(3):
        _, gradient_q = gravity_terms(r, field, AXES[c])
        values[k] = -h
        values[k + 1] = -point.width * v[c]
        values[k + 2] = -h * gradient_q[0]
        values[k + 3] = -h * gradient_q[1]
        values[k + 4] = -h * gradient_q[2]
        values[k + 5] = -point.width * motion[c] - h * by_l * u[c]
        k += 6
        if phase.steering != COASTING:
            values[k] = -h * a
            values[k + 1] = -h * by_m * u[c]
            k += 2
    return k


@allocating
def fill_jacobian(x: Array, program: Program, mission: MissionRecords, values: Array) -> int:
    """Write the varying entries of the Jacobian, in the order of the pattern.

    Returns:
        number of entries.
    """
    field = field_in_units(program.oblateness)
    k = 0
    local = np.zeros((3, LOCALS))
    for i in range(program.points.shape[0]):
        if program.phases[program.points[i].phase].in_air == 1:
            k = fill_air_jacobian(x, program, mission, i, values, k, local)
        else:
            k = fill_point_jacobian(x, program, i, values, k, field)
    for i in range(program.controls.shape[0]):
        for c in range(3):
            values[k] = x[program.controls[i] + c]
            k += 1
    for p in range(program.phases.shape[0]):
        phase = program.phases[p]
        _, by_length, by_mass = mass_after(phase, 1.0, x[phase.length], x[phase.mass])
        values[k] = 1.0
        values[k + 1] = -by_length
        values[k + 2] = -by_mass
        k += 3
    missed = np.zeros(MAX_ROWS)
    gradient = np.zeros((MAX_ROWS, RULE_LOCALS))
    scales = (program.radius, program.speed)
    for i in range(program.rules.shape[0]):
        rule = program.rules[i]
        state = rule_state(rule, x)
        rule_rows(rule, program.targets, mission, scales, state, missed, gradient)
        for row in range(rule.rows):
            for j in range(rule_width(rule)):
                values[k] = gradient[row, j]
                k += 1
    return k


@kernel
def fill_air_hessian(
    x: Array,
    program: Program,
    mission: MissionRecords,
    i: int,
    multipliers: Array,
    values: Array,
    k: int,
    scratch: tuple[Array, Array],
) -> int:
    """Write the contribution of the defects of a point in the air; return next index.

    Second derivatives are central differences of the gradient.

    Args: as in :func:`fill_air_jacobian`;
        scratch: shapes (3, LOCALS) and (LOCALS, LOCALS).
    """
    point = program.points[i]
    phase = program.phases[point.phase]
    w = point.width
    at = 6 * (point.node + point.number)
    p, q = vector_at(multipliers, 6 * i), vector_at(multipliers, 6 * i + 3)
    gradient, whole = scratch
    field = field_in_units(program.oblateness)
    units = units_of(program)
    count = local_count(phase)
    for j in range(count):
        column = at + j
        if j == 6:
            column = phase.length
        elif j == 7:
            column = phase.mass
        elif j > 7:
            column = point.control + j - 8
        kept = x[column]
        for side in range(2):
            step = _STEP if side == 0 else -_STEP
            x[column] = kept + step
            motion = local_gradient(point, phase, mission, units, field, x, gradient)
            h = w * x[phase.length]
            sign = 0.5 / step
            for other in range(count):
                along = 0.0
                for c in range(3):
                    along += q[c] * gradient[c, other]
                value = -h * along
                if other == 6:
                    value -= w * dot(q, motion)
                if side == 0:
                    whole[j, other] = sign * value
                else:
                    whole[j, other] += sign * value
        x[column] = kept
    for j in range(count):
        for other in range(j + 1):
            values[k] = 0.5 * (whole[j, other] + whole[other, j])
            if j == 6 and 3 <= other < 6:
                values[k] -= w * p[other - 3]
            k += 1
    return k


@kernel
def fill_point_hessian(
    x: Array, program: Program, i: int, multipliers: Array, values: Array, k: int
) -> int:
    """Write the contribution of a point's defects to the Hessian; return next index."""
    point = program.points[i]
    phase = program.phases[point.phase]
    length = x[phase.length]
    w = point.width
    h = w * length
    at = 6 * (point.node + point.number)
    r = vector_at(x, at)
    p, q = vector_at(multipliers, 6 * i), vector_at(multipliers, 6 * i + 3)
    _, gradient_q = gravity_terms(r, field_in_units(program.oblateness), q)
    for c in range(3):
        change = curvature_times(r, program.oblateness, q, AXES[c])
        for j in range(c + 1):
            values[k] = -h * change[j]
            k += 1
    for c in range(3):
        values[k] = -w * p[c]
        values[k + 1] = -w * gradient_q[c]
        k += 2
    if phase.steering == COASTING:
        return k
    u = vector_at(x, point.control)
    terms = acceleration_terms(phase, point.fraction, length, x[phase.mass])
    a, by_l, by_m, by_ll, by_lm, by_mm = terms
    along = dot(q, u)
    for c in range(3):
        values[k] = -w * (a + length * by_l) * q[c]
        values[k + 1] = -h * by_m * q[c]
        k += 2
    values[k] = -w * (2.0 * by_l + length * by_ll) * along
    values[k + 1] = -w * (by_m + length * by_lm) * along
    values[k + 2] = -h * by_mm * along
    return k + 3


@kernel
def fill_mass_hessian(phase: Record, x: Array, multipliers: Array, values: Array, k: int) -> int:
    """Write the contribution of a phase's masses to the Hessian; return next index."""
    weight = -multipliers[phase.link]
    if phase.fading > 0.0:
        part = math.exp(-phase.fading * x[phase.length])
        values[k] = weight * phase.fading * phase.fading * x[phase.mass] * part
        values[k + 1] = -weight * phase.fading * part
    else:
        _, _, burnt_ll = burnt_terms(phase, 1.0, x[phase.length])
        values[k] = -weight * burnt_ll
        values[k + 1] = 0.0
    return k + 2


@allocating
def fill_hessian(
    x: Array, multipliers: Array, program: Program, mission: MissionRecords, values: Array
) -> int:
    """Write the Hessian of the Lagrangian; the objective is linear.

    Args:
        x: shape (n,), variables.
        multipliers: shape (m,).
        program: see :class:`Program`.
        mission: its records.
        values: written in the order of the pattern.

    Returns:
        number of entries.
    """
    k = 0
    points = program.points.shape[0]
    scratch = (np.zeros((3, LOCALS)), np.zeros((LOCALS, LOCALS)))
    moved = x.copy()
    for i in range(points):
        if program.phases[program.points[i].phase].in_air == 1:
            k = fill_air_hessian(moved, program, mission, i, multipliers, values, k, scratch)
        else:
            k = fill_point_hessian(x, program, i, multipliers, values, k)
    for i in range(program.controls.shape[0]):
        for _ in range(3):
            values[k] = multipliers[6 * points + i]
            k += 1
    for p in range(program.phases.shape[0]):
        k = fill_mass_hessian(program.phases[p], x, multipliers, values, k)
    missed = np.zeros(MAX_ROWS)
    sides = np.zeros((2, MAX_ROWS, RULE_LOCALS))
    whole = np.zeros((RULE_LOCALS, RULE_LOCALS))
    scales = (program.radius, program.speed)
    for i in range(program.rules.shape[0]):
        rule = program.rules[i]
        width = rule_width(rule)
        for j in range(width):
            column = 6 * rule.node + j if j < 6 else rule.control + j - 6
            kept = moved[column]
            for side in range(2):
                moved[column] = kept + (_STEP if side == 0 else -_STEP)
                state = rule_state(rule, moved)
                rule_rows(rule, program.targets, mission, scales, state, missed, sides[side])
            moved[column] = kept
            for other in range(width):
                whole[j, other] = 0.0
                for row in range(rule.rows):
                    change = sides[0, row, other] - sides[1, row, other]
                    whole[j, other] += multipliers[rule.row + row] * change / (2.0 * _STEP)
        for j in range(width):
            for other in range(j + 1):
                values[k] = 0.5 * (whole[j, other] + whole[other, j])
                k += 1
    return k
