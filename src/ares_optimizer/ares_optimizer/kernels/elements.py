# SPDX-License-Identifier: Apache-2.0
"""Write targets by orbital elements as equations, differentiated by complex step.

A row is of order 1 for an error as large as the orbit, or of a radian in the plane. Rows that
vanish with the eccentricity are divided by that of the target.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    NAMES_APOGEE,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_C3,
    NAMES_ECCENTRICITY,
    NAMES_FLIGHT_PATH_ANGLE,
    NAMES_INCLINATION,
    NAMES_PERIGEE,
    NAMES_RADIUS,
    NAMES_SEMI_MAJOR_AXIS,
    NAMES_SPEED,
    NAMES_TRUE_ANOMALY,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.targets import names, size_and_shape
from ares_models.kernels.vectors import ComplexVector, Vector, axpy, cross, dot, quotient, scale

Array = NDArray[np.float64]

#: Rows, in their order.
RADIUS, SPEED, ANGLE, ENERGY, APSIS, TILT, NODE, ACROSS, TOWARDS, AHEAD, ANOMALY = range(11)

_STEP = 1e-20  # complex step, m and m/s, without loss of digits
_EQUATORIAL = 1e-6  # sine of the inclination below which the node is undefined
_ROUND = 1e-3  # least eccentricity by which a row is divided


@kernel
def _sizes(target: Record) -> int:
    """Return the number of elements of size and shape that a target names."""
    count = 0
    for element in (
        NAMES_PERIGEE,
        NAMES_APOGEE,
        NAMES_SEMI_MAJOR_AXIS,
        NAMES_ECCENTRICITY,
        NAMES_C3,
    ):
        if names(target, element):
            count += 1
    return count


@kernel
def _holds_plane(target: Record) -> bool:
    """Return true if the target fixes the unit normal: with the node, or equatorial."""
    return names(target, NAMES_INCLINATION) and (
        names(target, NAMES_ASCENDING_NODE) or abs(math.sin(target.inclination)) < _EQUATORIAL
    )


@kernel
def has_row(row: int, target: Record) -> bool:
    """Return true if a target has a row.

    Two elements of size and shape become energy and perigee; with a true anomaly they become
    energy, radius and angle, with an argument of perigee energy and eccentricity vector. These
    rows do not confuse perigee and apogee of a nearly circular orbit.
    """
    known = _sizes(target) == 2
    placed = known and names(target, NAMES_TRUE_ANOMALY)
    pointed = known and names(target, NAMES_ARGUMENT_OF_PERIGEE) and not placed
    if row == RADIUS:
        return placed or names(target, NAMES_RADIUS)
    if row == SPEED:
        return names(target, NAMES_SPEED)
    if row == ANGLE:
        return placed or names(target, NAMES_FLIGHT_PATH_ANGLE)
    if row == ENERGY:
        return known or names(target, NAMES_SEMI_MAJOR_AXIS) or names(target, NAMES_C3)
    if row == APSIS:
        return not placed and not pointed and (known or names(target, NAMES_APOGEE))
    if row == TILT:
        return names(target, NAMES_INCLINATION) and not _holds_plane(target)
    if row == NODE:
        return names(target, NAMES_ASCENDING_NODE) or _holds_plane(target)
    if row == ACROSS:
        return _holds_plane(target)
    if row == TOWARDS:
        return pointed
    if row == AHEAD:
        return names(target, NAMES_ARGUMENT_OF_PERIGEE)
    return names(target, NAMES_TRUE_ANOMALY) and not placed


@kernel
def _plane_row(row: int, target: Record, normal: ComplexVector) -> complex:
    """Return the error of the unit normal: inclination, or a component that vanishes."""
    if row == TILT:
        return normal[2] - math.cos(target.inclination)
    cos = math.cos(target.ascending_node)
    sin = math.sin(target.ascending_node)
    if row == NODE:
        return cos * normal[0] + sin * normal[1]
    ci = math.cos(target.inclination)
    return ci * (cos * normal[1] - sin * normal[0]) + math.sin(target.inclination) * normal[2]


@kernel
def _eccentricity_component(
    turn: float,
    target: Record,
    mu: float,
    r: ComplexVector,
    v: ComplexVector,
    normal: ComplexVector,
) -> complex:
    """Return the component of the eccentricity vector, ``turn`` rad from perigee.

    The direction is ``turn`` ahead of the perigee of the target.
    """
    size = np.sqrt(normal[0] * normal[0] + normal[1] * normal[1])
    node = (quotient(-normal[1], size), quotient(normal[0], size), 0.0 * size)
    if names(target, NAMES_ASCENDING_NODE):
        cos = math.cos(target.ascending_node)
        sin = math.sin(target.ascending_node)
        node = (complex(cos, 0.0), complex(sin, 0.0), complex(0.0, 0.0))
    across = cross(normal, node)
    q = dot(v, v) / mu - quotient(1.0 + 0.0j, np.sqrt(dot(r, r)))
    eccentric = axpy(q, r, scale(-dot(r, v) / mu, v))
    argument = target.argument_of_perigee + turn
    return math.cos(argument) * dot(eccentric, node) + math.sin(argument) * dot(eccentric, across)


@kernel
def _place(target: Record, mu: float) -> tuple[float, float]:
    """Return radius, m, and sine of the flight-path angle of the target, if it has them."""
    if names(target, NAMES_RADIUS):
        return target.radius, math.sin(target.flight_path_angle)
    c3, perigee = size_and_shape(target, mu)
    e = 1.0 + perigee * c3 / mu
    towards = e * math.cos(target.true_anomaly)
    ahead = e * math.sin(target.true_anomaly)
    radius = perigee * (1.0 + e) / (1.0 + towards)
    return radius, ahead / math.sqrt((1.0 + towards) * (1.0 + towards) + ahead * ahead)


@kernel
def row_value(row: int, target: Record, mu: float, r: ComplexVector, v: ComplexVector) -> complex:
    """Return the error of a state in one row.

    Args:
        row: one for which :func:`has_row` is true.
        target: record TARGET of kind TARGET_ELEMENTS.
        mu: m3/s2.
        r: m.
        v: m/s.
    """
    radius = np.sqrt(dot(r, r))
    square = dot(v, v)
    along = dot(r, v)
    wanted, sine = _place(target, mu)
    if row == RADIUS:
        return radius / wanted - 1.0
    if row == SPEED:
        return np.sqrt(square) / target.speed - 1.0
    if row == ANGLE:
        return quotient(along, radius * np.sqrt(square)) - sine
    c3 = target.c3
    apsis = target.perigee_radius
    if _sizes(target) == 2:
        c3, apsis = size_and_shape(target, mu)
    elif names(target, NAMES_SEMI_MAJOR_AXIS):
        c3 = -mu / target.semi_major_axis
    elif names(target, NAMES_APOGEE):
        apsis = target.apogee_radius
    energy = square - quotient(2.0 * mu + 0.0j, radius)
    if row == ENERGY:
        return (energy - c3) * (0.5 * target.perigee_radius / mu)
    h = cross(r, v)
    momentum = dot(h, h)
    least = 1.0 / max(target.eccentricity, _ROUND)
    if row == APSIS:
        return (momentum - apsis * apsis * energy - 2.0 * mu * apsis) * (0.5 * least / (mu * apsis))
    if row == ANOMALY:
        towards = quotient(momentum, mu * radius) - 1.0
        ahead = quotient(np.sqrt(momentum) * along, mu * radius)
        anomaly = target.true_anomaly
        return least * (math.cos(anomaly) * ahead - math.sin(anomaly) * towards)
    normal = scale(quotient(1.0 + 0.0j, np.sqrt(momentum)), h)
    if row == TOWARDS:
        wanted = 1.0 + apsis * c3 / mu
        return _eccentricity_component(0.0, target, mu, r, v, normal) - wanted
    if row == AHEAD:
        if has_row(TOWARDS, target):
            least = 1.0
        return least * _eccentricity_component(0.5 * math.pi, target, mu, r, v, normal)
    return _plane_row(row, target, normal)


@kernel
def _stepped(x: Vector, component: int) -> ComplexVector:
    """Return a vector with an imaginary step in one component; in none for 3 and more."""
    return (
        complex(x[0], _STEP if component == 0 else 0.0),
        complex(x[1], _STEP if component == 1 else 0.0),
        complex(x[2], _STEP if component == 2 else 0.0),
    )


@kernel
def element_rows(
    target: Record, mu: float, r: Vector, v: Vector, c: Array, gradient: Array, size: float
) -> int:
    """Write values and gradients of the rows of a TARGET_ELEMENTS target, times ``size``.

    Args: as :func:`ares_optimizer.kernels.terminal.terminal_rows`.

    Returns:
        number of rows.
    """
    count = 0
    for row in range(ANOMALY + 1):
        if not has_row(row, target):
            continue
        for k in range(6):
            moved = row_value(row, target, mu, _stepped(r, k), _stepped(v, k - 3 if k > 2 else 3))
            c[count] = size * moved.real
            gradient[count, k] = size * (moved.imag / _STEP)
        count += 1
    return count
