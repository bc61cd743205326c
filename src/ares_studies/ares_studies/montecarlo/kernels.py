# SPDX-License-Identifier: Apache-2.0
"""Fly many dispersed flights in one compiled loop, each judged at its end."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import HEATING_LIMIT, MissionArrays, Record
from ares_models.jit import kernel
from ares_models.kernels import judging
from ares_models.kernels.vectors import load
from ares_studies.arrays import Loop, LoopArrays
from ares_studies.kernels import loop_records, run
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
def fly_many(
    variations: NDArray[Any],
    atmospheres: NDArray[Any],
    nominal: MissionArrays,
    blank: LoopArrays,
    workspace: LoopArrays,
    results: NDArray[Any],
    failures: NDArray[Any],
    pieces: NDArray[Any],
) -> None:
    """Fly and judge one flight for every variation.

    Args:
        variations: shape (n,), dtype VARIATION.
        atmospheres: shape (n, m, 9), or (1, m, 9) for all.
        nominal: the truth before dispersion.
        blank: an unused loop at the nominal start.
        workspace: workspace of one flight after the other. Changed.
        results: shape (n,), dtype RESULT. Changed.
        failures: shape (n,), dtype FAILURE, or (1,) for all.
        pieces: dtype PIECE, of the mission.
    """
    for k in range(variations.shape[0]):
        true = MissionArrays(
            workspace.true.environment,
            atmospheres[k % atmospheres.shape[0]],
            workspace.true.arcs,
            workspace.true.jettisons,
            workspace.true.target,
        )
        loop = loop_records(
            LoopArrays(true, workspace.vehicle, workspace.believed, workspace.onboard)
        )
        workspace.vehicle.plant[0] = blank.vehicle.plant[0]
        workspace.onboard.state[0] = blank.onboard.state[0]
        workspace.onboard.steering[0] = blank.onboard.steering[0]
        workspace.onboard.memory[0] = blank.onboard.memory[0]
        vary(variations[k], nominal, true, loop.vehicle.plant)
        workspace.vehicle.plant[0].failure = failures[k % failures.shape[0]]
        begin_flight(loop.true, loop.vehicle.plant)
        measure(loop.vehicle)
        by_peg = run(loop)
        judge(loop, results[k])
        results[k].by_peg = by_peg
        follow_pieces(
            loop.vehicle.plant.events,
            loop.vehicle.plant.event_count,
            true.jettisons,
            pieces,
            variations[k].ballistic_coefficient,
            loop.true.environment,
            loop.true.atmosphere,
            results[k].falls,
        )
