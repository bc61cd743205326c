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
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions, true_vehicle


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
    flight: int = 0,
    law: str = "peg",
) -> Flight:
    """Fly a mission in one compiled loop.

    Args:
        mission: what is flown.
        settings: cycle and gates of the law.
        options: how the plant is stepped.
        dispersions: how the truth differs from the mission file; None: nowhere.
        seed: master seed of what is drawn.
        flight: number of the flight among those of the seed.
        law: one of `ares_guidance.law.CODES`.
    """
    options = options or SimulatorOptions()
    believed = mission.arrays(foreseen=True)
    vehicle = true_vehicle(mission, dispersions or Dispersions(), seed, flight)
    true, plant = vehicle.arrays, vehicle.plant
    state = np.zeros(1, GUIDANCE_STATE)
    steering = np.zeros(1, STEERING)
    steering["cutoff_time"] = math.nan
    fly(
        plant[0],
        true.environment[0],
        true.atmosphere,
        true.arcs,
        true.jettisons,
        options.record()[0],
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
    flight: int = 0,
    law: str = "peg",
) -> Flight:
    """Fly a mission through the objects that the nodes hold.

    Args: as :func:`fly_compiled`; `law` one of `ares_guidance.laws.LAWS`.
    """
    simulator = Simulator(mission, options, dispersions, seed, flight)
    guide = make_law(law, mission.arrays(foreseen=True), settings)
    while not simulator.complete:
        guide.step(simulator.navigation)
        simulator.command(guide.steering)
        simulator.advance()
    return Flight(simulator.plant, guide.state)
