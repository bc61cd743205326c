# SPDX-License-Identifier: Apache-2.0
"""What a flight in one compiled loop is made of."""

from typing import NamedTuple

from ares_guidance.arrays import Onboard, OnboardArrays
from ares_models.arrays import MissionArrays, MissionRecords, Record
from ares_vehicle_sim.arrays import Vehicle, VehicleArrays


class LoopArrays(NamedTuple):
    """A vehicle and its guidance.

    Attributes:
        true: the mission as the plant flies it.
        vehicle: what flies.
        believed: the mission as guidance believes it.
        onboard: what guidance holds; its ``navigation`` is the vehicle's.
    """

    true: MissionArrays
    vehicle: VehicleArrays
    believed: MissionArrays
    onboard: OnboardArrays


class Loop(NamedTuple):
    """The same as kernels hand it to one another, as records."""

    true: MissionRecords
    vehicle: Vehicle
    believed: MissionRecords
    onboard: Onboard
    memory: Record


def closed_loop(
    true: MissionArrays, vehicle: VehicleArrays, believed: MissionArrays, onboard: OnboardArrays
) -> LoopArrays:
    """A loop in which guidance sees what the vehicle's navigation reports."""
    return LoopArrays(true, vehicle, believed, onboard._replace(navigation=vehicle.navigation))
