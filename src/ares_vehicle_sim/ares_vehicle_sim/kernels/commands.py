# SPDX-License-Identifier: Apache-2.0
"""Put steering commands in force: thrust direction, cut-off, jettison, ends of free arcs."""

import math

from ares_models.arrays import MAX_ARCS, Record
from ares_models.jit import kernel
from ares_models.kernels.steering import copy_decision


@kernel
def copy_command(source: Record, destination: Record) -> None:
    """Copy a command, but keep cut-off and arc ends that the new command does not know.

    A predicted cut-off is thus carried out even if later commands have none.
    """
    known = destination.cutoff_time
    copy_decision(source, destination)
    if math.isnan(source.cutoff_time):
        destination.cutoff_time = known
    for k in range(MAX_ARCS):
        if math.isfinite(source.arc_end_times[k]):
            destination.arc_end_times[k] = source.arc_end_times[k]


@kernel
def put_in_force(plant: Record, command: Record) -> None:
    """Put a command in force."""
    copy_command(command, plant.command)
    for j in range(plant.jettison_time.shape[0]):
        plant.jettison_time[j] = math.nan
    if 0 <= command.jettison < plant.jettison_time.shape[0]:
        plant.jettison_time[command.jettison] = command.jettison_time


@kernel
def accept_command(plant: Record, steering: Record) -> None:
    """Accept a checked command, in force at once or after the flight's latency.

    While one is pending the guidance computer is busy, and others are ignored.
    """
    if not plant.latency > 0.0:
        put_in_force(plant, steering)
    elif plant.pending_time == math.inf:
        copy_command(steering, plant.pending)
        plant.pending_time = plant.time + plant.latency
