# SPDX-License-Identifier: Apache-2.0
"""Name the events of a flight."""

from collections.abc import Sequence

from ares_vehicle_sim.arrays import (
    ARC_ENDED,
    CUTOFF,
    DEPLETION,
    FAILED,
    FLIGHT_COMPLETE,
    FLIGHT_STARTED,
    GUIDANCE_BACK,
    GUIDANCE_LOST,
    IGNITION,
    IMPACT,
    JETTISON_DONE,
    JETTISON_STUCK,
    OVER_LIMIT,
    STAGING,
    TIME_LIMIT,
)

EVENT_NAMES = {
    FLIGHT_STARTED: "flight started",
    IGNITION: "ignition",
    ARC_ENDED: "arc ended",
    STAGING: "staging",
    JETTISON_DONE: "jettison",
    CUTOFF: "main-engine cut-off",
    DEPLETION: "propellant depleted",
    FLIGHT_COMPLETE: "flight complete",
    IMPACT: "impact",
    TIME_LIMIT: "time limit",
    GUIDANCE_LOST: "no answer from guidance",
    GUIDANCE_BACK: "guidance answers again",
    FAILED: "failure",
    JETTISON_STUCK: "jettison stuck",
    OVER_LIMIT: "acceleration over its limit",
}
#: Events marked in plots, with their labels.
MARKS = {
    STAGING: "staging",
    JETTISON_DONE: "jettison",
    CUTOFF: "cut-off",
    FAILED: "failure",
    JETTISON_STUCK: "stuck",
    OVER_LIMIT: "over limit",
}
#: Events that end the flight.
ENDS = (FLIGHT_COMPLETE, IMPACT, TIME_LIMIT)


def event_name(
    kind: int, index: int, arcs: Sequence[str], stages: Sequence[str], jettisons: Sequence[str]
) -> str:
    """Describe an event.

    Args:
        kind: its type.
        index: of an arc, a stage or a jettison, depending on the type.
        arcs: names of the mission's arcs.
        stages: names of its stages.
        jettisons: names of its jettisons.
    """
    lists = {
        IGNITION: arcs,
        ARC_ENDED: arcs,
        STAGING: stages,
        JETTISON_DONE: jettisons,
        FAILED: arcs,
        JETTISON_STUCK: jettisons,
        OVER_LIMIT: arcs,
        DEPLETION: stages,
    }
    name = EVENT_NAMES.get(kind, f"event {kind}")
    names = lists.get(kind, ())
    return f"{name}: {names[index]}" if index < len(names) else name
