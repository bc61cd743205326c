# SPDX-License-Identifier: Apache-2.0
"""Determine whether a dispersed vehicle could have reached the target, by its optimum.

Without guidance: the optimizer flies the drawn vehicle in the drawn atmosphere and gravity, all
known from the start.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ares_guidance.laws import find_law
from ares_models.plans import flies_in_air
from ares_optimizer.solution import OptimizerError, Status
from ares_optimizer.solve import solve
from ares_studies.closed_loop import plan_solution
from ares_studies.montecarlo.flights import Settings
from ares_studies.montecarlo.table import Verdict
from ares_vehicle_sim.simulator import true_vehicle

#: Wall time limit of one solution, s; an optimum takes some 10 ms, one through the air 1 s, and
#: more beside other work, which must not change the answer.
TIME_LIMIT = 30.0


@dataclass(frozen=True)
class Reach:
    """Hold the optimizer's answer for a flight.

    Attributes:
        within: True: the target can be reached; False: it cannot; None: neither was shown.
        m_f_kg: final mass of the optimum; nan without one.
        reason: why not; "" if it can.
    """

    within: bool | None
    m_f_kg: float
    reason: str

    def __str__(self) -> str:
        """Describe the answer."""
        if self.within is None:
            return f"within reach or not: unknown, {self.reason}"
        if self.within:
            return f"within reach: the optimum ends with {self.m_f_kg:,.1f} kg"
        return f"out of reach: {self.reason}"


def reach(settings: Settings, flight: int) -> Reach:
    """Solve for the optimum of a campaign's flight.

    The wind is that of the flight without gust and turbulence, whose turns no plan can know.

    Args:
        settings: of the campaign.
        flight: its number.

    Raises:
        DispersionsError: the dispersions do not fit the mission; one line.
    """
    mission = settings.mission
    steady = settings.dispersions.model_copy(update={"gust": None, "turbulence": None})
    true, vehicle = true_vehicle(mission, settings.options, steady, settings.seed, flight)
    state = vehicle.navigation.copy()
    for name in ("position", "velocity", "mass"):
        state[name] = vehicle.plant[name]
    in_air = flies_in_air(true.arcs)
    try:
        optimum = solve(
            true,
            "collocation" if in_air else "indirect",
            guess=plan_solution(mission, find_law(settings.law)) if in_air else None,
            state=state,
            heating=mission.heating_limit_holds,
            time_limit_s=TIME_LIMIT,
        )
    except OptimizerError as error:
        # what was drawn is no state to begin with, such as one below the ground
        return Reach(None, math.nan, str(error))
    if optimum.flyable:
        return Reach(True, optimum.m_f_kg, "")
    within = False if optimum.status is Status.INFEASIBLE else None
    return Reach(within, math.nan, optimum.reason)


def reaches(settings: Settings, failures: Iterable[dict[str, Any]]) -> dict[int, Reach]:
    """Solve for the optima of failed rows, by flight; skip internal errors."""
    return {
        row["flight"]: reach(settings, row["flight"])
        for row in failures
        if row["outcome"] != Verdict.ERROR
    }
