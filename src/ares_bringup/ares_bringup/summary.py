# SPDX-License-Identifier: Apache-2.0
"""Collect a flight while it flies and judge it when it is over. No ROS."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from ares_bags.errors import printable
from ares_models.arrays import (
    LONGEST_FLIGHT,
    NAMES_ASCENDING_NODE,
    NAMES_FLIGHT_PATH_ANGLE,
    NAMES_INCLINATION,
    NAMES_RADIUS,
    NAMES_SPEED,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
)
from ares_studies.event_words import ENDS, MARKS, event_name
from ares_vehicle_sim.arrays import (
    ARC_ENDED,
    CUTOFF,
    DEPLETION,
    FAILED,
    FLIGHT_STARTED,
    GUIDANCE_BACK,
    GUIDANCE_LOST,
    IGNITION,
    IMPACT,
    JETTISON_DONE,
    OVER_LIMIT,
    TIME_LIMIT,
)

if TYPE_CHECKING:
    from ares_models.impacts import Impact
    from ares_models.judge import Judgement
    from ares_models.mission import Mission
    from ares_models.orbits import Elements

#: Fraction of the flight within which neighbouring labels are merged, at the last of them.
NEAR_MARKS = 0.15

#: Exit statuses of `ares fly`.
EXIT_TARGET = 0
EXIT_NOT_AS_IT_SHOULD = 1
EXIT_CANNOT_START = 2
EXIT_INTERRUPTED = 130
#: Their meanings, after a start.
EXIT_MEANINGS = {
    EXIT_TARGET: "flown to the target",
    EXIT_NOT_AS_IT_SHOULD: "flown, but not as it should",
    EXIT_INTERRUPTED: "interrupted",
}

#: Most diagnostics kept; later ones are only counted.
MAX_DIAGNOSTICS = 200

Vector = tuple[float, float, float]


class Outcome(StrEnum):
    """Name the ways in which a flight ends."""

    TARGET = "target"
    TARGET_MISSED = "target_missed"
    DEPLETION = "depletion"
    IMPACT = "impact"
    TIME_LIMIT = "time_limit"
    INCOMPLETE = "incomplete"
    INTERRUPTED = "interrupted"


#: Outcomes in a few words.
VERDICTS = {
    Outcome.TARGET: "Flown to the target",
    Outcome.TARGET_MISSED: "Target missed",
    Outcome.DEPLETION: "Propellant ran out",
    Outcome.IMPACT: "Met the ground",
    Outcome.TIME_LIMIT: "Not over in time",
    Outcome.INCOMPLETE: "Incomplete",
    Outcome.INTERRUPTED: "Interrupted",
}


def apart(words: Mapping[float, str], span_s: float) -> list[tuple[float, str]]:
    """Merge the labels of close instants at the last of them, so that none overlap.

    Args:
        words: labels by instant, s.
        span_s: duration of the whole flight.

    Returns:
        Instants in order, each with a label that may be "".
    """
    marks = sorted(words.items())
    for k in range(len(marks) - 1):
        (at, word), (after, next_word) = marks[k : k + 2]
        if after - at < NEAR_MARKS * span_s:
            marks[k : k + 2] = [(at, ""), (after, f"{word}, {next_word}")]
    return marks


@dataclass(frozen=True)
class MissionFacts:
    """Hold the data of a mission by which its flight is described and judged.

    Attributes:
        name: short name.
        title: full name.
        mu: m3/s2.
        target: record of dtype TARGET.
        arcs: name of each arc.
        stages: name of each stage.
        jettisons: name of each jettison.
        fairing: index of the first heating jettison; None: none.
        equatorial_radius: m.
        environment: record of dtype ENVIRONMENT; None: longitude zero is unknown.
        areas: names of the areas that impacts must avoid.
    """

    name: str
    title: str
    mu: float
    target: Any
    arcs: Sequence[str] = ()
    stages: Sequence[str] = ()
    jettisons: Sequence[str] = ()
    fairing: int | None = None
    equatorial_radius: float = math.nan
    environment: Any = None
    areas: Sequence[str] = ()


def facts_of(mission: "Mission") -> MissionFacts:
    """Return the facts of a mission."""
    from ares_models.mission_target import target_record

    heating = [jettison.heating_limit_w_m2 is not None for jettison in mission.drops]
    return MissionFacts(
        name=mission.name,
        title=mission.title,
        mu=mission.environment.mu_m3_s2,
        target=target_record(mission)[0],
        arcs=mission.arc_names,
        stages=mission.stage_names,
        jettisons=mission.jettison_names,
        fairing=heating.index(True) if True in heating else None,
        equatorial_radius=mission.environment.earth.equatorial_radius_m,
        environment=None if mission.zero_longitude_deg is None else mission.environment_array()[0],
        areas=mission.area_names,
    )


@dataclass(frozen=True)
class Event:
    """Hold a flight event, as in FlightEvent: SI, ares_eci."""

    type: int
    index: int
    time: float
    position: Vector
    velocity: Vector
    mass: float


@dataclass(frozen=True)
class Diagnostic:
    """Hold a warning or an error of a node; `time` is mission elapsed time in s."""

    time: float
    node: str
    level: str
    message: str

    def __str__(self) -> str:
        """Format it as one line."""
        return printable(f"t {self.time:.2f} s  {self.level}  {self.node}: {self.message}")


@dataclass(frozen=True)
class GuidanceSample:
    """Hold the fields of GuidanceStatus that the summary uses."""

    time: float
    cycle: int
    converged: bool
    total_iterations: int
    stale_cycles: int
    law: int
    cutoff_time: float
    predicted_position: Vector
    predicted_velocity: Vector


@dataclass(frozen=True)
class OrbitState:
    """Hold the quantities by which an insertion is judged: m, m/s, degrees."""

    radius_m: float
    speed_m_s: float
    flight_path_angle_deg: float
    inclination_deg: float
    ascending_node_deg: float


def orbit_state(position: Sequence[float], velocity: Sequence[float]) -> OrbitState:
    """Compute the judged quantities of a state.

    Args:
        position: m, shape (3,).
        velocity: inertial, m/s, shape (3,).
    """
    from ares_models.orbits import Insertion

    state = Insertion.from_state(position, velocity)
    return OrbitState(
        state.radius,
        state.speed,
        math.degrees(state.flight_path_angle),
        math.degrees(state.inclination),
        math.degrees(state.ascending_node),
    )


def target_state(facts: MissionFacts, position: Sequence[float]) -> OrbitState:
    """Compute the target's quantities at a flown position; NaN where they are free.

    A Keplerian target leaves the position on the orbit free. It is evaluated at the point of the
    target orbit that is nearest in direction to the flown position.

    Args:
        facts: the mission.
        position: flown, m, shape (3,).
    """
    target = facts.target
    if int(target["kind"]) == TARGET_ELEMENTS:
        return _named_state(target)
    if int(target["kind"]) != TARGET_KEPLERIAN:
        plane = int(target["kind"]) == TARGET_RADIUS_SPEED_ANGLE_PLANE
        return OrbitState(
            float(target["radius"]),
            float(target["speed"]),
            math.degrees(float(target["flight_path_angle"])),
            math.degrees(float(target["inclination"])),
            math.degrees(float(target["ascending_node"])) if plane else math.nan,
        )
    from ares_models.orbits import Elements

    orbit = Elements(
        float(target["semi_major_axis"]),
        float(target["eccentricity"]),
        float(target["inclination"]),
        float(target["ascending_node"]),
        float(target["argument_of_perigee"]),
        true_anomaly=0.0,
    )
    perigee, forward = (vector.tolist() for vector in orbit.state(facts.mu))
    try:
        anomaly = math.atan2(_along(position, forward), _along(position, perigee))
    except (OverflowError, ValueError):
        anomaly = math.nan
    if math.isnan(anomaly):
        # overflow: no nearest point exists
        return OrbitState(*[math.nan] * len(fields(OrbitState)))
    there = replace(orbit, true_anomaly=anomaly).state(facts.mu)
    return orbit_state(there[0].tolist(), there[1].tolist())


def _named_state(target: Any) -> OrbitState:
    """Return the quantities that a target by elements fixes; NaN for the others."""
    named = int(target["named"])
    return OrbitState(
        float(target["radius"]) if named & NAMES_RADIUS else math.nan,
        float(target["speed"]) if named & NAMES_SPEED else math.nan,
        math.degrees(target["flight_path_angle"]) if named & NAMES_FLIGHT_PATH_ANGLE else math.nan,
        math.degrees(target["inclination"]) if named & NAMES_INCLINATION else math.nan,
        math.degrees(target["ascending_node"]) if named & NAMES_ASCENDING_NODE else math.nan,
    )


def _along(x: Sequence[float], axis: Sequence[float]) -> float:
    return math.fsum(a * b for a, b in zip(x, axis, strict=True)) / math.hypot(*axis)


def judgement(
    facts: MissionFacts,
    position: Sequence[float],
    velocity: Sequence[float],
    *,
    grounded: bool = False,
) -> "Judgement":
    """Judge a state.

    Args:
        facts: the mission.
        position: m, shape (3,).
        velocity: m/s, shape (3,).
        grounded: whether the vehicle has hit the ground.
    """
    from ares_models.judge import judge

    return judge(
        position, velocity, facts.target, facts.mu, facts.equatorial_radius, grounded=grounded
    )


def orbit_of(
    facts: MissionFacts, position: Sequence[float], velocity: Sequence[float]
) -> "Elements":
    """Compute the orbital elements of a state; all NaN if there is no orbit.

    Args: see :func:`judgement`.
    """
    from ares_models.orbits import Elements

    try:
        return Elements.from_state(position, velocity, facts.mu)
    except ValueError:
        return Elements(*[math.nan] * len(fields(Elements)))


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
        first_converged: first status with an accepted solution.
        last_converged: last one.
        guidance_cycles: highest cycle number seen.
        seen_from_start: no guidance cycle was missed before the first one seen.
        max_stale_cycles: most consecutive cycles without an accepted solution.
        laws: number of cycles by the law's code in GuidanceStatus.
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
    first_converged: GuidanceSample | None = None
    last_converged: GuidanceSample | None = None
    guidance_cycles: int = 0
    seen_from_start: bool = False
    max_stale_cycles: int = 0
    laws: Counter[int] = field(default_factory=Counter)
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
        return self.first(FLIGHT_STARTED) is not None

    @property
    def end(self) -> Event | None:
        """Return FLIGHT_COMPLETE, IMPACT or TIME_LIMIT; None before."""
        return next(filter(None, map(self.first, ENDS)), None)

    @property
    def t_plf_s(self) -> float | None:
        """Return the time of the fairing's heating jettison, s."""
        if self.facts.fairing is None:
            return None
        event = self.first(JETTISON_DONE, self.facts.fairing)
        return event.time if event else None

    @property
    def t_meco_s(self) -> float | None:
        """Return the time of the main-engine cut-off command, s."""
        event = self.first(CUTOFF)
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
        grounded = self.end.type == IMPACT
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
    def first_convergence_iterations(self) -> int | None:
        """Return the iterations until the first accepted solution; None if it was not seen."""
        status = self.first_converged
        return status.total_iterations if status and self.seen_from_start else None

    @property
    def unguided_s(self) -> float:
        """Return the flight time without an answer of guidance, s."""
        total, since = 0.0, None
        for event in self.events:
            if event.type == GUIDANCE_LOST and since is None:
                since = event.time
            elif since is not None and event.type in (GUIDANCE_BACK, *ENDS):
                total += event.time - since
                since = None
        return total

    # ---- the verdict

    @property
    def outcome(self) -> Outcome:
        """Return the way in which the flight ended."""
        if self.first(IMPACT):
            return Outcome.IMPACT
        if self.first(TIME_LIMIT):
            return Outcome.TIME_LIMIT
        if self.end is None:
            return Outcome.INTERRUPTED if self.interrupted else Outcome.INCOMPLETE
        if self.first(CUTOFF) is None:
            return Outcome.DEPLETION
        return Outcome.TARGET_MISSED if self.misses() else Outcome.TARGET

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
                if self.first(JETTISON_DONE, index) is None
            ]
        if over := self.first(OVER_LIMIT):
            arc = self.facts.arcs[over.index]
            lines = [*lines, f"{arc}: acceleration over its limit from {over.time:,.1f} s on"]
        if self.first(GUIDANCE_LOST):
            lines = [*lines, f"flown without an answer from guidance for {self.unguided_s:.1f} s"]
        if self.forged:
            lines = [*lines, f"somebody spoke in the name of others: {self.forged[0]}"]
        return lines + self.problems

    @property
    def _thrust_end(self) -> str:
        """Return why the thrust ended: a failed engine leaves propellant aboard."""
        last = next((e for e in reversed(self.events) if e.type in (FAILED, DEPLETION)), None)
        failed = last is not None and last.type == FAILED
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
            text += ", but not all is as it should be"
        return text

    @property
    def exit_code(self) -> int:
        """Return the exit status of `ares fly`."""
        if self.outcome is Outcome.INTERRUPTED:
            return EXIT_INTERRUPTED
        return EXIT_NOT_AS_IT_SHOULD if self.shortcomings() else EXIT_TARGET

    # ---- output

    def event_name(self, event: Event) -> str:
        """Describe an event with the mission's names."""
        facts = self.facts
        return event_name(event.type, event.index, facts.arcs, facts.stages, facts.jettisons)

    def marks(self) -> list[tuple[float, str]]:
        """Return the instants to mark in plots: mission elapsed time in s, and a label, maybe "".

        Each instant has one mark, and labels do not overlap. A coast begins where a burn ends, and
        ends where an engine ignites; a drop at the same instant takes precedence.
        """
        ignitions = {round(event.time, 3) for event in self.events if event.type == IGNITION}
        words: dict[float, str] = {}
        for event in self.events:
            if event.type in MARKS:
                words.setdefault(round(event.time, 3), MARKS[event.type])
        for event in self.events:
            if event.type == ARC_ENDED:
                at = round(event.time, 3)
                words.setdefault(at, "ignition" if at in ignitions else "coast")
        span = self.events[-1].time - self.events[0].time if words else 0.0
        return apart(words, span)

    def to_json(self) -> dict[str, Any]:
        """Return the object that `ares fly --json` prints; unknown numbers are None."""
        judged = self.judgement
        errors = judged.errors if judged else {}
        keys = dict.fromkeys(("radius_m", "speed_m_s", "flight_path_angle_deg", "inclination_deg"))
        result = {
            "mission": self.facts.name,
            "guidance": self.guidance,
            "t_plf_s": self.t_plf_s,
            "t_meco_s": self.t_meco_s,
            "m_f_kg": self.m_f_kg,
            "insertion_error": {**keys, **errors},
            "guidance_cycles": self.guidance_cycles,
            "longest_cycle_ms": self.longest_cycle_ms,
            "wall_s": self.wall_s,
            "realtime_factor": self.realtime_factor,
            "bag": self.bag,
            "flight_id": f"{self.flight_id:016x}",
            "domain_id": self.domain_id,
            "namespace": self.namespace,
            "foreign_messages": self.foreign_messages,
            "unguided_s": self.unguided_s,
            "outcome": self.outcome.value,
            "end": str(judged.end) if judged else None,
            "exit_status": self.exit_code,
            "impact": _impact(self.impact),
            "shortcomings": self.shortcomings(),
            "first_convergence_iterations": self.first_convergence_iterations,
            "max_stale_cycles": self.max_stale_cycles,
            "lost_messages": self.lost_messages,
            "events": [
                {
                    "t_s": event.time,
                    "type": event.type,
                    "index": event.index,
                    "name": self.event_name(event),
                    "mass_kg": event.mass,
                }
                for event in self.events
            ],
            "diagnostic_count": self.diagnostic_count,
            "diagnostics": [
                {
                    "t_s": line.time,
                    "node": line.node,
                    "level": line.level,
                    "message": line.message,
                }
                for line in self.diagnostics
            ],
        }
        return {key: _json_value(value) for key, value in result.items()}


def _impact(impact: "Impact | None") -> dict[str, Any] | None:
    if impact is None:
        return None
    return {
        "t_s": impact.time_s,
        "latitude_deg": impact.latitude_deg,
        "longitude_deg": impact.longitude_deg,
        "area": impact.area,
        "outside_m": impact.outside_m,
    }


def _json_value(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _json_value(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_json_value(item) for item in value]
    return value
