"""Many dispersed flights in one compiled loop, each judged as it ends."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import (
    HEATING_LIMIT,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_FLIGHT_PATH_ANGLE,
    NAMES_INCLINATION,
    NAMES_RADIUS,
    NAMES_SPEED,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    MissionArrays,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.orbit_errors import orbit_errors
from ares_models.kernels.states import insertion_quantities
from ares_models.kernels.targets import desired_state, named_plane, names, project_to_plane
from ares_models.kernels.vectors import Vector, axpy, cross, dot, load, norm, scale, unit
from ares_models.tolerances import (
    FLIGHT_PATH_ANGLE_DEG,
    ORIENTATION_DEG,
    RADIUS_M,
    SPEED_M_S,
)
from ares_studies.arrays import Loop, LoopArrays
from ares_studies.kernels import loop_records, run
from ares_vehicle_sim.arrays import CUTOFF, DEPLETION, IMPACT, JETTISON_DONE, TIME_LIMIT
from ares_vehicle_sim.kernels.navigation import measure
from ares_vehicle_sim.kernels.plant import begin_flight
from ares_vehicle_sim.kernels.variation import vary

FLIGHT_PATH_ANGLE = math.radians(FLIGHT_PATH_ANGLE_DEG)
ORIENTATION = math.radians(ORIENTATION_DEG)


@kernel
def half_turn(angle: float) -> float:
    """The same angle within -pi and pi."""
    return math.atan2(math.sin(angle), math.cos(angle))


@kernel
def perigee_argument(r: Vector, v: Vector, mu: float, node: float) -> float:
    """Argument of perigee, rad, counted from a node at ``node`` rad."""
    radius = norm(r)
    eccentric = axpy(dot(v, v) / mu - 1.0 / radius, r, scale(-dot(r, v) / mu, v))
    to_node = (math.cos(node), math.sin(node), 0.0)
    normal = unit(cross(r, v))
    return math.atan2(dot(eccentric, cross(normal, to_node)), dot(eccentric, to_node))


@kernel
def judge_insertion(r: Vector, v: Vector, target: Record, mu: float, result: Record) -> None:
    """Fill the errors of a record RESULT, flown minus target.

    A Keplerian target leaves the place on the orbit free: it is judged at the point of the
    target orbit that is nearest in direction. A target by elements is judged by what it names.
    """
    radius, speed, angle, inclination, node = insertion_quantities(r, v)
    judge_orbit(radius, speed, angle, target, mu, result)
    wanted_radius = target.radius
    wanted_speed = target.speed
    wanted_angle = target.flight_path_angle
    result.ascending_node_error = math.nan
    result.argument_of_perigee_error = math.nan
    if target.kind == TARGET_KEPLERIAN:
        normal = named_plane(target)
        radial = project_to_plane(r, normal)
        wanted_r, wanted_v, _ = desired_state(target, mu, radial, normal)
        wanted_radius, wanted_speed, wanted_angle, _, _ = insertion_quantities(wanted_r, wanted_v)
        result.argument_of_perigee_error = half_turn(
            perigee_argument(r, v, mu, node) - target.argument_of_perigee
        )
    if target.kind != TARGET_RADIUS_SPEED_ANGLE_INCLINATION:
        result.ascending_node_error = half_turn(node - target.ascending_node)
    result.radius_error = radius - wanted_radius
    result.speed_error = speed - wanted_speed
    result.flight_path_angle_error = angle - wanted_angle
    result.inclination_error = inclination - target.inclination
    if target.kind == TARGET_ELEMENTS:
        if names(target, NAMES_ARGUMENT_OF_PERIGEE):
            result.argument_of_perigee_error = half_turn(
                perigee_argument(r, v, mu, node) - target.argument_of_perigee
            )
        forget_free(target, result)


@kernel
def forget_free(target: Record, result: Record) -> None:
    """No errors for what a target by elements leaves free."""
    if not names(target, NAMES_RADIUS):
        result.radius_error = math.nan
    if not names(target, NAMES_SPEED):
        result.speed_error = math.nan
    if not names(target, NAMES_FLIGHT_PATH_ANGLE):
        result.flight_path_angle_error = math.nan
    if not names(target, NAMES_INCLINATION):
        result.inclination_error = math.nan
    if not names(target, NAMES_ASCENDING_NODE):
        result.ascending_node_error = math.nan


@kernel
def judge_orbit(
    radius: float, speed: float, angle: float, target: Record, mu: float, result: Record
) -> None:
    """Errors of the size, shape and place that a target by elements names; nan for others."""
    errors, allowed = orbit_errors(target, mu, radius, speed, angle)
    result.perigee_radius_error = errors[0]
    result.apogee_radius_error = errors[1]
    result.semi_major_axis_error = errors[2]
    result.eccentricity_error = errors[3]
    result.c3_error = errors[4]
    result.true_anomaly_error = errors[5]
    result.perigee_radius_allowed = allowed[0]
    result.apogee_radius_allowed = allowed[1]
    result.semi_major_axis_allowed = allowed[2]
    result.eccentricity_allowed = allowed[3]
    result.c3_allowed = allowed[4]
    result.true_anomaly_allowed = allowed[5]


@kernel
def within(error: float, allowed: float) -> bool:
    """Whether an error is none, or small enough."""
    return math.isnan(error) or abs(error) <= allowed


@kernel
def on_orbit(result: Record) -> bool:
    """As :func:`on_target`, of a target by elements."""
    return (
        math.isfinite(result.c3_allowed)
        and within(result.radius_error, RADIUS_M)
        and within(result.speed_error, SPEED_M_S)
        and within(result.flight_path_angle_error, FLIGHT_PATH_ANGLE)
        and within(result.inclination_error, ORIENTATION)
        and within(result.ascending_node_error, ORIENTATION)
        and within(result.argument_of_perigee_error, ORIENTATION)
        and within(result.perigee_radius_error, result.perigee_radius_allowed)
        and within(result.apogee_radius_error, result.apogee_radius_allowed)
        and within(result.semi_major_axis_error, result.semi_major_axis_allowed)
        and within(result.eccentricity_error, result.eccentricity_allowed)
        and within(result.c3_error, result.c3_allowed)
        and within(result.true_anomaly_error, result.true_anomaly_allowed)
    )


@kernel
def on_target(target: Record, result: Record) -> bool:
    """Whether the errors are within the terminal accuracy; what is free is not asked for."""
    if target.kind == TARGET_ELEMENTS:
        return on_orbit(result)
    return (
        abs(result.radius_error) <= RADIUS_M
        and abs(result.speed_error) <= SPEED_M_S
        and abs(result.flight_path_angle_error) <= FLIGHT_PATH_ANGLE
        and abs(result.inclination_error) <= ORIENTATION
        and not abs(result.ascending_node_error) > ORIENTATION
        and not abs(result.argument_of_perigee_error) > ORIENTATION
    )


@kernel
def judge(loop: Loop, result: Record) -> None:
    """Judge a flight that is over; fills a record RESULT."""
    plant = loop.vehicle.plant
    jettisons = loop.true.jettisons
    result.end_time = plant.time
    result.mass = plant.mass
    result.propellant_used = plant.propellant_used
    result.peak_heating_after = math.nan
    result.cutoff_time = math.nan
    result.jettison_time = math.nan
    result.jettison_heating = math.nan
    result.jettison_limit = math.nan
    result.ended = CUTOFF if plant.inserted == 1 else DEPLETION
    result.converged = 0 if math.isnan(loop.onboard.steering.cutoff_time) else 1
    result.iterations = loop.onboard.state.total_iterations
    result.struck = plant.failure.struck
    result.found = loop.onboard.state.found.first_kind
    result.found_time = loop.onboard.state.found.first_time
    result.navigation_refused = loop.onboard.state.navigation.refused
    result.violations = loop.onboard.state.monitors.violations
    result.on_board = (1 << jettisons.shape[0]) - 1
    kept = True
    for i in range(plant.event_count):
        event = plant.events[i]
        if event.type == CUTOFF:
            result.cutoff_time = event.time
        elif event.type == IMPACT or event.type == TIME_LIMIT:
            result.ended = event.type
        elif event.type == JETTISON_DONE:
            part = jettisons[event.index]
            if math.isnan(result.cutoff_time):
                result.on_board &= ~(1 << event.index)
            if part.criterion == HEATING_LIMIT:
                kept = kept and event.heating_rate <= part.value
                if math.isnan(result.jettison_time):
                    result.jettison_time = event.time
                    result.jettison_heating = event.heating_rate
                    result.jettison_limit = part.value
                    result.peak_heating_after = plant.peak_heating_after_jettison
    judge_insertion(
        load(plant.position),
        load(plant.velocity),
        loop.believed.target,
        loop.true.environment.mu,
        result,
    )
    accurate = plant.inserted == 1 and on_target(loop.believed.target, result)
    result.terminal_accuracy = 1 if accurate else 0
    result.fairing_off = 1 if result.on_board == 0 else 0
    result.heating_kept = 1 if kept else 0


@kernel
def fly_many(
    variations: NDArray[Any],
    atmospheres: NDArray[Any],
    nominal: MissionArrays,
    blank: LoopArrays,
    room: LoopArrays,
    results: NDArray[Any],
    failures: NDArray[Any],
) -> None:
    """Fly and judge one flight for every variation.

    Args:
        variations: shape (n,), dtype VARIATION.
        atmospheres: shape (n, m, 5), or (1, m, 5) for all.
        nominal: the truth before it varies.
        blank: a loop before its flight, at the nominal start.
        room: a loop for one flight after the other. Changed.
        results: shape (n,), dtype RESULT. Changed.
        failures: shape (n,), dtype FAILURE, or (1,) for all.
    """
    for k in range(variations.shape[0]):
        true = MissionArrays(
            room.true.environment,
            atmospheres[k % atmospheres.shape[0]],
            room.true.arcs,
            room.true.jettisons,
            room.true.target,
        )
        loop = loop_records(LoopArrays(true, room.vehicle, room.believed, room.onboard))
        room.vehicle.plant[0] = blank.vehicle.plant[0]
        room.onboard.state[0] = blank.onboard.state[0]
        room.onboard.steering[0] = blank.onboard.steering[0]
        vary(variations[k], nominal, true, loop.vehicle.plant)
        room.vehicle.plant[0].failure = failures[k % failures.shape[0]]
        begin_flight(loop.true, loop.vehicle.plant)
        measure(loop.vehicle)
        run(loop)
        judge(loop, results[k])
