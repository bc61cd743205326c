"""Flights of a campaign by their numbers, without Python in any of them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import GUIDANCE_STATE
from ares_guidance.law import LawSettings
from ares_guidance.laws import make_law
from ares_models.arrays import NAVIGATION, STEERING
from ares_models.mission import Mission
from ares_studies.loops import campaign_loop
from ares_studies.montecarlo.arrays import RESULT
from ares_vehicle_sim.arrays import PLANT
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.draws import Sampler
from ares_vehicle_sim.simulator import CAMPAIGN, SimulatorOptions, true_environment


@dataclass(frozen=True)
class Settings:
    """What is flown: everything that the result of a flight depends on but its number.

    Attributes:
        mission: what guidance believes, and the middle of the truth.
        dispersions: how the truth differs.
        seed: master seed.
        law: one of `ares_guidance.registry.law_names`.
        law_settings: cycle and gates.
        options: how the plant is stepped.
    """

    mission: Mission
    dispersions: Dispersions
    seed: int = 0
    law: str = "peg"
    law_settings: LawSettings = field(default_factory=LawSettings)
    options: SimulatorOptions = CAMPAIGN


@dataclass(frozen=True)
class Flown:
    """Flights in a row.

    Attributes:
        first: number of the first.
        inputs: shape (n, columns), what was drawn; nan where that failed.
        results: shape (n,), dtype RESULT; all zero where a flight failed.
        errors: what went wrong in our own house, by flight.
    """

    first: int
    inputs: NDArray[np.float64]
    results: NDArray[np.void]
    errors: dict[int, str]


class Range:
    """Flies flights in a row. One thread at a time: every thread needs one of its own.

    Attributes:
        columns: names of the inputs.
    """

    def __init__(self, settings: Settings) -> None:
        """Prepare.

        Raises:
            ValueError: dispersions or law do not fit the mission; one line.
        """
        mission = settings.mission
        self._sampler = Sampler(mission, settings.dispersions, settings.seed)
        self.columns = self._sampler.columns
        start = mission.start()
        believed, nominal = mission.arrays(foreseen=True), mission.arrays()
        plant = np.zeros(1, PLANT)
        plant["time"] = start.time_s
        law = make_law(settings.law, believed, settings.law_settings)
        self._fly_many = campaign_loop(law.kind)
        self._fixed = (
            tuple(start.position.tolist()),
            tuple(start.velocity.tolist()),
            true_environment(mission, settings.dispersions),
            nominal.arcs,
            nominal.jettisons,
            settings.options.record()[0],
            settings.options.navigation_period_s,
            believed.environment[0],
            believed.atmosphere,
            believed.arcs,
            believed.jettisons,
            believed.target[0],
            law.settings,
            plant,
            np.array([law.state]),
            law.steering,
            np.zeros(1, PLANT),
            nominal.environment.copy(),
            nominal.arcs.copy(),
            nominal.jettisons.copy(),
            np.zeros(1, GUIDANCE_STATE),
            np.zeros(1, GUIDANCE_STATE),
            np.zeros(1, NAVIGATION),
            np.zeros(1, STEERING),
        )

    def fly(self, first: int, count: int) -> Flown:
        """Fly the flights numbered ``first`` to ``first + count - 1``.

        What goes wrong in one flight is noted with it and stops no other.
        """
        try:
            return self._fly(first, count)
        except Exception as error:
            if count == 1:
                text = f"{type(error).__name__}: {' '.join(str(error).split())}"
                inputs = np.full((1, len(self.columns)), np.nan)
                return Flown(first, inputs, np.zeros(1, RESULT), {first: text})
        alone = [self.fly(flight, 1) for flight in range(first, first + count)]
        return Flown(
            first,
            np.concatenate([flown.inputs for flown in alone]),
            np.concatenate([flown.results for flown in alone]),
            {flight: text for flown in alone for flight, text in flown.errors.items()},
        )

    def _fly(self, first: int, count: int) -> Flown:
        draws = self._sampler.draw(first, count)
        results = np.zeros(count, RESULT)
        self._fly_many(draws.variations, draws.atmospheres, *self._fixed, results)
        return Flown(first, draws.inputs, results, {})
