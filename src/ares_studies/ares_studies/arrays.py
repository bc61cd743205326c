# SPDX-License-Identifier: Apache-2.0
"""Define the arrays of a flight in one compiled loop."""

from typing import NamedTuple

from ares_guidance.arrays import Onboard, OnboardArrays
from ares_models.arrays import MissionArrays, MissionRecords, Record
from ares_vehicle_sim.arrays import Vehicle, VehicleArrays


class LoopArrays(NamedTuple):
    """Hold a vehicle and its guidance.

    Attributes:
        true: the mission as the plant flies it.
        vehicle: the simulated vehicle.
        believed: the mission as guidance believes it.
        onboard: the arrays of guidance; its ``navigation`` is the vehicle's.
    """

    true: MissionArrays
    vehicle: VehicleArrays
    believed: MissionArrays
    onboard: OnboardArrays


class Loop(NamedTuple):
    """Hold the same as records, for kernels."""

    true: MissionRecords
    vehicle: Vehicle
    believed: MissionRecords
    onboard: Onboard
    memory: Record


def closed_loop(
    true: MissionArrays, vehicle: VehicleArrays, believed: MissionArrays, onboard: OnboardArrays
) -> LoopArrays:
    """Combine arrays so that guidance reads the vehicle's navigation."""
    return LoopArrays(true, vehicle, believed, onboard._replace(navigation=vehicle.navigation))
