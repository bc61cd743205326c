# SPDX-License-Identifier: Apache-2.0
"""Fly the plant: staging, jettisons and cut-off at their exact times, steps in between."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, LONGEST_FLIGHT, MAX_ARCS, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import (
    air_at,
    body_force,
    is_in_air,
    local_vertical,
    pressure_loss,
)
from ares_models.kernels.environment import air_velocity, altitude, heating_rate
from ares_models.kernels.sequence import (
    SAME_BURNOUT,
    SAME_TIME,
    aboard,
    arc_after_burnout,
    drop_time,
    end_thrust,
    enter_arc,
    next_knot,
    plans_arcs,
    tail_end_time,
)
from ares_models.kernels.states import insertion_quantities
from ares_models.kernels.throttle import throttle_regime, time_to_burn
from ares_models.kernels.thrust_curve import flow_area, start_length
from ares_models.kernels.vectors import angle_between, axpy, dot, load, norm, store, unit
from ares_vehicle_sim.arrays import (
    ARC_ENDED,
    CUTOFF,
    DEPLETION,
    FAILED,
    FLIGHT_COMPLETE,
    FLIGHT_STARTED,
    IGNITION,
    IMPACT,
    IN_VAIN,
    JETTISON_DONE,
    JETTISON_STUCK,
    MAX_EVENTS,
    OVER_LIMIT,
    STAGING,
    TIME_LIMIT,
    Vehicle,
)
from ares_vehicle_sim.kernels.commands import put_in_force
from ares_vehicle_sim.kernels.failures import (
    fails_to_ignite,
    failure_due,
    is_stuck,
    over_limit_due,
    strike,
)
from ares_vehicle_sim.kernels.motion import (
    SLOW_AIR,
    integrate,
    meets_air,
    note_loads,
    throttled,
    thrust_now,
)

#: Longest step with an attitude rate limit, s.
SLEW_STEP = 0.02
#: Largest number of integration steps between two navigation states.
MOST_STEPS = 1e7
#: Time to the next event, s, above which a coast has a navigation state only every 10 s, or 1 s.
VERY_LONG_COAST, LONG_COAST = 10_000.0, 100.0
#: Steps over a gust, and acceleration by which a climb may change before it, m/s2.
GUST_STEPS = 16.0
MOST_CLIMB_CHANGE = 50.0
#: Largest absolute time for a clock in nanoseconds, s.
LATEST_CLOCK = 1e9


@kernel
def throttle_change(plant: Record, arcs: NDArray[Any], limit: float) -> float:
    """Return the end of the present throttle regime, s, at most ``limit``."""
    arc = arcs[plant.arc]
    if not throttled(plant, arc, plant.time):
        return limit
    _, span = throttle_regime(arc, (arc.exhaust_velocity, arc.mass_flow), plant.mass)
    return min(limit, plant.time + span)


@kernel
def sense(mission: MissionRecords, plant: Record) -> None:
    """Update altitude and heating from the present position and velocity."""
    environment = mission.environment
    r = load(plant.position)
    plant.altitude = altitude(r, environment)
    plant.heating_rate = heating_rate(r, load(plant.velocity), environment, mission.atmosphere)
    # 0 before the jettison
    if plant.heating_rate > plant.peak_heating_after_jettison > 0.0:
        plant.peak_heating_after_jettison = plant.heating_rate


@kernel
def gust_step(mission: MissionRecords, plant: Record, span: float) -> float:
    """Return the longest step, s, that resolves gust and turbulence met within ``span`` s."""
    wind = mission.environment.wind
    if wind.gust_length == 0.0 and wind.stirred_step == 0.0:
        return math.inf
    climb = abs(dot(load(plant.velocity), unit(load(plant.position))))
    reach = span * (climb + span * MOST_CLIMB_CHANGE)
    layer = math.inf
    if wind.stirred_step > 0.0 and plant.altitude - reach < wind.stirred_below:
        layer = wind.stirred_step
    away = abs(plant.altitude - wind.gust_altitude) - 0.5 * wind.gust_length
    if wind.gust_length > 0.0 and away < reach:
        layer = min(layer, wind.gust_length / GUST_STEPS)
    return float(layer / max(climb, 1.0))


@kernel
def log_event(plant: Record, kind: int, index: int) -> None:
    """Append an event with the present state."""
    if plant.event_count >= MAX_EVENTS:
        return
    event = plant.events[plant.event_count]
    plant.event_count += 1
    event.type = kind
    event.index = index
    event.time = plant.time
    event.mass = plant.mass
    store(event.position, load(plant.position))
    store(event.velocity, load(plant.velocity))
    event.heating_rate = plant.heating_rate


@kernel
def end_by_limit(plant: Record) -> None:
    """End a flight at its time limit."""
    if plant.complete == 0:
        plant.complete = 1
        log_event(plant, TIME_LIMIT, plant.arc)


@kernel
def begin_arc(plant: Record, k: int, arcs: NDArray[Any], jettisons: NDArray[Any]) -> None:
    """Begin arc ``k`` and log its events."""
    arc = arcs[k]
    enter_arc(plant, k, arcs, jettisons)
    if arc.begins_stage == 1 and k > 0:
        log_event(plant, STAGING, arc.stage)
    if arc.kind == BURN and arc.continues == 0 and not fails_to_ignite(plant, k):
        log_event(plant, IGNITION, k)


@kernel
def begin_next(plant: Record, following: int, arcs: NDArray[Any], jettisons: NDArray[Any]) -> bool:
    """Begin the arc after a stage's burn; return False if there is none and the flight ends."""
    if following >= arcs.shape[0]:
        plant.complete = 1
        log_event(plant, FLIGHT_COMPLETE, plant.arc)
        return False
    begin_arc(plant, following, arcs, jettisons)
    return True


@kernel
def burnout_time(plant: Record, arcs: NDArray[Any]) -> float:
    """Return the time of depletion in the present burn, s; inf in a coast."""
    arc = arcs[plant.arc]
    if arc.kind != BURN or plant.inserted == 1:
        return math.inf
    left = max(0.0, arc.propellant - plant.propellant_used) / arc.mass_flow
    into = plant.time - plant.arc_start_time
    if math.isfinite(arc.max_acceleration):
        # a throttled burn has no start curve except a delay without thrust
        engine = (arc.exhaust_velocity, arc.mass_flow)
        left = time_to_burn(arc, engine, plant.mass, left * arc.mass_flow)
        return plant.time + max(0.0, start_length(arc) - into) + left
    if (
        arc.tabled == 1
        and left >= flow_area(arc, arc.duration) - flow_area(arc, into) - SAME_BURNOUT
    ):
        # the burn ends with its table
        return math.inf
    if into >= start_length(arc):
        return plant.time + left
    wanted = left + flow_area(arc, into)
    low = into
    high = into + left + start_length(arc)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if flow_area(arc, middle) < wanted:
            low = middle
        else:
            high = middle
    return plant.arc_start_time + high


@kernel
def free_end(plant: Record, arc: Record, wanted: float) -> float:
    """Clip the wanted end of the present free arc to its bounds, s; nan: the latest end."""
    latest = plant.arc_start_time + arc.longest
    if not wanted < latest:
        return latest
    return max(wanted, plant.arc_start_time + arc.shortest)


@kernel
def arc_end(plant: Record, arcs: NDArray[Any]) -> float:
    """Return the end of the present arc by time, s; inf for the last arc."""
    arc = arcs[plant.arc]
    if plant.arc + 1 == arcs.shape[0]:
        return math.inf
    if math.isfinite(arc.duration):
        return plant.arc_start_time + arc.duration
    return free_end(plant, arc, plant.command.arc_end_times[plant.arc])


@kernel
def cutoff_due(plant: Record, arcs: NDArray[Any]) -> float:
    """Return the time of the cut-off that ends the flight, s; inf or nan: none.

    The last arc is cut off by command, or by the clock if its length is fixed. A command also cuts
    off an earlier burn if no arc before the last is free.
    """
    arc = arcs[plant.arc]
    if arc.kind != BURN:
        return math.inf
    if plant.arc + 1 < arcs.shape[0]:
        return math.inf if plans_arcs(arcs) else plant.command.cutoff_time
    if math.isfinite(arc.duration):
        return plant.arc_start_time + arc.duration
    return free_end(plant, arc, plant.command.cutoff_time)


@kernel
def wanted_jettison(plant: Record, jettisons: NDArray[Any], j: int) -> float:
    """Return the due time of jettison ``j``, stuck or not, s; inf if done or not determined."""
    if not aboard(plant.jettisoned, j):
        return math.inf
    commanded = plant.jettison_time[j]
    return drop_time(
        jettisons[j],
        plant.ignited_stage,
        plant.ignition_time,
        plant.time,
        commanded if math.isfinite(commanded) else math.inf,
    )


@kernel
def jettison_due(plant: Record, jettisons: NDArray[Any], j: int) -> float:
    """Return the time of jettison ``j``, s; inf if done, stuck or not determined."""
    return math.inf if is_stuck(plant, j) else wanted_jettison(plant, jettisons, j)


@kernel
def next_failure(plant: Record, jettisons: NDArray[Any]) -> float:
    """Return the time of the failure, s; inf: never."""
    stuck_due = math.inf
    if plant.failure.jettison >= 0:
        stuck_due = wanted_jettison(plant, jettisons, plant.failure.jettison)
    return failure_due(plant, stuck_due)


@kernel
def fail(plant: Record, arcs: NDArray[Any]) -> bool:
    """Carry out the failure that is due and log it; return whether it ends the present burn."""
    ends = strike(plant, arcs)
    if is_stuck(plant, plant.failure.jettison):
        log_event(plant, JETTISON_STUCK, plant.failure.jettison)
    elif plant.failure.struck != IN_VAIN:
        log_event(plant, FAILED, plant.arc)
    return ends


@kernel
def process_due_events(plant: Record, arcs: NDArray[Any], jettisons: NDArray[Any]) -> None:
    """Carry out all events that are due now."""
    now = plant.time + SAME_TIME
    if plant.pending_time <= now:
        plant.pending_time = math.inf
        put_in_force(plant, plant.pending)
    changed = True
    while changed and plant.complete == 0:
        changed = False
        for j in range(jettisons.shape[0]):
            if jettison_due(plant, jettisons, j) <= now:
                plant.jettisoned |= 1 << j
                plant.mass -= jettisons[j].mass
                log_event(plant, JETTISON_DONE, j)
                if jettisons[j].criterion == HEATING_LIMIT:
                    plant.peak_heating_after_jettison = plant.heating_rate
        if plant.tail_arc >= 0 and tail_end_time(plant, arcs) <= now:
            plant.tail_arc = -1
            changed = True
        if plant.inserted == 1:
            if plant.tail_arc < 0:
                plant.complete = 1
                log_event(plant, FLIGHT_COMPLETE, plant.arc)
        elif cutoff_due(plant, arcs) <= now:
            plant.inserted = 1
            end_thrust(plant, arcs)
            log_event(plant, CUTOFF, plant.arc)
            changed = True
        elif arc_end(plant, arcs) <= now:
            end_thrust(plant, arcs)
            log_event(plant, ARC_ENDED, plant.arc)
            begin_arc(plant, plant.arc + 1, arcs, jettisons)
            changed = True
        elif burnout_time(plant, arcs) <= now:
            log_event(plant, DEPLETION, arcs[plant.arc].stage)
            changed = begin_next(plant, arc_after_burnout(plant.arc, arcs), arcs, jettisons)
        elif over_limit_due(plant, arcs) <= now:
            plant.failure.over_mass = 0.0
            log_event(plant, OVER_LIMIT, plant.arc)
            changed = True
        elif next_failure(plant, jettisons) <= now:
            changed = True
            if fail(plant, arcs):
                log_event(plant, ARC_ENDED, plant.arc)
                changed = begin_next(plant, arc_after_burnout(plant.arc, arcs), arcs, jettisons)


@kernel
def next_event(plant: Record, arcs: NDArray[Any], jettisons: NDArray[Any]) -> float:
    """Return the time of the next event of :func:`process_due_events`, s."""
    at = plant.pending_time
    for j in range(jettisons.shape[0]):
        at = min(at, jettison_due(plant, jettisons, j))
    if plant.tail_arc >= 0:
        at = min(at, tail_end_time(plant, arcs))
    if plant.inserted == 1:
        return at
    at = min(at, next_failure(plant, jettisons))
    at = min(at, over_limit_due(plant, arcs))
    end = arc_end(plant, arcs)
    cutoff = cutoff_due(plant, arcs)
    at = min(at, end)
    if cutoff < at:
        at = cutoff
    if math.isfinite(arcs[plant.arc].duration) and plant.arc + 1 == arcs.shape[0]:
        end = cutoff
    burnout = burnout_time(plant, arcs)
    # if cut-off and depletion coincide, treat as timed cut-off
    if burnout < at and burnout < end - SAME_BURNOUT:
        at = burnout
    return at


@kernel
def next_tick(mission: MissionRecords, vehicle: Vehicle, tick: int) -> int:
    """Return the number of the navigation state after state ``tick``: several on in long coasts.

    Numbers count navigation periods, so that time stays proportional to them.
    """
    plant = vehicle.plant
    arcs = mission.arcs
    k = plant.arc
    unplanned = math.isinf(arcs[k].duration) and math.isnan(plant.command.arc_end_times[k])
    if plant.complete == 1 or arcs[k].kind == BURN or unplanned:
        return tick + 1
    left = next_event(plant, arcs, mission.jettisons) - plant.time
    apart = 0.0
    if left > LONG_COAST:
        apart = 10.0 if left > VERY_LONG_COAST else 1.0
    return tick + max(1, int(apart / vehicle.options.navigation_period + 0.5))


@kernel
def begin_flight(mission: MissionRecords, plant: Record) -> None:
    """Start the sequence from the state in ``plant`` (time, position, velocity set).

    The mass is that of the first arc's stack unless it is set.
    """
    plant.ignited_stage = -1
    plant.tail_arc = -1
    plant.arc = 0
    plant.arc_start_time = plant.time
    if not plant.mass > 0.0:
        plant.mass = mission.arcs[0].stack_mass
    for j in range(plant.jettison_time.shape[0]):
        plant.jettison_time[j] = math.nan
    u = unit(load(plant.velocity))
    if mission.arcs[0].vertical == 1:
        u = local_vertical(load(plant.position), mission.environment)
    store(plant.direction, u)
    store(plant.command.direction, u)
    plant.command.reference_time = plant.time
    plant.command.cutoff_time = math.nan
    plant.pending.cutoff_time = math.nan
    plant.command.jettison = -1
    plant.pending_time = math.inf
    for k in range(MAX_ARCS):
        plant.command.arc_end_times[k] = math.nan
        plant.pending.arc_end_times[k] = math.nan
    sense(mission, plant)
    log_event(plant, FLIGHT_STARTED, 0)
    begin_arc(plant, 0, mission.arcs, mission.jettisons)
    if not abs(plant.time) <= LATEST_CLOCK:
        end_by_limit(plant)


@kernel
def integrate_to(mission: MissionRecords, vehicle: Vehicle, end: float, largest: float) -> None:
    """Integrate to ``end``, without events in between, in equal steps of at most ``largest`` s."""
    plant = vehicle.plant
    start = plant.time
    steps = 1
    if end - start > largest:
        steps = int(math.ceil((end - start) / largest - 1e-9))
    for i in range(1, steps + 1):
        at = end if i == steps else start + (end - start) * i / steps
        integrate(mission, vehicle, at)
        if is_in_air(mission.arcs[plant.arc]) and meets_air(mission, plant):
            note_loads(mission, plant)
        if i == steps or plant.peak_heating_after_jettison > 0.0:
            sense(mission, plant)


@kernel
def flight_step(mission: MissionRecords, vehicle: Vehicle, until: float) -> None:
    """Advance the vehicle to ``until`` or to the end of the flight.

    A flight that is not over after LONGEST_FLIGHT, or that would take more than MOST_STEPS
    steps to ``until``, ends with the event TIME_LIMIT.

    Args:
        mission: the true mission. A failure changes its arcs.
        vehicle: the flight. Its plant is changed; events are appended to ``plant.events``.
        until: mission elapsed time, s.
    """
    plant = vehicle.plant
    options = vehicle.options
    largest = options.max_step
    if math.isfinite(options.attitude_rate_limit):
        largest = min(largest, SLEW_STEP)
    largest = min(largest, gust_step(mission, plant, until - plant.time))
    early = plant.time - plant.events[0].time < LONGEST_FLIGHT
    if not (early and until - plant.time < MOST_STEPS * largest):
        end_by_limit(plant)
    due = next_event(plant, mission.arcs, mission.jettisons)
    rounds = 0
    while plant.complete == 0:
        if due <= plant.time + SAME_TIME:
            rounds += 1
            if rounds > MAX_EVENTS:
                end_by_limit(plant)
            process_due_events(plant, mission.arcs, mission.jettisons)
            due = next_event(plant, mission.arcs, mission.jettisons)
            continue
        if not plant.time < until:
            break
        end = next_knot(plant, mission.arcs, min(until, due))
        end = throttle_change(plant, mission.arcs, end)
        integrate_to(mission, vehicle, end, largest)
    if plant.complete == 0 and plant.altitude < 0.0:
        plant.complete = 1
        log_event(plant, IMPACT, plant.arc)


@kernel
def describe(mission: MissionRecords, vehicle: Vehicle) -> None:
    """Write the true state and derived quantities into ``vehicle.truth``."""
    environment = mission.environment
    plant = vehicle.plant
    truth = vehicle.truth
    r = load(plant.position)
    v = load(plant.velocity)
    store(truth.position, r)
    store(truth.velocity, v)
    truth.mass = plant.mass
    u = load(plant.direction)
    store(truth.thrust_direction, u)
    arc = mission.arcs[plant.arc]
    thrust, truth.mass_flow = thrust_now(plant, mission.arcs, plant.time)
    if thrust > 0.0:
        thrust = max(0.0, thrust - pressure_loss(arc, r, environment, mission.atmosphere))
    truth.thrust = thrust
    force = axpy(thrust, u, body_force(arc, r, v, u, environment, mission.atmosphere))
    along = dot(force, u)
    truth.axial_acceleration = along / plant.mass
    truth.lateral_acceleration = norm(axpy(-along, u, force)) / plant.mass
    relative = air_velocity(r, v, environment)
    speed = norm(relative)
    truth.altitude = altitude(r, environment)
    air = air_at(truth.altitude, environment, mission.atmosphere)
    truth.density = air.density
    truth.dynamic_pressure = 0.5 * air.density * speed * speed
    truth.mach = speed / air.sound
    truth.angle_of_attack = 0.0
    if speed > SLOW_AIR and truth.dynamic_pressure > 0.0:
        truth.angle_of_attack = angle_between(u, unit(relative))
    truth.relative_speed = speed
    _, _, truth.flight_path_angle, truth.inclination, truth.ascending_node = insertion_quantities(
        r, v
    )
    truth.heating_rate = heating_rate(r, v, environment, mission.atmosphere)
    truth.arc = plant.arc
    truth.jettisoned = plant.jettisoned
