# SPDX-License-Identifier: Apache-2.0
"""Fly flights of a campaign by number, without Python inside any of them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import blank_onboard
from ares_guidance.plan import ArcPlan
from ares_guidance.settings import LawSettings
from ares_models.failures import Failure, check_failure
from ares_models.mission import Mission
from ares_models.mission_pieces import piece_array
from ares_studies.arrays import closed_loop
from ares_studies.closed_loop import ready_law
from ares_studies.loops import flight_loop
from ares_studies.montecarlo.arrays import RESULT
from ares_studies.montecarlo.kernels import assess, begin
from ares_vehicle_sim.arrays import FAILURE, blank_vehicle
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.draws import Sampler, piece_slugs
from ares_vehicle_sim.simulator import (
    CAMPAIGN,
    SimulatorOptions,
    failure_record,
    nominal_truth,
    nominal_vehicle,
    room_for_truth,
)


@dataclass(frozen=True)
class Settings:
    """Hold everything on which the result of a flight depends, except its number.

    Attributes:
        mission: mission believed by guidance, and centre of the dispersed truth.
        dispersions: of the truth.
        seed: master seed.
        law: one of `ares_guidance.registry.law_names`.
        law_settings: cycle and gates.
        options: integration of the plant.
        plan: of what the mission leaves free; None: none, or each :class:`FlightRange` solves for
            it.
    """

    mission: Mission
    dispersions: Dispersions
    seed: int = 0
    law: str = "peg"
    law_settings: LawSettings = field(default_factory=LawSettings)
    options: SimulatorOptions = CAMPAIGN
    plan: ArcPlan | None = field(default=None, compare=False)

    def planned(self) -> "Settings":
        """Return the settings with their plan, which is solved for once.

        Raises:
            ValueError: the law cannot fly the mission, or there is no plan; one line.
        """
        law = ready_law(self.mission, self.law, self.law_settings)
        return replace(self, plan=law.plan)


@dataclass(frozen=True)
class Flown:
    """Hold consecutive flights.

    Attributes:
        first: number of the first.
        inputs: shape (n, columns), the draws; nan if drawing failed.
        results: shape (n,), dtype RESULT; all zero for a flight with an error.
        errors: internal errors, by flight.
    """

    first: int
    inputs: NDArray[np.float64]
    results: NDArray[np.void]
    errors: dict[int, str]


class FlightRange:
    """Fly consecutive flights. Not safe for several threads: each needs one of its own.

    Attributes:
        columns: names of the inputs.
        pieces: what may come down, as in columns' names.
    """

    def __init__(self, settings: Settings) -> None:
        """Allocate the arrays of a flight.

        Raises:
            ValueError: dispersions or law do not fit the mission; one line.
        """
        mission = self._mission = settings.mission
        self._sampler = Sampler(mission, settings.dispersions, settings.seed)
        self.columns = self._sampler.columns
        self.pieces = piece_slugs(mission)
        self._nominal = nominal_truth(mission, settings.dispersions)
        believed = mission.arrays(foreseen=True)
        law = ready_law(mission, settings.law, settings.law_settings, plan=settings.plan)
        self._fly_loop = flight_loop(law.kind)
        self._pieces = piece_array(mission.pieces)
        # the draws contain the atmosphere of each flight
        true = room_for_truth(self._nominal, self._nominal.atmosphere)
        vehicle = nominal_vehicle(mission, settings.options)
        self._blank = closed_loop(true, vehicle, believed, law.onboard)
        self._workspace = closed_loop(
            true,
            blank_vehicle(vehicle.options),
            believed,
            blank_onboard(law.onboard.settings, law.kind.memory),
        )

    def fly(self, first: int, count: int) -> Flown:
        """Fly the flights numbered ``first`` to ``first + count - 1``.

        An error in one flight is recorded with it and stops no other.
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

    def fly_failing(self, first: int, failures: Sequence[Failure]) -> Flown:
        """Fly flights from ``first`` on, one for each failure.

        Raises:
            FailureError: one of them does not fit the mission; one line.
        """
        for failure in failures:
            check_failure(failure, self._mission)
        records = np.concatenate([failure_record(failure) for failure in failures])
        return self._fly(first, len(failures), records)

    def _fly(self, first: int, count: int, failures: NDArray[np.void] | None = None) -> Flown:
        draws = self._sampler.draw(first, count)
        results = np.zeros(count, RESULT)
        if failures is None:
            failures = np.zeros(1, FAILURE)
        for k in range(count):
            atmosphere = draws.atmospheres[k % len(draws.atmospheres)]
            true = self._workspace.true._replace(atmosphere=atmosphere)
            loop = self._workspace._replace(true=true)
            variation, result = draws.variations[k : k + 1], results[k : k + 1]
            failure = failures[k % len(failures) :][:1]
            begin(variation, failure, self._nominal, self._blank, loop)
            result["by_peg"] = self._fly_loop(loop)
            assess(loop, variation, self._pieces, result)
        return Flown(first, draws.inputs, results, {})
