"""A whole flight in one compiled loop, through the same two steps as the nodes.

`guidance_step` is PEG's; see `ares_studies.loops` for the other laws.
"""

from typing import Any

from numpy.typing import NDArray

from ares_guidance.kernels.cycle import guidance_step
from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_vehicle_sim.kernels.navigation import measure
from ares_vehicle_sim.kernels.plant import accept_command, flight_step


@kernel
def fly(
    plant: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    options: Record,
    believed_environment: Record,
    believed_atmosphere: NDArray[Any],
    believed_arcs: NDArray[Any],
    believed_jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    state: Record,
    saved: Record,
    nav: Record,
    steering: Record,
    navigation_period: float,
) -> None:
    """Fly from a begun plant to the end of the flight.

    The clock counts whole navigation periods in nanoseconds, as the simulator node does.
    """
    start_ns = round(plant.time * 1e9)
    period_ns = round(navigation_period * 1e9)
    tick = 0
    while plant.complete == 0:
        measure(plant, nav)
        guidance_step(
            nav,
            believed_environment,
            believed_atmosphere,
            believed_arcs,
            believed_jettisons,
            target,
            settings,
            state,
            saved,
            steering,
        )
        accept_command(plant, steering)
        tick += 1
        flight_step(
            plant,
            environment,
            atmosphere,
            arcs,
            jettisons,
            options,
            (start_ns + tick * period_ns) / 1e9,
        )
