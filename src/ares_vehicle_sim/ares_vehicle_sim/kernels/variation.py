# SPDX-License-Identifier: Apache-2.0
"""True vehicle of a flight, from the nominal vehicle and the flight's variation."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MissionArrays, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import add, load, store

#: Least factor on thrust, impulse or mass, so that extreme draws stay positive.
LEAST_FACTOR = 0.05


@kernel
def factor(fraction: float) -> float:
    """Return 1 + fraction, at least LEAST_FACTOR."""
    return max(LEAST_FACTOR, 1.0 + fraction)


@kernel
def vary_start(arc: Record, delay: float, scale: float) -> None:
    """Stretch and delay the start curve of a burn; this needs room for two more knots.

    Args:
        arc: record ARC. Changed.
        delay: s from the ignition command to the first knot, not negative.
        scale: factor on the times of the knots.
    """
    knots = arc.start_knots
    for i in range(knots):
        arc.start_time[i] *= scale
    if arc.tabled == 1:
        # a solid motor that burns more slowly gives less thrust for longer
        arc.thrust /= scale
        arc.mass_flow /= scale
        arc.core_thrust /= scale
        arc.core_flow /= scale
        arc.duration = arc.duration * scale + delay
    if delay > 0.0:
        if knots == 0:
            arc.start_fraction[0] = arc.start_flow[0] = 1.0
            knots = 1
        if arc.start_fraction[0] > 0.0:
            for i in range(knots, 0, -1):
                arc.start_time[i] = arc.start_time[i - 1]
                arc.start_fraction[i] = arc.start_fraction[i - 1]
                arc.start_flow[i] = arc.start_flow[i - 1]
            arc.start_fraction[0] = arc.start_flow[0] = 0.0
            knots += 1
        for i in range(knots):
            arc.start_time[i] += delay
        arc.start_knots = knots


@kernel
def vary_arcs(
    variation: Record, nominal: NDArray[Any], jettisons: NDArray[Any], arcs: NDArray[Any]
) -> None:
    """Vary thrust, impulse, propellant, masses and starts of the arcs.

    Args:
        variation: record VARIATION.
        nominal: dtype ARC.
        jettisons: dtype JETTISON, nominal.
        arcs: dtype ARC. Changed.
    """
    heavier = 0.0
    for k in range(nominal.shape[0] - 1, -1, -1):
        arcs[k] = nominal[k]
        arc = arcs[k]
        stage = arc.stage
        if k == nominal.shape[0] - 1 or nominal[k + 1].stage > stage:
            # first arc of a stage in this loop from the top: all stages below carry its excess mass
            own = arc.stack_mass
            if k < nominal.shape[0] - 1:
                own -= nominal[k + 1].stack_mass
            for j in range(jettisons.shape[0]):
                if jettisons[j].stage == stage:
                    own -= jettisons[j].mass
                    heavier += (factor(variation.jettison_mass[j]) - 1.0) * jettisons[j].mass
            heavier += variation.stage_mass[stage] * own
            heavier += (factor(variation.propellant[stage]) - 1.0) * arc.propellant
        arc.stack_mass = max(LEAST_FACTOR * arc.stack_mass, arc.stack_mass + heavier)
        arc.propellant *= factor(variation.propellant[stage])
        if arc.kind != BURN:
            continue
        thrust = factor(variation.thrust[stage])
        impulse = factor(variation.specific_impulse[stage])
        arc.thrust *= thrust
        arc.exhaust_velocity *= impulse
        arc.mass_flow *= thrust / impulse
        arc.core_thrust *= thrust
        arc.core_flow *= thrust / impulse
        ignited = k > 0 and (nominal[k - 1].kind != BURN or nominal[k - 1].stage < stage)
        if ignited or arc.start_knots > 0:
            vary_start(
                arc,
                max(0.0, variation.start_delay[stage]),
                factor(variation.start_scale[stage]),
            )


@kernel
def vary(variation: Record, nominal: MissionArrays, true: MissionArrays, plant: Record) -> None:
    """Build the true vehicle of a flight.

    Args:
        variation: record VARIATION.
        nominal: the mission with the true J2.
        true: environment, arcs and jettisons are written.
        plant: record PLANT, all zero except the nominal time, position and velocity. Changed,
            ready for `begin_flight`.
    """
    true.environment[0] = nominal.environment[0]
    true.environment[0].density_factor *= math.exp(variation.log_density)
    if variation.windy == 1:
        true.environment[0].wind = variation.wind
    vary_arcs(variation, nominal.arcs, nominal.jettisons, true.arcs)
    for j in range(nominal.jettisons.shape[0]):
        true.jettisons[j] = nominal.jettisons[j]
        jettison = true.jettisons[j]
        jettison.mass *= factor(variation.jettison_mass[j])
        if jettison.criterion == HEATING_LIMIT:
            jettison.value *= factor(variation.jettison_limit[j])
    store(plant.position, add(load(plant.position), load(variation.position)))
    store(plant.velocity, add(load(plant.velocity), load(variation.velocity)))
    plant.latency = max(0.0, variation.latency)
    plant.errors = variation.errors
