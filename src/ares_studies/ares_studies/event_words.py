# SPDX-License-Identifier: Apache-2.0
"""Name the events of a flight."""

from collections.abc import Sequence
from dataclasses import dataclass

from ares_models.passage import Passage
from ares_vehicle_sim import arrays as events

#: What is found in states and statuses, beside the events that the simulator tells.
MACH_1, MAX_Q, HAND_OVER = 256, 257, 258
EVENT_NAMES = {
    events.FLIGHT_STARTED: "flight started",
    events.IGNITION: "ignition",
    events.ARC_ENDED: "arc ended",
    events.STAGING: "staging",
    events.JETTISON_DONE: "jettison",
    events.CUTOFF: "main-engine cut-off",
    events.DEPLETION: "propellant depleted",
    events.FLIGHT_COMPLETE: "flight complete",
    events.IMPACT: "impact",
    events.TIME_LIMIT: "time limit",
    events.GUIDANCE_LOST: "no answer from guidance",
    events.GUIDANCE_BACK: "guidance answers again",
    events.FAILED: "failure",
    events.JETTISON_STUCK: "jettison stuck",
    events.OVER_LIMIT: "acceleration over its limit",
    MACH_1: "Mach 1",
    MAX_Q: "greatest dynamic pressure",
    HAND_OVER: "hand-over: closed-loop guidance begins",
}
#: Events marked in plots, with their labels.
MARKS = {
    events.STAGING: "staging",
    events.JETTISON_DONE: "jettison",
    events.CUTOFF: "cut-off",
    events.FAILED: "failure",
    events.JETTISON_STUCK: "stuck",
    events.OVER_LIMIT: "over limit",
    MACH_1: "Mach 1",
    MAX_Q: "max q",
    HAND_OVER: "hand-over",
}
#: Events that end the flight.
ENDS = (events.FLIGHT_COMPLETE, events.IMPACT, events.TIME_LIMIT)


def event_name(
    kind: int,
    index: int,
    arcs: Sequence[str],
    stages: Sequence[str],
    jettisons: Sequence[str],
    held_s: float,
) -> str:
    """Describe an event.

    Args:
        kind: its type.
        index: of an arc, a stage or a jettison, depending on the type.
        arcs: names of the mission's arcs.
        stages: names of its stages.
        jettisons: names of its jettisons.
        held_s: time from the first ignition to the release, where the flight begins.
    """
    lists = {
        events.IGNITION: arcs,
        events.ARC_ENDED: arcs,
        events.STAGING: stages,
        events.JETTISON_DONE: jettisons,
        events.FAILED: arcs,
        events.JETTISON_STUCK: jettisons,
        events.OVER_LIMIT: arcs,
        events.DEPLETION: stages,
    }
    name = EVENT_NAMES.get(kind, f"event {kind}")
    names = lists.get(kind, ())
    text = f"{name}: {names[index]}" if index < len(names) else name
    if kind == events.IGNITION and index == 0 and held_s > 0.0:
        return f"release, {held_s:.4g} s after {text}"
    return text


@dataclass(frozen=True)
class Moment:
    """Hold what is found in states and statuses: kind, time in s, mass in kg, and its text."""

    kind: int
    time_s: float
    mass_kg: float
    text: str


def air_moments(passage: Passage) -> list[Moment]:
    """Name Mach 1 and the greatest dynamic pressure of a climb through the air."""
    found = []
    mach_1, max_q = passage.mach_1, passage.max_q
    if mach_1 is not None:
        found.append((MACH_1, mach_1, f" at {mach_1.altitude_m / 1e3:,.1f} km"))
    if max_q is not None:
        text = f": {max_q.dynamic_pressure_pa / 1e3:,.2f} kPa at {max_q.altitude_m / 1e3:,.1f} km"
        found.append((MAX_Q, max_q, text))
    return [
        Moment(kind, state.time_s, state.mass_kg, EVENT_NAMES[kind] + text)
        for kind, state, text in found
    ]


def hand_over(time_s: float, mass_kg: float) -> Moment:
    """Name the begin of closed-loop guidance after the boost programme."""
    return Moment(HAND_OVER, time_s, mass_kg, EVENT_NAMES[HAND_OVER])
