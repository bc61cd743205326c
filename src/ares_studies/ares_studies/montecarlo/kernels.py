"""Many dispersed flights in one compiled loop, each judged as it ends."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.kernels.targets import desired_state, project_to_plane
from ares_models.arrays import (
    HEATING_LIMIT,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.states import insertion_quantities
from ares_models.kernels.vectors import Vector, axpy, cross, dot, load, norm, scale, unit
from ares_studies.kernels import fly
from ares_vehicle_sim.arrays import CUTOFF, DEPLETION, IMPACT, JETTISON_DONE, TIME_LIMIT
from ares_vehicle_sim.kernels.plant import begin_flight
from ares_vehicle_sim.kernels.variation import vary

#: Terminal accuracy: an insertion within these of its target, angles in rad.
RADIUS_M = 100.0
SPEED_M_S = 1.0
ANGLE = math.radians(0.01)


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
    target orbit that is nearest in direction.
    """
    radius, speed, angle, inclination, node = insertion_quantities(r, v)
    wanted_radius = target.radius
    wanted_speed = target.speed
    wanted_angle = target.flight_path_angle
    result.ascending_node_error = math.nan
    result.argument_of_perigee_error = math.nan
    if target.kind == TARGET_KEPLERIAN:
        si = math.sin(target.inclination)
        normal = (
            si * math.sin(target.ascending_node),
            -si * math.cos(target.ascending_node),
            math.cos(target.inclination),
        )
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


@kernel
def on_target(result: Record) -> bool:
    """Whether the errors are within the terminal accuracy; what is free is not asked for."""
    return (
        abs(result.radius_error) <= RADIUS_M
        and abs(result.speed_error) <= SPEED_M_S
        and abs(result.flight_path_angle_error) <= ANGLE
        and abs(result.inclination_error) <= ANGLE
        and not abs(result.ascending_node_error) > ANGLE
        and not abs(result.argument_of_perigee_error) > ANGLE
    )


@kernel
def judge(
    plant: Record,
    environment: Record,
    jettisons: NDArray[Any],
    target: Record,
    state: Record,
    steering: Record,
    result: Record,
) -> None:
    """Judge a flight that is over.

    Args:
        plant: record PLANT at the end.
        environment: record ENVIRONMENT, the true one.
        jettisons: dtype JETTISON, the true ones.
        target: record TARGET.
        state: record GUIDANCE_STATE at the end.
        steering: record STEERING, the last command.
        result: record RESULT. Changed.
    """
    result.end_time = plant.time
    result.mass = plant.mass
    result.propellant_used = plant.propellant_used
    result.peak_heating_after = math.nan
    result.cutoff_time = math.nan
    result.jettison_time = math.nan
    result.jettison_heating = math.nan
    result.jettison_limit = math.nan
    result.ended = CUTOFF if plant.inserted == 1 else DEPLETION
    result.converged = 0 if math.isnan(steering.cutoff_time) else 1
    result.iterations = state.total_iterations
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
    judge_insertion(load(plant.position), load(plant.velocity), target, environment.mu, result)
    result.terminal_accuracy = 1 if plant.inserted == 1 and on_target(result) else 0
    result.fairing_off = 1 if result.on_board == 0 else 0
    result.heating_kept = 1 if kept else 0


@kernel
def fly_many(
    variations: NDArray[Any],
    atmospheres: NDArray[Any],
    position: Vector,
    velocity: Vector,
    nominal_environment: NDArray[Any],
    nominal_arcs: NDArray[Any],
    nominal_jettisons: NDArray[Any],
    options: Record,
    navigation_period: float,
    believed_environment: Record,
    believed_atmosphere: NDArray[Any],
    believed_arcs: NDArray[Any],
    believed_jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    blank_plant: NDArray[Any],
    blank_state: NDArray[Any],
    blank_steering: NDArray[Any],
    plant: NDArray[Any],
    environment: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    state: NDArray[Any],
    saved: NDArray[Any],
    nav: NDArray[Any],
    steering: NDArray[Any],
    results: NDArray[Any],
) -> None:
    """Fly and judge one flight for every variation.

    Args:
        variations: shape (n,), dtype VARIATION.
        atmospheres: shape (n, m, 5), or (1, m, 5) for all.
        position: nominal start, m.
        velocity: nominal start, m/s.
        nominal_environment: of the truth, before it varies; so the next two.
        nominal_arcs: dtype ARC.
        nominal_jettisons: dtype JETTISON.
        options: record OPTIONS.
        navigation_period: s.
        believed_environment: what guidance believes; so the next three.
        believed_atmosphere: table.
        believed_arcs: dtype ARC.
        believed_jettisons: dtype JETTISON.
        target: record TARGET.
        settings: record GUIDANCE_SETTINGS.
        blank_plant: shape (1,), at the begin of a flight, all else zero; so the next two.
        blank_state: shape (1,), dtype GUIDANCE_STATE.
        blank_steering: shape (1,), dtype STEERING.
        plant: shape (1,), room for a flight; so the next seven. Changed.
        environment: dtype ENVIRONMENT.
        arcs: dtype ARC, as many as there are.
        jettisons: dtype JETTISON, as many as there are.
        state: dtype GUIDANCE_STATE.
        saved: the same.
        nav: dtype NAVIGATION.
        steering: dtype STEERING.
        results: shape (n,), dtype RESULT. Changed.
    """
    for k in range(variations.shape[0]):
        plant[0] = blank_plant[0]
        state[0] = blank_state[0]
        saved[0] = blank_state[0]
        steering[0] = blank_steering[0]
        atmosphere = atmospheres[k % atmospheres.shape[0]]
        vary(
            variations[k],
            position,
            velocity,
            nominal_environment,
            nominal_arcs,
            nominal_jettisons,
            environment,
            arcs,
            jettisons,
            plant[0],
        )
        begin_flight(plant[0], environment[0], atmosphere, arcs, jettisons)
        fly(
            plant[0],
            environment[0],
            atmosphere,
            arcs,
            jettisons,
            options,
            believed_environment,
            believed_atmosphere,
            believed_arcs,
            believed_jettisons,
            target,
            settings,
            state[0],
            saved[0],
            nav[0],
            steering[0],
            navigation_period,
        )
        judge(plant[0], environment[0], jettisons, target, state[0], steering[0], results[k])
