# SPDX-License-Identifier: Apache-2.0
"""Entry from Python into the simulation: convert the arrays of a flight to records."""

from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.jit import inlined, kernel
from ares_models.kernels.records import mission_records
from ares_models.kernels.steering import is_sound
from ares_vehicle_sim.arrays import Vehicle, VehicleArrays
from ares_vehicle_sim.kernels import plant as kernels
from ares_vehicle_sim.kernels.commands import accept_command
from ares_vehicle_sim.kernels.navigation import measure


@inlined
def vehicle_records(vehicle: VehicleArrays) -> Vehicle:
    """Return the records of a flight."""
    return Vehicle(vehicle.options[0], vehicle.plant[0], vehicle.navigation[0], vehicle.truth[0])


@kernel
def begin(mission: MissionArrays, vehicle: VehicleArrays) -> None:
    """Start the sequence and measure the first navigation state."""
    kernels.begin_flight(mission_records(mission), vehicle.plant[0])
    measure(vehicle_records(vehicle))


@kernel
def command(mission: MissionArrays, vehicle: VehicleArrays, steering: NDArray[Any]) -> bool:
    """Accept a command, shape (1,), dtype STEERING; return False if it is invalid."""
    if not is_sound(steering[0], mission.jettisons.shape[0]):
        return False
    accept_command(vehicle.plant[0], steering[0])
    return True


@kernel
def next_tick(mission: MissionArrays, vehicle: VehicleArrays, tick: int) -> int:
    """Return the number of the navigation state after state ``tick``."""
    return kernels.next_tick(mission_records(mission), vehicle_records(vehicle), tick)


@kernel
def advance(mission: MissionArrays, vehicle: VehicleArrays, until: float) -> None:
    """Fly to ``until``, s, or to the end of the flight, and measure the navigation state."""
    carried = vehicle_records(vehicle)
    kernels.flight_step(mission_records(mission), carried, until)
    measure(carried)


@kernel
def describe(mission: MissionArrays, vehicle: VehicleArrays) -> None:
    """Write the true state into ``vehicle.truth``."""
    kernels.describe(mission_records(mission), vehicle_records(vehicle))
