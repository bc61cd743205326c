# SPDX-License-Identifier: Apache-2.0
"""Maximise the payload of a mission."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ares_models.kernels.sequence import empty_mass
from ares_models.mission import Mission
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.plan import saving_stage, with_more_propellant
from ares_optimizer.solution import Check, OptimizerError, Solution, Status
from ares_optimizer.solve import solve

_TRIALS = 40
#: Payloads tried, ever nearer to one that flies, where no flight is found.
_HALVINGS = 5
#: Step of the payload over the propellant left, while no payload is known to be too large.
_BEYOND = 1.25
#: Tolerance of the propellant left at the greatest payload, kg, and relative.
_LEFT_KG = 1e-3
_LEFT = 1e-6
#: Propellant of the last burn, kg, below which the burns before it give too much.
_NOTHING_KG = 1.0


class NoFlight(Exception):
    """Signal that no flight is found, however much propellant there is."""


class Greatest(NamedTuple):
    """Hold the greatest payload with its flight.

    Attributes:
        mission: with the payload.
        payload_kg: the payload.
        solution: the flight that uses all propellant of the saving stage, within the tolerance, or
            the last one found.
        left_kg: propellant beyond that tolerance, where no flight is found with more payload. If
            it was the time limit that ended the search for one, the flight is feasible at most.
    """

    mission: Mission
    payload_kg: float
    solution: Solution
    left_kg: float = 0.0


def stage_with_margin(mission: Mission) -> int:
    """Return the stage whose propellant left is the margin: the last one with a free burn.

    Raises:
        OptimizerError: no burn is free; one line.
    """
    stage = saving_stage(mission.arrays(), mission.start().navigation()[0])
    if stage < 0:
        raise OptimizerError("all burns have fixed lengths; expected one with burn_time_s: free")
    return stage


def _left(mission: Mission, stage: int, found: Solution) -> float:
    """Return the propellant that a flight leaves in a stage, kg; negative: shortfall."""
    arrays = mission.arrays()
    k = int(np.flatnonzero(arrays.arcs["stage"] == stage)[-1])
    arc = arrays.arcs[k]
    if k + 1 == len(arrays.arcs):
        dry = arc["stack_mass"] - mission.jettison_mass(stage) - arc["propellant"]
        return float(found.m_f_kg - dry)
    end_s = next(flown.end_s for flown in found.flown if flown.arc == k)
    dropped = sum(1 << j for j, t in enumerate(found.jettison_times_s) if t <= end_s)
    return found.end_mass_kg(k) - empty_mass(arc, arrays.arcs, arrays.jettisons, dropped)


def _with_any_propellant(
    mission: Mission, deadline: Deadline, guess: Solution | None = None, verify: bool = False
) -> Solution:
    """Solve a mission whose saving stage is nearly all propellant."""
    start = mission.start().navigation()
    return solve(
        with_more_propellant(mission.arrays(), start[0]),
        "auto",
        guess=guess,
        state=start,
        heating=mission.heating_limit_holds,
        deadline=deadline,
        verify=verify,
    )


class PropellantMargin:
    """Compute the propellant that like missions leave; each search begins at the flight before.

    Attributes:
        known: the last flight found.
        out_of_time: whether the time limit ended a search without a flight.
    """

    def __init__(self, deadline: Callable[[], Deadline]):
        """Store what makes the time limit of a search."""
        self._deadline = deadline
        self.known: Solution | None = None
        self.out_of_time = False

    def of(self, mission: Mission) -> float:
        """Return the propellant left at the end by the best flight, kg; negative: shortfall.

        Raises:
            NoFlight: no flight is found with any propellant.
        """
        found = _with_any_propellant(mission, self._deadline(), self.known)
        if not found.flyable and found.last_burn_kg < _NOTHING_KG:
            # the burns before it reach the target, if not to the last metre: it takes more
            return float(mission.arrays().arcs[-1]["propellant"])
        if not found.flyable:
            self.out_of_time |= found.status is Status.TIME_LIMIT
            raise NoFlight(found.reason)
        # without its proof a flight may have no trajectory, with which another search begins
        self.known = found if found.trajectory is not None else None
        return _left(mission, stage_with_margin(mission), found)


def _flown(
    mission: Mission, payload: float, above: float, margin: PropellantMargin
) -> tuple[float, float]:
    """Return a payload that flies, the given one or below, and the propellant that it leaves, kg.

    Args:
        mission: with its masses by item.
        payload: tried first, kg.
        above: least payload to try, kg.
        margin: computes the propellant left.

    Raises:
        OptimizerError: no flight is found; one line.
    """
    reason = ""
    for _ in range(_HALVINGS):
        trial = mission.model_copy(update={"payload_kg": payload})
        try:
            return payload, margin.of(trial)
        except NoFlight as error:
            reason = reason or f"payload_kg is {payload:,.1f}: {error}"
        if payload <= above:
            break
        payload = 0.5 * (above + payload)
    raise OptimizerError(reason)


def greatest_payload(
    mission: Mission,
    time_limit_s: float | None = None,
    report: Callable[[Progress], None] = lambda _progress: None,
    better: Callable[[float, float], None] = lambda _payload_kg, _left_kg: None,
) -> Greatest:
    """Find the payload at which the last stage with a free burn is depleted, on target.

    The propellant left, negative for a shortfall, falls with the payload; its zero is found by
    regula falsi (Illinois), from the payload of the file on. Where no flight is found with a
    payload, a smaller one is tried.

    Args:
        mission: with its masses by item.
        time_limit_s: of each search, s.
        report: see :class:`ares_optimizer.deadline.Deadline`.
        better: called with each greater payload that flies and the propellant that it leaves, kg.

    Raises:
        OptimizerError: masses are not by item, no burn is free, or no flight is found; one line.
    """
    if mission.payload_kg is None:
        raise OptimizerError("payload_kg is missing; expected masses by item to maximize it")
    stage = stage_with_margin(mission)
    arcs = mission.arrays().arcs
    usable = float(arcs["propellant"][arcs["stage"] == stage][-1])

    def deadline() -> Deadline:
        return Deadline(time_limit_s, report)

    margin = PropellantMargin(deadline)
    low, left_low = _flown(mission, mission.payload_kg, 0.0, margin)
    high, left_high = math.inf, math.nan
    if left_low < 0.0:
        high, left_high = low, left_low
        low, left_low = _flown(mission, 0.0, 0.0, margin)
        if not left_low >= 0.0:
            raise OptimizerError(
                f"payload_kg: stage {mission.stages[stage].name} lacks {-left_low:,.1f} kg of "
                "propellant without any"
            )
    enough = _LEFT_KG + _LEFT * usable
    for _ in range(_TRIALS):
        better(low, left_low)
        if left_low <= enough:
            break
        if math.isinf(high):
            # a kilogram more on board takes about one of propellant
            middle = low + _BEYOND * left_low
        else:
            middle = low + (high - low) * left_low / (left_low - left_high)
            # aim at a small remainder of propellant
            middle = max(low + 0.01 * (high - low), middle - 0.25 * enough)
        try:
            middle, there = _flown(mission, middle, low, margin)
        except OptimizerError:
            break
        margin.out_of_time = False
        if there >= 0.0:
            low, left_low, left_high = middle, there, 0.5 * left_high
        else:
            high, left_high = middle, there
    best = mission.model_copy(update={"payload_kg": low})
    found = solve(best, "auto", deadline=deadline())
    if not found.flyable:
        # with no propellant to spare other first guesses count: the flight of the search has enough
        found = _with_any_propellant(best, deadline(), margin.known, verify=True)
        last = stage == int(arcs[-1]["stage"])
        found = replace(
            found,
            constraints=tuple(
                replace(check, limit=usable, active=True)
                if check.key is (Check.PROPELLANT if last else Check.SAVED_PROPELLANT)
                else check
                for check in found.constraints
            ),
        )
    if left_low <= enough:
        return Greatest(best, low, found)
    if margin.out_of_time and found.flyable:
        reason = "the time limit passed before the search for more payload ended"
        found = replace(found, status=Status.FEASIBLE, reason=reason)
    return Greatest(best, low, found, left_low)
