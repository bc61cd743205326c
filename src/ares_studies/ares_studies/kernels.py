"""A whole flight in one compiled loop, through the same two steps as the nodes.

`guidance_step` is PEG's; see `ares_studies.loops` for the other laws.
"""

from ares_guidance.kernels.cycle import guidance_step
from ares_models.jit import kernel
from ares_studies.arrays import ClosedLoop
from ares_vehicle_sim.kernels.navigation import measure
from ares_vehicle_sim.kernels.plant import accept_command, flight_step


@kernel
def fly(loop: ClosedLoop) -> None:
    """Fly from a begun plant to the end of the flight.

    The clock counts whole navigation periods in nanoseconds, as the simulator node does.
    """
    plant = loop.vehicle.plant[0]
    start_ns = round(plant.time * 1e9)
    period_ns = round(loop.vehicle.options[0].navigation_period * 1e9)
    tick = 0
    while plant.complete == 0:
        measure(loop.vehicle)
        guidance_step(loop.believed, loop.onboard)
        accept_command(loop.vehicle, loop.onboard.steering)
        tick += 1
        flight_step(loop.true, loop.vehicle, (start_ns + tick * period_ns) / 1e9)
