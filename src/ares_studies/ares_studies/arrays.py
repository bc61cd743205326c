"""What a flight in one compiled loop is made of."""

from typing import NamedTuple

from ares_guidance.arrays import Onboard
from ares_models.arrays import MissionArrays
from ares_vehicle_sim.arrays import Vehicle


class ClosedLoop(NamedTuple):
    """A vehicle and its guidance; kernels take it whole.

    Attributes:
        true: the mission as the plant flies it.
        vehicle: what flies.
        believed: the mission as guidance believes it.
        onboard: what guidance holds; its ``navigation`` is the vehicle's.
    """

    true: MissionArrays
    vehicle: Vehicle
    believed: MissionArrays
    onboard: Onboard


def closed_loop(
    true: MissionArrays, vehicle: Vehicle, believed: MissionArrays, onboard: Onboard
) -> ClosedLoop:
    """A loop in which guidance sees what the vehicle's navigation reports."""
    return ClosedLoop(true, vehicle._replace(navigation=onboard.navigation), believed, onboard)
