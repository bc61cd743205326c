# SPDX-License-Identifier: Apache-2.0
"""Failures of the plant and the vehicle's own reaction (see `ares_models.failures`).

A failure changes the arcs of the flight at its time; the plant flies the remaining vehicle from
then on. A burn weakened by ENGINE_OUT lasts until its planned propellant is burnt.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, Record
from ares_models.jit import kernel
from ares_models.kernels.throttle import throttle
from ares_models.kernels.weakened import shut_down_core, weaken_stage
from ares_vehicle_sim.arrays import (
    EARLY_SHUTDOWN,
    ENGINE_OUT,
    FAILED_IGNITION,
    IN_VAIN,
    STRUCK,
    STUCK_JETTISON,
    STUCK_THROTTLE,
    THRUST_LOW,
)

#: Relative excess over the acceleration limit that is logged as an event.
OVER = 0.01


@kernel
def failure_due(plant: Record, stuck_due: float) -> float:
    """Return the time of the failure, s; inf if it is past, never comes, or there is none.

    Args:
        plant: record PLANT.
        stuck_due: due time of the stuck jettison, s; inf: not determined.
    """
    failure = plant.failure
    if failure.struck != 0 or failure.kind == 0:
        return math.inf
    if failure.kind == STUCK_JETTISON:
        return stuck_due
    if failure.kind == FAILED_IGNITION:
        return plant.arc_start_time if plant.arc == failure.arc else math.inf
    return failure.time


@kernel
def fails_to_ignite(plant: Record, k: int) -> bool:
    """Return whether arc ``k`` is the burn that fails to ignite."""
    return plant.failure.kind == FAILED_IGNITION and plant.failure.arc == k


@kernel
def is_stuck(plant: Record, j: int) -> bool:
    """Return whether jettison ``j`` is stuck."""
    return plant.failure.kind == STUCK_JETTISON and plant.failure.jettison == j


@kernel
def fix_throttle(plant: Record, arcs: NDArray[Any]) -> None:
    """Fix the throttle of the present burn at its present setting.

    Args:
        plant: record PLANT.
        arcs: dtype ARC. Changed.
    """
    arc = arcs[plant.arc]
    failure = plant.failure
    fraction = throttle(arc, plant.mass)
    failure.arc = plant.arc
    failure.over_mass = fraction * arc.thrust / ((1.0 + OVER) * arc.max_acceleration)
    arc.thrust *= fraction
    arc.mass_flow *= fraction
    arc.max_acceleration = math.inf


@kernel
def over_limit_due(plant: Record, arcs: NDArray[Any]) -> float:
    """Return the time at which a stuck throttle exceeds the acceleration limit, s; inf: never.

    Args:
        plant: record PLANT.
        arcs: dtype ARC.
    """
    failure = plant.failure
    if not failure.over_mass > 0.0 or plant.arc != failure.arc:
        return math.inf
    return plant.time + max(0.0, plant.mass - failure.over_mass) / arcs[plant.arc].mass_flow


@kernel
def strike(plant: Record, arcs: NDArray[Any]) -> bool:
    """Carry out the failure that is due; in vain in a coast, or without a throttle to stick.

    Args:
        plant: record PLANT. Changed.
        arcs: dtype ARC. Changed.

    Returns:
        whether it ends the present burn.
    """
    failure = plant.failure
    failure.struck = STRUCK
    if failure.kind == STUCK_JETTISON:
        return False
    if arcs[plant.arc].kind != BURN:
        failure.struck = IN_VAIN
        return False
    if failure.kind == ENGINE_OUT or failure.kind == THRUST_LOW:
        into = plant.time - plant.arc_start_time
        ratios = failure.thrust_ratio, failure.flow_ratio
        weaken_stage(arcs, plant.arc, into, ratios, failure.kind == ENGINE_OUT)
    elif failure.kind == STUCK_THROTTLE:
        if math.isfinite(arcs[plant.arc].max_acceleration):
            fix_throttle(plant, arcs)
        else:
            failure.struck = IN_VAIN
    shuts_down = failure.kind == EARLY_SHUTDOWN or failure.kind == FAILED_IGNITION
    if shuts_down and arcs[plant.arc].core_thrust > 0.0:
        # the boosters beside the engines burn on
        shut_down_core(arcs, plant.arc)
        return False
    return shuts_down
