# SPDX-License-Identifier: Apache-2.0
"""Collect a flight while it flies and judge it when it is over. No ROS."""

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ares_bringup.facts import MissionFacts
from ares_bringup.insertion import judgement
from ares_bringup.observed import Diagnostic, Event, GuidanceSample
from ares_bringup.outcomes import (
    EXIT_INTERRUPTED,
    EXIT_NOT_AS_IT_SHOULD,
    EXIT_TARGET,
    VERDICTS,
    Outcome,
)
from ares_models.arrays import LONGEST_FLIGHT
from ares_studies.event_words import ENDS, HAND_OVER, Moment, air_moments, event_name, hand_over
from ares_vehicle_sim import arrays as codes

if TYPE_CHECKING:
    from ares_models.impacts import Impact
    from ares_models.judge import Judgement
    from ares_models.passage import Passage
    from ares_vehicle_sim.falls import Fall

#: Most diagnostics kept; later ones are only counted.
MAX_DIAGNOSTICS = 200


@dataclass
class FlightSummary:
    """Hold a flight as observed: events, guidance status, diagnostics.

    Attributes:
        facts: the mission.
        guidance: name of the law.
        bag: absolute path of the bag; None: not recorded.
        flight_id: identity of the flight.
        domain_id: ROS domain of its graph.
        namespace: namespace of its nodes, with the leading slash.
        foreign_messages: messages of other flights that the judge received and ignored.
        events: in the order of arrival.
        moments: found in states and statuses, see `timeline`.
        passage: Mach 1 and greatest dynamic pressure of the climb; None: not known.
        first_converged: first status with an accepted solution.
        last_converged: last one.
        guidance_cycles: highest cycle number seen.
        seen_from_start: no guidance cycle was missed before the first one seen.
        max_stale_cycles: most consecutive cycles without an accepted solution.
        laws: number of cycles by the law's code in GuidanceStatus.
        planned_m_f_kg: mass after the last cut-off by the plan flown; None: flown without a plan.
        boosts: in its last cycle guidance flew the attitude programme of the air.
        diagnostics: warnings and errors, the first MAX_DIAGNOSTICS of them.
        diagnostic_count: all of them.
        lost_messages: events, statuses and diagnostics that the monitor did not receive.
        problems: faults around the flight, one line each.
        forged: reports of nodes on messages whose sender is not the one they name.
        interrupted: ended by Ctrl-C or SIGTERM.
        longest_cycle_ms: wall time of the longest guidance cycle; None: unknown.
        realtime_factor: flight time over wall time, without start-up; None: unknown.
        wall_s: wall time of the whole command, s.
    """

    facts: MissionFacts
    guidance: str
    bag: str | None = None
    flight_id: int = 0
    domain_id: int = 0
    namespace: str = "/ares"
    foreign_messages: int = 0
    events: list[Event] = field(default_factory=list)
    moments: list[Moment] = field(default_factory=list)
    passage: "Passage | None" = None
    first_converged: GuidanceSample | None = None
    last_converged: GuidanceSample | None = None
    guidance_cycles: int = 0
    seen_from_start: bool = False
    max_stale_cycles: int = 0
    laws: Counter[int] = field(default_factory=Counter)
    planned_m_f_kg: float | None = None
    boosts: bool = False
    diagnostics: list[Diagnostic] = field(default_factory=list)
    diagnostic_count: int = 0
    lost_messages: int = 0
    problems: list[str] = field(default_factory=list)
    forged: list[str] = field(default_factory=list)
    interrupted: bool = False
    realtime_factor: float | None = None
    longest_cycle_ms: float | None = None
    wall_s: float = math.nan

    # ---- collecting

    def add_event(self, event: Event) -> None:
        """Add an event."""
        self.events.append(event)

    def add_status(self, status: GuidanceSample) -> None:
        """Add a guidance status; count a gap in the cycle numbers as lost messages."""
        if not self.guidance_cycles:
            self.seen_from_start = status.cycle <= 1
        elif status.cycle > self.guidance_cycles + 1:
            self.lost_messages += status.cycle - self.guidance_cycles - 1
        self.guidance_cycles = max(self.guidance_cycles, status.cycle)
        self.max_stale_cycles = max(self.max_stale_cycles, status.stale_cycles)
        self.laws[status.law] += 1
        if self.boosts and not status.boosts:
            self.moments.append(hand_over(status.time, math.nan))
        self.boosts = status.boosts
        if status.converged:
            self.first_converged = self.first_converged or status
            self.last_converged = status

    def add_diagnostic(self, diagnostic: Diagnostic) -> None:
        """Add a warning or an error."""
        self.diagnostic_count += 1
        if len(self.diagnostics) < MAX_DIAGNOSTICS:
            self.diagnostics.append(diagnostic)

    def add_forged(self, text: str) -> None:
        """Add a report on forged messages."""
        if len(self.forged) < MAX_DIAGNOSTICS:
            self.forged.append(text)

    def set_air(self, passage: "Passage") -> None:
        """Set the climb through the air, with its moments."""
        self.passage = passage
        self.moments = [moment for moment in self.moments if moment.kind == HAND_OVER]
        self.moments += air_moments(passage)

    def set_rate(self, flight_time: float, wall_time: float) -> None:
        """Set the real-time factor from an interval of flight time and wall time, s."""
        if flight_time > 0.0 and wall_time > 0.0:
            self.realtime_factor = flight_time / wall_time

    # ---- the flight

    def first(self, kind: int, index: int | None = None) -> Event | None:
        """Return the first event of a type, and of an index if one is given; None without one."""
        for event in self.events:
            if event.type == kind and index in (None, event.index):
                return event
        return None

    @property
    def started(self) -> bool:
        """Return whether the first event of the flight was received."""
        return self.first(codes.FLIGHT_STARTED) is not None

    @property
    def end(self) -> Event | None:
        """Return FLIGHT_COMPLETE, IMPACT or TIME_LIMIT; None before."""
        return next(filter(None, map(self.first, ENDS)), None)

    @property
    def t_plf_s(self) -> float | None:
        """Return the time of the fairing's heating jettison, s."""
        if self.facts.fairing is None:
            return None
        event = self.first(codes.JETTISON_DONE, self.facts.fairing)
        return event.time if event else None

    @property
    def t_meco_s(self) -> float | None:
        """Return the time of the main-engine cut-off command, s."""
        event = self.first(codes.CUTOFF)
        return event.time if event else None

    @property
    def m_f_kg(self) -> float | None:
        """Return the mass at the end of the flight, kg."""
        return self.end.mass if self.end else None

    @property
    def judgement(self) -> "Judgement | None":
        """Return the judgement of the end of the flight, tail-off included; None before."""
        if self.end is None:
            return None
        grounded = self.end.type == codes.IMPACT
        return judgement(self.facts, self.end.position, self.end.velocity, grounded=grounded)

    @property
    def insertion_error(self) -> dict[str, float]:
        """Return the errors at the end of the flight, flown minus target; empty before."""
        judged = self.judgement
        return judged.errors if judged else {}

    @property
    def impact(self) -> "Impact | None":
        """Return the impact point without drag.

        None before the end, if the vehicle stays above the ground, and if longitude zero is
        unknown.
        """
        if self.end is None or self.facts.environment is None:
            return None
        from ares_models.impacts import find_impact

        end, facts = self.end, self.facts
        return find_impact(end.position, end.velocity, end.time, facts.environment, facts.areas)

    @property
    def falls(self) -> "tuple[Fall, ...]":
        """Return the falls of what was dropped, in the mission's own air.

        Empty if longitude zero is unknown.
        """
        mission = self.facts.mission
        if mission is None or self.facts.environment is None or not self.events:
            return ()
        import numpy as np

        from ares_vehicle_sim.arrays import EVENT
        from ares_vehicle_sim.falls import find_falls

        events = np.zeros(len(self.events), EVENT)
        for name in ("type", "index", "time", "position", "velocity", "mass"):
            events[name] = [getattr(event, name) for event in self.events]
        return find_falls(mission, events)

    @property
    def first_convergence_iterations(self) -> int | None:
        """Return the iterations until the first accepted solution; None if it was not seen."""
        status = self.first_converged
        return status.total_iterations if status and self.seen_from_start else None

    @property
    def unguided_s(self) -> float:
        """Return the flight time without an answer of guidance, s."""
        total, since = 0.0, None
        for event in self.events:
            if event.type == codes.GUIDANCE_LOST and since is None:
                since = event.time
            elif since is not None and event.type in (codes.GUIDANCE_BACK, *ENDS):
                total += event.time - since
                since = None
        return total

    # ---- the verdict

    @property
    def outcome(self) -> Outcome:
        """Return the way in which the flight ended."""
        if self.first(codes.IMPACT):
            return Outcome.IMPACT
        if self.first(codes.TIME_LIMIT):
            return Outcome.TIME_LIMIT
        if self.end is None:
            return Outcome.INTERRUPTED if self.interrupted else Outcome.INCOMPLETE
        if self.first(codes.CUTOFF) is None:
            return Outcome.DEPLETION
        return Outcome.TARGET_MISSED if self.misses() else Outcome.TARGET

    @property
    def beside_plan(self) -> float | None:
        """Return the final mass over the planned one.

        None without both, where the flight did not end by its cut-off, and where a failure kept
        it from the target: such an end weighs what it did not burn.
        """
        if self.m_f_kg is None or self.planned_m_f_kg is None:
            return None
        failed = self.first(codes.FAILED) or self.first(codes.JETTISON_STUCK)
        comparable = self.outcome is Outcome.TARGET or (
            self.outcome is Outcome.TARGET_MISSED and not failed
        )
        return self.m_f_kg / self.planned_m_f_kg if comparable else None

    def misses(self) -> list[str]:
        """Describe the quantities beyond their tolerance, one text each."""
        judged = self.judgement
        return judged.misses() if judged else []

    def shortcomings(self) -> list[str]:
        """List all faults of the flight, one line each; empty for a good flight."""
        lines = {
            Outcome.TARGET: [],
            Outcome.TARGET_MISSED: ["target missed: " + "; ".join(self.misses()), *self._instead()],
            Outcome.DEPLETION: [f"{self._thrust_end} before the cut-off", *self._instead()],
            Outcome.IMPACT: ["the vehicle met the ground"],
            Outcome.TIME_LIMIT: [f"the flight was not over after {LONGEST_FLIGHT:,.0f} s"],
            Outcome.INCOMPLETE: ["the flight did not come to its end"],
            Outcome.INTERRUPTED: ["interrupted"],
        }[self.outcome]
        if lines and (impact := self.impact) is not None:
            lines = [*lines, self._fallen(impact)]
        if self.end is not None:
            lines = lines + [
                f"{name} was not jettisoned"
                for index, name in enumerate(self.facts.jettisons)
                if self.first(codes.JETTISON_DONE, index) is None
            ]
        if over := self.first(codes.OVER_LIMIT):
            arc = self.facts.arcs[over.index]
            lines = [*lines, f"{arc}: acceleration over its limit from {over.time:,.1f} s on"]
        if self.first(codes.GUIDANCE_LOST):
            lines = [*lines, f"flown without an answer from guidance for {self.unguided_s:.1f} s"]
        if self.forged:
            lines = [*lines, f"forged messages were found: {self.forged[0]}"]
        return lines + self.problems

    @property
    def _thrust_end(self) -> str:
        """Return why the thrust ended: a failed engine leaves propellant aboard."""
        last = next(
            (e for e in reversed(self.events) if e.type in (codes.FAILED, codes.DEPLETION)), None
        )
        failed = last is not None and last.type == codes.FAILED
        return "thrust ended by a failure" if failed else "propellant ran out"

    def _fallen(self, impact: "Impact") -> str:
        """Describe the impact point and its area."""
        count = len(self.facts.areas)
        if impact.area is not None:
            where = f", in {impact.area}"
        elif count:
            where = (
                f", outside all {count} areas" if count > 1 else f", outside {self.facts.areas[0]}"
            )
        else:
            where = ""
        return f"falls at {impact.place}{where}"

    def _instead(self) -> list[str]:
        """Describe the orbit reached at the end, in one line."""
        judged = self.judgement
        return [judged.reached()] if judged else []

    @property
    def verdict(self) -> str:
        """Return the outcome in a few words."""
        text = VERDICTS[self.outcome]
        if self.outcome is Outcome.DEPLETION:
            text = self._thrust_end.capitalize()
        if self.outcome is Outcome.TARGET and self.shortcomings():
            text += ", with shortcomings"
        return text

    @property
    def exit_code(self) -> int:
        """Return the exit status of `ares fly`."""
        if self.outcome is Outcome.INTERRUPTED:
            return EXIT_INTERRUPTED
        return EXIT_NOT_AS_IT_SHOULD if self.shortcomings() else EXIT_TARGET

    # ---- words

    @property
    def timeline(self) -> list[Moment]:
        """Return events and moments in the order of time, with their texts."""
        told = [Moment(e.type, e.time, e.mass, self.event_name(e)) for e in self.events]
        return sorted(told + self.moments, key=lambda moment: moment.time_s)

    def event_name(self, event: Event) -> str:
        """Describe an event with the mission's names."""
        facts = self.facts
        names = facts.arcs, facts.stages, facts.jettisons
        return event_name(event.type, event.index, *names, facts.held_s)
