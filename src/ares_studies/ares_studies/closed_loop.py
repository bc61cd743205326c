"""Closed-loop flights without ROS: the nodes' two steps, called in turn."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import GUIDANCE_STATE
from ares_guidance.law import LawSettings
from ares_guidance.laws import make_law
from ares_models.arrays import NAVIGATION, STEERING
from ares_models.mission import Mission
from ares_studies.kernels import fly
from ares_vehicle_sim.arrays import OPTIONS, PLANT
from ares_vehicle_sim.dispersions import NO_ERRORS, Dispersions, disperse
from ares_vehicle_sim.kernels import begin_flight
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions


@dataclass(frozen=True)
class Flight:
    """The end of a flight.

    Attributes:
        plant: record PLANT with the true final state and the events.
        guidance: record GUIDANCE_STATE.
    """

    plant: Any
    guidance: Any

    @property
    def events(self) -> NDArray[np.void]:
        """What happened, dtype EVENT."""
        return self.plant["events"][: self.plant["event_count"]]


def fly_compiled(
    mission: Mission,
    settings: LawSettings | None = None,
    options: SimulatorOptions | None = None,
    dispersions: Dispersions | None = None,
    seed: int = 0,
    law: str = "peg",
) -> Flight:
    """Fly a mission with perfect navigation in one compiled loop.

    Args:
        mission: what is flown.
        settings: cycle and gates of the law.
        options: how the plant is stepped.
        dispersions: one-sigma values of the vehicle; navigation errors are not modelled here.
        seed: seed of the dispersions.
        law: one of `ares_guidance.law.CODES`.

    Raises:
        ValueError: the dispersions hold navigation errors.
    """
    options = options or SimulatorOptions()
    dispersions = dispersions or Dispersions()
    if dispersions.navigation != NO_ERRORS:
        raise ValueError("navigation errors need fly_stepwise; the compiled loop has none")
    believed = mission.arrays()
    start = mission.start()
    vehicle = disperse(believed, start.position, start.velocity, dispersions, seed)
    true = vehicle.arrays
    plant = np.zeros(1, PLANT)
    plant["time"] = start.time_s
    plant["position"] = vehicle.position
    plant["velocity"] = vehicle.velocity
    plant_options = np.zeros(1, OPTIONS)
    plant_options["max_step"] = options.integration_step_s
    plant_options["attitude_rate_limit"] = options.attitude_rate_limit_rad_s
    state = np.zeros(1, GUIDANCE_STATE)
    steering = np.zeros(1, STEERING)
    steering["cutoff_time"] = math.nan
    begin_flight(plant[0], true.environment[0], true.atmosphere, true.arcs, true.jettisons)
    fly(
        plant[0],
        true.environment[0],
        true.atmosphere,
        true.arcs,
        true.jettisons,
        plant_options[0],
        believed.environment[0],
        believed.atmosphere,
        believed.arcs,
        believed.jettisons,
        believed.target[0],
        (settings or LawSettings()).record(law)[0],
        state[0],
        np.zeros(1, GUIDANCE_STATE)[0],
        np.zeros(1, NAVIGATION)[0],
        steering[0],
        options.navigation_period_s,
    )
    return Flight(plant[0], state[0])


def fly_stepwise(
    mission: Mission,
    settings: LawSettings | None = None,
    options: SimulatorOptions | None = None,
    dispersions: Dispersions | None = None,
    seed: int = 0,
    law: str = "peg",
) -> Flight:
    """Fly a mission through the objects that the nodes hold, navigation errors included.

    Args: as :func:`fly_compiled`; `law` one of `ares_guidance.laws.LAWS`.
    """
    simulator = Simulator(mission, options, dispersions, seed)
    guide = make_law(law, mission.arrays(), settings)
    while not simulator.complete:
        guide.step(simulator.navigation)
        simulator.command(guide.steering)
        simulator.advance()
    return Flight(simulator.plant, guide.state)
