# SPDX-License-Identifier: Apache-2.0
"""Guidance lost in flight and begun anew, at any time: does the flight arrive?

As the nodes do it, without them: until the new guidance is there the vehicle flies on by its last
good command; the new one has nothing but the navigation state. A law that needs a plan asks the
optimizer for one from that state, and again until there is one, and commands nothing before.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.law import Law
from ares_guidance.laws import find_law, make_law
from ares_models.arrays import HEATING_LIMIT
from ares_models.judge import End
from ares_models.mission import Mission
from ares_models.units import NANOSECONDS
from ares_studies.aborts.ends import Judge, Reached
from ares_studies.arrays import closed_loop
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_studies.loops import flight_loop
from ares_vehicle_sim.arrays import JETTISON_DONE, VehicleArrays
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.kernels.entry import advance, command
from ares_vehicle_sim.simulator import SimulatorOptions, true_vehicle

#: s from one question for a plan to the next, where the optimizer found none.
ASK_AGAIN = 2.0
#: s behind an event: the first state that shows it, in a start-up transient, past most of them.
BEHIND = (0.0, 0.5, 2.0, 4.0)


@dataclass(frozen=True)
class Restarted:
    """A flight whose guidance was lost.

    Attributes:
        lost_s: when, mission elapsed time.
        begun_s: when the new one was there; nan: the flight was over before.
        left_s: from then to the cut-off of the flight that lost nothing.
        arc: index of the arc that the new one began in.
        arrived: cut off within the terminal accuracy, all that should be is gone.
        heating: at a jettison, over its limit, the largest; nan: there was none.
        end: what the end is; SUBORBITAL where there is none.
        mass_kg: at the end.
        refused: navigation states that the new one refused.
        reasons: why the optimizer found no plan, if one was needed, each time that it was asked.
    """

    lost_s: float
    begun_s: float
    left_s: float
    arc: int
    arrived: bool
    heating: float
    end: End
    mass_kg: float
    refused: int
    reasons: tuple[str, ...]


class Restarts:
    """Flights of one mission by one law that lose their guidance.

    Attributes:
        events: of the flight that loses nothing, dtype EVENT.
        arrives: whether that one does.
        cutoff_s: when that one is over, mission elapsed time.
    """

    def __init__(self, mission: Mission, law: str, options: SimulatorOptions | None = None) -> None:
        """Fly it whole.

        Args:
            mission: what is flown.
            law: one of `ares_guidance.registry.law_names`.
            options: how the plant is stepped.

        Raises:
            ValueError: the law cannot fly the mission.
        """
        self._mission, self._law = mission, law
        self._options = options or SimulatorOptions()
        self._believed = mission.arrays(foreseen=True)
        self._judge = Judge(mission)
        self._true, start = true_vehicle(mission, self._options, Dispersions(), 0)
        self._start = _copy(start)
        self._begin_ns = round(float(start.plant["time"][0]) * NANOSECONDS)
        self._period_ns = round(self._options.navigation_period_s * NANOSECONDS)
        self._first = ready_law(mission, law, state=start.navigation)
        self._blank = [array.copy() for array in self._first.onboard]
        flight = fly_compiled(mission, self._options, law=law)
        self.events = flight.events.copy()
        self.arrives = self._arrives(flight.plant)
        self.cutoff_s = float(flight.plant["time"])

    def times(self, count: int) -> list[float]:
        """When to lose it: ``count`` times over the whole flight, and behind its events, s."""
        begin = self._begin_ns / NANOSECONDS
        spread = np.linspace(begin, self.cutoff_s, count, endpoint=False)
        behind = [self.events["time"] + after for after in BEHIND]
        times = np.unique(np.concatenate([spread, *behind]))
        return [float(time) for time in times if begin < time < self.cutoff_s]

    def fly(self, times: Iterable[float], away_s: Sequence[float]) -> Iterator[Restarted]:
        """Lose it.

        Args:
            times: when, s, ascending.
            away_s: how long, each at each time.
        """
        law, vehicle = self._first, _copy(self._start)
        for array, blank in zip(law.onboard, self._blank, strict=True):
            array[:] = blank
        for lost in times:
            while vehicle.plant["time"][0] < lost and not vehicle.plant["complete"][0]:
                law.step(vehicle.navigation[0])
                command(self._true, vehicle, law.steering)
                self._advance(vehicle, 0.0)
            for away in away_s:
                yield self._begin_anew(_copy(vehicle), away)

    def _advance(self, vehicle: VehicleArrays, span: float) -> None:
        """Fly on by the command in force for ``span`` s, to the next navigation state at least."""
        now = round(float(vehicle.plant["time"][0]) * NANOSECONDS)
        tick = (now - self._begin_ns) // self._period_ns
        last = tick + max(1, round(span * NANOSECONDS / self._period_ns))
        while tick < last and not vehicle.plant["complete"][0]:
            tick += 1
            until = self._begin_ns + tick * self._period_ns
            advance(self._true, vehicle, until / NANOSECONDS)

    def _begin_anew(self, vehicle: VehicleArrays, away: float) -> Restarted:
        """Fly on without guidance, and then with another to the end."""
        plant = vehicle.plant[0]
        lost = float(plant["time"])
        if away > 0.0:
            self._advance(vehicle, away)
        reasons = []
        law, begun, arc, refused = None, math.nan, int(plant["arc"]), 0
        if not plant["complete"]:
            begun = float(plant["time"])
        while law is None and not plant["complete"]:
            law, reason = self._new_law(vehicle.navigation)
            if reason:
                reasons.append(reason)
            if law is None:
                self._advance(vehicle, ASK_AGAIN)
        if law is not None:
            flight_loop(law.kind)(closed_loop(self._true, vehicle, self._believed, law.onboard))
            refused = int(law.state["navigation"]["refused"])
        reached = self._reached(plant)
        return Restarted(
            lost_s=lost,
            begun_s=begun,
            left_s=self.cutoff_s - begun,
            arc=arc,
            arrived=self._arrives(plant),
            heating=self._heating(plant["events"][: plant["event_count"]]),
            end=reached.end,
            mass_kg=reached.m_f_kg,
            refused=refused,
            reasons=tuple(reasons),
        )

    def _new_law(self, state: NDArray[np.void]) -> tuple[Law | None, str]:
        """A law from one state; None and why: it lacks its plan. Without a start one flies peg."""
        try:
            return ready_law(self._mission, self._law, state=state), ""
        except ValueError as error:
            if find_law(self._law).needs_trajectory:
                return make_law(self._law, self._believed), str(error)
            return None, str(error)

    def _reached(self, plant: Any) -> Reached:
        return self._judge.judge(
            plant["position"],
            plant["velocity"],
            float(plant["mass"]),
            float(plant["time"]),
            int(plant["jettisoned"]),
        )

    def _arrives(self, plant: Any) -> bool:
        """Whether an end is the target, by a cut-off, with all gone that should be."""
        reached = self._reached(plant)
        arrives = reached.end is End.TARGET and not reached.left_on
        return bool(plant["inserted"] == 1 and arrives)

    def _heating(self, events: NDArray[np.void]) -> float:
        """At a jettison, over its limit, the largest."""
        dropped = events[events["type"] == JETTISON_DONE]
        parts = self._true.jettisons[dropped["index"]]
        hot = parts["criterion"] == HEATING_LIMIT
        ratios = dropped["heating_rate"][hot] / parts["value"][hot]
        return float(np.max(ratios, initial=-math.inf)) if hot.any() else math.nan


def _copy(vehicle: VehicleArrays) -> VehicleArrays:
    return VehicleArrays(*(array.copy() for array in vehicle))
