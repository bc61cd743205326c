"""A whole flight in one compiled loop, through the same two steps as the nodes."""

from ares_guidance.kernels.peg import guidance_step
from ares_models.jit import kernel
from ares_models.kernels.environment import heating_rate
from ares_models.kernels.vectors import load, store
from ares_vehicle_sim.kernels import accept_command, flight_step


@kernel
def measure(plant, environment, atmosphere, nav) -> None:  # type: ignore[no-untyped-def]
    """Perfect navigation: the truth, as a navigation state."""
    nav.time = plant.time
    r = load(plant.position)
    v = load(plant.velocity)
    store(nav.position, r)
    store(nav.velocity, v)
    store(nav.sensed_delta_v, load(plant.sensed_delta_v))
    nav.mass = plant.mass
    nav.heating_rate = heating_rate(r, v, environment, atmosphere)
    nav.arc = plant.arc
    nav.arc_start_time = plant.arc_start_time
    nav.jettisoned = plant.jettisoned


@kernel
def fly(  # type: ignore[no-untyped-def]
    plant,
    environment,
    atmosphere,
    arcs,
    options,
    believed_environment,
    believed_atmosphere,
    believed_arcs,
    jettisons,
    target,
    settings,
    state,
    saved,
    nav,
    steering,
    navigation_period: float,
) -> None:
    """Fly from a begun plant to the end of the flight.

    The clock counts whole navigation periods in nanoseconds, as the simulator node does.
    """
    start_ns = round(plant.time * 1e9)
    period_ns = round(navigation_period * 1e9)
    tick = 0
    while plant.complete == 0:
        measure(plant, environment, atmosphere, nav)
        guidance_step(
            nav,
            believed_environment,
            believed_atmosphere,
            believed_arcs,
            jettisons,
            target,
            settings,
            state,
            saved,
            steering,
        )
        accept_command(plant, steering, jettisons)
        tick += 1
        flight_step(
            plant,
            environment,
            atmosphere,
            arcs,
            jettisons,
            options,
            (start_ns + tick * period_ns) * 1e-9,
        )
