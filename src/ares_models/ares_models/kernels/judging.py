# SPDX-License-Identifier: Apache-2.0
"""Kernels of the judge: errors against the target, their tolerances, the outcome."""

import math

import numpy as np

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
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.orbit_errors import allowed_figures, orbit_figures
from ares_models.kernels.states import insertion_quantities
from ares_models.kernels.targets import (
    desired_state,
    named_plane,
    perigee_radius,
    project_to_plane,
    size_and_shape,
)
from ares_models.kernels.vectors import Vector, axpy, cross, dot, norm, scale, unit
from ares_models.tolerances import (
    FLIGHT_PATH_ANGLE_DEG,
    ORIENTATION_DEG,
    PERIGEE_SLACK_M,
    RADIUS_M,
    SAFE_PERIGEE_M,
    SAME_ANGLE_DEG,
    SAME_RADIUS_M,
    SAME_SPEED_M_S,
    SPEED_M_S,
)

#: Outcomes from the best to the worst, see ``ares_models.judge.End``.
TARGET, LOWERED, SAFE_ORBIT, SUBORBITAL = range(4)

#: Fields of a judgement, part of larger records: errors, flown minus target, nan if free; then
#: their tolerances; SI and rad.
JUDGED = [
    ("judged", np.int64),  # NAMES_* of the figures that the target constrains
    ("end", np.int64),  # TARGET, LOWERED, SAFE_ORBIT or SUBORBITAL
    ("lacking_speed", np.float64),  # m/s, speed deficit of the energy at the target's lowest point
    ("perigee_radius", np.float64),  # m, flown
    ("apogee_radius", np.float64),  # m, flown; inf: an escape
    ("radius_error", np.float64),
    ("speed_error", np.float64),
    ("flight_path_angle_error", np.float64),
    ("inclination_error", np.float64),
    ("ascending_node_error", np.float64),
    ("argument_of_perigee_error", np.float64),
    ("perigee_radius_error", np.float64),
    ("apogee_radius_error", np.float64),
    ("semi_major_axis_error", np.float64),
    ("eccentricity_error", np.float64),
    ("c3_error", np.float64),
    ("true_anomaly_error", np.float64),
    ("radius_allowed", np.float64),
    ("speed_allowed", np.float64),
    ("flight_path_angle_allowed", np.float64),
    ("inclination_allowed", np.float64),
    ("ascending_node_allowed", np.float64),
    ("argument_of_perigee_allowed", np.float64),
    ("perigee_radius_allowed", np.float64),
    ("apogee_radius_allowed", np.float64),
    ("semi_major_axis_allowed", np.float64),
    ("eccentricity_allowed", np.float64),
    ("c3_allowed", np.float64),
    ("true_anomaly_allowed", np.float64),
]

_ANGLE = math.radians(FLIGHT_PATH_ANGLE_DEG)
_ORIENTATION = math.radians(ORIENTATION_DEG)
_SAME_ANGLE = math.radians(SAME_ANGLE_DEG)
_FLAT = 0.1  # sine of the inclination below which a node means less
_STATE = NAMES_RADIUS | NAMES_SPEED | NAMES_FLIGHT_PATH_ANGLE | NAMES_INCLINATION
_SIZES = (NAMES_PERIGEE, NAMES_APOGEE, NAMES_SEMI_MAJOR_AXIS, NAMES_ECCENTRICITY, NAMES_C3)
_KEPLERIAN = (
    _STATE
    | NAMES_ASCENDING_NODE
    | NAMES_ARGUMENT_OF_PERIGEE
    | NAMES_SEMI_MAJOR_AXIS
    | NAMES_ECCENTRICITY
)


@kernel
def half_turn(angle: float) -> float:
    """Wrap an angle to -pi..pi, rad."""
    return math.atan2(math.sin(angle), math.cos(angle))


@kernel
def judged_by(target: Record) -> int:
    """Return the NAMES_* of the figures that a target constrains."""
    if target.kind == TARGET_ELEMENTS:
        return target.named
    if target.kind == TARGET_KEPLERIAN:
        return _KEPLERIAN
    if target.kind == TARGET_RADIUS_SPEED_ANGLE_PLANE:
        return _STATE | NAMES_ASCENDING_NODE
    return _STATE


@kernel
def argument_of_perigee(r: Vector, v: Vector, mu: float, node: float) -> float:
    """Return the argument of perigee, rad, from the ascending node at ``node``, rad."""
    eccentric = axpy(dot(v, v) / mu - 1.0 / norm(r), r, scale(-dot(r, v) / mu, v))
    to_node = (math.cos(node), math.sin(node), 0.0)
    normal = unit(cross(r, v))
    return math.atan2(dot(eccentric, cross(normal, to_node)), dot(eccentric, to_node))


@kernel
def _off(judged: int, name: int, flown: float, wanted: float) -> float:
    """Return flown minus wanted; nan if the figure is free."""
    return flown - wanted if judged & name else math.nan


@kernel
def _turned(judged: int, name: int, flown: float, wanted: float) -> float:
    """Return flown minus wanted of an angle, wrapped; nan if the figure is free."""
    return half_turn(flown - wanted) if judged & name else math.nan


@kernel
def wanted_state(r: Vector, target: Record, mu: float) -> tuple[float, float, float]:
    """Return radius, speed and flight-path angle of a target: m, m/s, rad.

    For a Keplerian target, with its free place on the orbit, it is the state at the point of the
    orbit nearest in direction to ``r``.
    """
    if target.kind != TARGET_KEPLERIAN:
        return target.radius, target.speed, target.flight_path_angle
    normal = named_plane(target)
    wanted_r, wanted_v, _ = desired_state(target, mu, project_to_plane(r, normal), normal)
    radius, speed, angle, _, _ = insertion_quantities(wanted_r, wanted_v)
    return radius, speed, angle


@kernel
def fill_errors(r: Vector, v: Vector, target: Record, mu: float, result: Record) -> None:
    """Write the errors, flown minus target, into a record with the fields JUDGED.

    Args:
        r: m.
        v: m/s.
        target: record TARGET.
        mu: m3/s2.
        result: changed.
    """
    radius, speed, angle, inclination, node = insertion_quantities(r, v)
    perigee, apogee, axis, e, c3, anomaly = orbit_figures(radius, speed, angle, mu)
    judged = judged_by(target)
    argument = argument_of_perigee(r, v, mu, node)
    wanted_radius, wanted_speed, wanted_angle = wanted_state(r, target, mu)
    result.judged = judged
    result.perigee_radius = perigee
    result.apogee_radius = apogee
    result.radius_error = _off(judged, NAMES_RADIUS, radius, wanted_radius)
    result.speed_error = _off(judged, NAMES_SPEED, speed, wanted_speed)
    result.flight_path_angle_error = _off(judged, NAMES_FLIGHT_PATH_ANGLE, angle, wanted_angle)
    result.inclination_error = _off(judged, NAMES_INCLINATION, inclination, target.inclination)
    result.ascending_node_error = _turned(judged, NAMES_ASCENDING_NODE, node, target.ascending_node)
    result.argument_of_perigee_error = _turned(
        judged, NAMES_ARGUMENT_OF_PERIGEE, argument, target.argument_of_perigee
    )
    result.perigee_radius_error = _off(judged, NAMES_PERIGEE, perigee, target.perigee_radius)
    result.apogee_radius_error = _off(judged, NAMES_APOGEE, apogee, target.apogee_radius)
    result.semi_major_axis_error = _off(judged, NAMES_SEMI_MAJOR_AXIS, axis, target.semi_major_axis)
    result.eccentricity_error = _off(judged, NAMES_ECCENTRICITY, e, target.eccentricity)
    result.c3_error = _off(judged, NAMES_C3, c3, target.c3)
    result.true_anomaly_error = _turned(judged, NAMES_TRUE_ANOMALY, anomaly, target.true_anomaly)


@kernel
def _own_eccentricity(target: Record, mu: float) -> float:
    """Return the eccentricity of a target's orbit; inf if it is free or undetermined."""
    if target.kind == TARGET_KEPLERIAN:
        return target.eccentricity
    count = 0
    for name in _SIZES:
        if target.kind == TARGET_ELEMENTS and target.named & name:
            count += 1
    if count < 2:
        return math.inf
    c3, perigee = size_and_shape(target, mu)
    return 1.0 + perigee * c3 / mu


@kernel
def fill_allowed(r: Vector, v: Vector, target: Record, mu: float, result: Record) -> None:
    """Write the tolerance of each error of a state.

    The tolerance of the argument of perigee is that of the node plus that of the perigee within
    the plane. The tolerance of the node grows as the inclination approaches 0.

    Args: as in :func:`fill_errors`.
    """
    radius, speed, angle, inclination, _ = insertion_quantities(r, v)
    wanted = _own_eccentricity(target, mu)
    perigee, apogee, axis, e, c3, anomaly = allowed_figures(radius, speed, angle, mu, wanted)
    node = min(math.pi, _ORIENTATION * max(1.0, _FLAT / math.sin(inclination)))
    result.radius_allowed = RADIUS_M
    result.speed_allowed = SPEED_M_S
    result.flight_path_angle_allowed = _ANGLE
    result.inclination_allowed = _ORIENTATION
    result.ascending_node_allowed = node
    result.argument_of_perigee_allowed = min(math.pi, node + anomaly)
    result.perigee_radius_allowed = perigee
    result.apogee_radius_allowed = apogee
    result.semi_major_axis_allowed = axis
    result.eccentricity_allowed = e
    result.c3_allowed = c3
    result.true_anomaly_allowed = anomaly


@kernel
def _met(judged: int, name: int, error: float, allowed: float) -> bool:
    """Return whether a figure is free or its error within tolerance; nan is not."""
    return judged & name == 0 or abs(error) <= allowed


@kernel
def is_met(result: Record) -> bool:
    """Return whether all errors are within their tolerances."""
    by = result.judged
    return (
        _met(by, NAMES_RADIUS, result.radius_error, result.radius_allowed)
        and _met(by, NAMES_SPEED, result.speed_error, result.speed_allowed)
        and _met(
            by,
            NAMES_FLIGHT_PATH_ANGLE,
            result.flight_path_angle_error,
            result.flight_path_angle_allowed,
        )
        and _met(by, NAMES_INCLINATION, result.inclination_error, result.inclination_allowed)
        and _met(
            by, NAMES_ASCENDING_NODE, result.ascending_node_error, result.ascending_node_allowed
        )
        and _met(
            by,
            NAMES_ARGUMENT_OF_PERIGEE,
            result.argument_of_perigee_error,
            result.argument_of_perigee_allowed,
        )
        and is_orbit_met(result)
    )


@kernel
def is_orbit_met(result: Record) -> bool:
    """Return whether the errors of size, shape and place are within their tolerances."""
    by = result.judged
    return (
        _met(by, NAMES_PERIGEE, result.perigee_radius_error, result.perigee_radius_allowed)
        and _met(by, NAMES_APOGEE, result.apogee_radius_error, result.apogee_radius_allowed)
        and _met(
            by,
            NAMES_SEMI_MAJOR_AXIS,
            result.semi_major_axis_error,
            result.semi_major_axis_allowed,
        )
        and _met(by, NAMES_ECCENTRICITY, result.eccentricity_error, result.eccentricity_allowed)
        and _met(by, NAMES_C3, result.c3_error, result.c3_allowed)
        and _met(by, NAMES_TRUE_ANOMALY, result.true_anomaly_error, result.true_anomaly_allowed)
    )


@kernel
def energy_and_radius(target: Record, mu: float) -> tuple[float, float]:
    """Return the energy of a target, m2/s2, and its lowest radius, m, for comparing speeds."""
    if target.kind == TARGET_ELEMENTS:
        return 0.5 * target.c3, target.perigee_radius
    if target.kind == TARGET_KEPLERIAN:
        return -0.5 * mu / target.semi_major_axis, perigee_radius(target, mu)
    return 0.5 * target.speed * target.speed - mu / target.radius, target.radius


@kernel
def _speed_of(energy: float, mu: float, radius: float) -> float:
    """Return the speed of an energy, m2/s2, at a radius, m; 0 if the energy does not reach it."""
    square = 2.0 * (energy + mu / radius)
    return 0.0 if square < 0.0 else math.sqrt(square)


@kernel
def lacking_speed(r: Vector, v: Vector, target: Record, mu: float) -> float:
    """Return the speed deficit of a state's energy at the target's lowest radius, m/s."""
    energy, radius = energy_and_radius(target, mu)
    flown = 0.5 * dot(v, v) - mu / norm(r)
    return _speed_of(energy, mu, radius) - _speed_of(flown, mu, radius)


@kernel
def is_lowered(target: Record, mu: float, result: Record) -> bool:
    """Return whether plane, radius and angle (of an orbit plane and perigee) are the target's."""
    by = result.judged
    node = math.sin(target.inclination) * result.ascending_node_error
    if result.lacking_speed < -SAME_SPEED_M_S:
        return False
    if not _met(by, NAMES_INCLINATION, result.inclination_error, _SAME_ANGLE) or not _met(
        by, NAMES_ASCENDING_NODE, node, _SAME_ANGLE
    ):
        return False
    if target.kind == TARGET_ELEMENTS or target.kind == TARGET_KEPLERIAN:
        return abs(result.perigee_radius - perigee_radius(target, mu)) <= SAME_RADIUS_M
    return (
        abs(result.radius_error) <= SAME_RADIUS_M
        and abs(result.flight_path_angle_error) <= _SAME_ANGLE
    )


@kernel
def safe_radius(target: Record, ground: float) -> float:
    """Return the least safe perigee radius, m: the mission's, or the default."""
    return target.safe_radius if target.safe_radius > 0.0 else ground + SAFE_PERIGEE_M


@kernel
def judge_state(
    r: Vector,
    v: Vector,
    target: Record,
    mu: float,
    ground: float,
    grounded: bool,
    result: Record,
) -> None:
    """Judge the state at the end of a flight.

    Args:
        r: m.
        v: m/s.
        target: record TARGET.
        mu: m3/s2.
        ground: equatorial radius, m.
        grounded: the flight went below the ground or its floor.
        result: record with the fields JUDGED. Changed.
    """
    fill_errors(r, v, target, mu, result)
    fill_allowed(r, v, target, mu, result)
    result.lacking_speed = lacking_speed(r, v, target, mu)
    safe = safe_radius(target, ground)
    lowest = min(safe, perigee_radius(target, mu))
    if grounded:
        result.end = SUBORBITAL
    elif is_met(result):
        result.end = TARGET
    elif not result.perigee_radius >= lowest - PERIGEE_SLACK_M:
        result.end = SUBORBITAL
    elif is_lowered(target, mu, result) or result.perigee_radius < safe:
        result.end = LOWERED
    else:
        result.end = SAFE_ORBIT
