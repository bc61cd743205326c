# SPDX-License-Identifier: Apache-2.0
"""Lose guidance in flight and restart it, at any time: does the flight reach its target?

As with the nodes, but without them: until the new guidance has started, the vehicle flies on by its
last good command; the new guidance knows only the navigation state. A law that needs a plan
requests one from that state, repeatedly until there is one, and commands nothing before.
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

#: Interval between two requests for a plan, s.
ASK_AGAIN = 2.0
#: Times after an event, s: the first state that shows it, during a start-up transient, after most.
BEHIND = (0.0, 0.5, 2.0, 4.0)


@dataclass(frozen=True)
class Restarted:
    """Hold a flight with a restart of guidance.

    Attributes:
        lost_s: time of the loss, mission elapsed time.
        begun_s: start of the new guidance; nan: the flight was over before.
        left_s: from then to the cut-off of the undisturbed flight.
        arc: index of the arc in which the new guidance started.
        arrived: cut off within the terminal accuracy, with all jettisons done.
        heating: largest ratio of heating to its limit at a jettison; nan: no such jettison.
        end: kind of the end; SUBORBITAL without an orbit.
        mass_kg: at the end.
        refused: navigation states refused by the new guidance.
        reasons: why the optimizer found no plan, one per request.
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
    """Fly one mission by one law with losses of guidance.

    Attributes:
        events: of the undisturbed flight, dtype EVENT.
        arrives: whether that flight reaches the target.
        cutoff_s: end of that flight, mission elapsed time.
    """

    def __init__(self, mission: Mission, law: str) -> None:
        """Fly the undisturbed flight.

        Args:
            mission: to be flown.
            law: one of `ares_guidance.registry.law_names`.

        Raises:
            ValueError: the law cannot fly the mission.
        """
        self._mission, self._law = mission, law
        options = SimulatorOptions()
        self._believed = mission.arrays(foreseen=True)
        self._judge = Judge(mission)
        self._true, start = true_vehicle(mission, options, Dispersions(), 0)
        self._start = _copy(start)
        self._begin_ns = round(float(start.plant["time"][0]) * NANOSECONDS)
        self._period_ns = round(options.navigation_period_s * NANOSECONDS)
        self._first = ready_law(mission, law, state=start.navigation)
        self._blank = [array.copy() for array in self._first.onboard]
        flight = fly_compiled(mission, options, law=law)
        self.events = flight.events.copy()
        self.arrives = self._arrives(flight.plant)
        self.cutoff_s = float(flight.plant["time"])

    def times(self, count: int) -> list[float]:
        """Return times of loss, s: ``count`` over the whole flight, and some after each event."""
        begin = self._begin_ns / NANOSECONDS
        spread = np.linspace(begin, self.cutoff_s, count, endpoint=False)
        behind = [self.events["time"] + after for after in BEHIND]
        times = np.unique(np.concatenate([spread, *behind]))
        return [float(time) for time in times if begin < time < self.cutoff_s]

    def fly(self, times: Iterable[float], away_s: Sequence[float]) -> Iterator[Restarted]:
        """Fly with a loss at each time, for each duration.

        Args:
            times: of the loss, s, ascending.
            away_s: durations of the loss, s.
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
        """Fly by the command in force for ``span`` s, at least to the next navigation state."""
        now = round(float(vehicle.plant["time"][0]) * NANOSECONDS)
        tick = (now - self._begin_ns) // self._period_ns
        last = tick + max(1, round(span * NANOSECONDS / self._period_ns))
        while tick < last and not vehicle.plant["complete"][0]:
            tick += 1
            until = self._begin_ns + tick * self._period_ns
            advance(self._true, vehicle, until / NANOSECONDS)

    def _begin_anew(self, vehicle: VehicleArrays, away: float) -> Restarted:
        """Fly without guidance for `away` s, then with a new one to the end."""
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
        """Make a law from one state, and the reason of a failure; None if it has no plan."""
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
        """Tell whether an end is the target, by a cut-off, with all jettisons done."""
        reached = self._reached(plant)
        arrives = reached.end is End.TARGET and not reached.left_on
        return bool(plant["inserted"] == 1 and arrives)

    def _heating(self, events: NDArray[np.void]) -> float:
        """Return the largest ratio of heating to its limit at a jettison; nan without one."""
        dropped = events[events["type"] == JETTISON_DONE]
        parts = self._true.jettisons[dropped["index"]]
        hot = parts["criterion"] == HEATING_LIMIT
        ratios = dropped["heating_rate"][hot] / parts["value"][hot]
        return float(np.max(ratios, initial=-math.inf)) if hot.any() else math.nan


def _copy(vehicle: VehicleArrays) -> VehicleArrays:
    return VehicleArrays(*(array.copy() for array in vehicle))
