# SPDX-License-Identifier: Apache-2.0
"""Begin the dispersed flights of a campaign, and judge each at its end."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import HEATING_LIMIT, MissionArrays, Record
from ares_models.jit import kernel
from ares_models.kernels import judging
from ares_models.kernels.records import mission_records
from ares_models.kernels.vectors import load
from ares_studies.arrays import Loop, LoopArrays
from ares_studies.kernels import loop_records
from ares_vehicle_sim.arrays import CUTOFF, DEPLETION, IMPACT, JETTISON_DONE, TIME_LIMIT
from ares_vehicle_sim.kernels.navigation import measure
from ares_vehicle_sim.kernels.plant import begin_flight
from ares_vehicle_sim.kernels.separations import follow_pieces
from ares_vehicle_sim.kernels.variation import vary


@kernel
def known(value: float) -> float:
    """Return a value, nan for 0."""
    return value if value > 0.0 else math.nan


@kernel
def judge(loop: Loop, result: Record) -> None:
    """Judge a completed flight; fill a record RESULT."""
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
    result.most_dynamic_pressure = known(plant.most_dynamic_pressure)
    result.most_q_alpha = known(plant.most_q_alpha)
    result.dynamic_pressure_share = known(plant.dynamic_pressure_share)
    result.q_alpha_share = known(plant.q_alpha_share)
    result.ended = CUTOFF if plant.inserted == 1 else DEPLETION
    answered = loop.onboard.state.programme.active == 1
    result.converged = 0 if math.isnan(loop.onboard.steering.cutoff_time) and not answered else 1
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
    judging.judge_state(
        load(plant.position),
        load(plant.velocity),
        loop.believed.target,
        loop.true.environment.mu,
        loop.true.environment.equatorial_radius,
        result.ended == IMPACT,
        result,
    )
    accurate = plant.inserted == 1 and result.end == judging.TARGET
    result.terminal_accuracy = 1 if accurate else 0
    result.fairing_off = 1 if result.on_board == 0 else 0
    result.heating_kept = 1 if kept else 0


@kernel
def begin(
    variations: NDArray[Any],
    failures: NDArray[Any],
    nominal: MissionArrays,
    blank: LoopArrays,
    loop: LoopArrays,
) -> None:
    """Make a dispersed flight ready for its first cycle of guidance.

    Args:
        variations: shape (1,), dtype VARIATION.
        failures: shape (1,), dtype FAILURE.
        nominal: the truth before dispersion.
        blank: an unused loop at the nominal start.
        loop: the flight, with its atmosphere. Changed.
    """
    loop.vehicle.plant[0] = blank.vehicle.plant[0]
    loop.onboard.state[0] = blank.onboard.state[0]
    loop.onboard.steering[0] = blank.onboard.steering[0]
    loop.onboard.memory[0] = blank.onboard.memory[0]
    vehicle = loop_records(loop).vehicle
    vary(variations[0], nominal, loop.true, vehicle.plant)
    loop.vehicle.plant[0].failure = failures[0]
    begin_flight(mission_records(loop.true), vehicle.plant)
    measure(vehicle)


@kernel
def assess(
    loop: LoopArrays, variations: NDArray[Any], pieces: NDArray[Any], results: NDArray[Any]
) -> None:
    """Judge a completed flight and follow what falls.

    Args:
        loop: the flight.
        variations: shape (1,), dtype VARIATION.
        pieces: dtype PIECE, of the mission.
        results: shape (1,), dtype RESULT. Changed.
    """
    records = loop_records(loop)
    judge(records, results[0])
    plant = records.vehicle.plant
    follow_pieces(
        plant.events,
        plant.event_count,
        loop.true.jettisons,
        pieces,
        variations[0].ballistic_coefficient,
        records.true.environment,
        records.true.atmosphere,
        results[0].falls,
    )
