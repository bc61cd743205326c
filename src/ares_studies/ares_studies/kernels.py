# SPDX-License-Identifier: Apache-2.0
"""Fly a whole flight in one compiled loop, by the same two steps as the nodes.

`guarded_step` is PEG's; see `ares_studies.loops` for the other laws.
"""

from ares_guidance.arrays import LAW_PEG
from ares_guidance.kernels.entry import onboard_records
from ares_guidance.kernels.guarded import guarded_step
from ares_models.jit import inlined, kernel
from ares_models.kernels.records import mission_records
from ares_studies.arrays import Loop, LoopArrays
from ares_vehicle_sim.kernels.commands import accept_command
from ares_vehicle_sim.kernels.entry import vehicle_records
from ares_vehicle_sim.kernels.navigation import measure
from ares_vehicle_sim.kernels.plant import flight_step, next_tick


@inlined
def loop_records(loop: LoopArrays) -> Loop:
    """Convert a loop to records."""
    return Loop(
        mission_records(loop.true),
        vehicle_records(loop.vehicle),
        mission_records(loop.believed),
        onboard_records(loop.onboard),
        loop.onboard.memory[0],
    )


@kernel
def fly(loop: LoopArrays) -> int:
    """Fly from an initialized plant and its first navigation state to the end of the flight.

    The clock counts whole navigation periods in nanoseconds, as the simulator node does.

    Returns:
        the navigation states answered by PEG's solution, which stands in for another law.
    """
    true, vehicle, believed, onboard, memory = loop_records(loop)
    plant = vehicle.plant
    start_ns = round(plant.time * 1e9)
    period_ns = round(vehicle.options.navigation_period * 1e9)
    tick = 0
    by_peg = 0
    while plant.complete == 0:
        guarded_step(believed, onboard, memory)
        by_peg += onboard.state.law == LAW_PEG
        accept_command(plant, onboard.steering)
        tick = next_tick(true, vehicle, tick)
        flight_step(true, vehicle, (start_ns + tick * period_ns) / 1e9)
        measure(vehicle)
    return by_peg
