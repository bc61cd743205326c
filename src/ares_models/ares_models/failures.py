# SPDX-License-Identifier: Apache-2.0
"""Failures in flight, for the simulator and for an optimizer that foresees them.

A burn here is all consecutive arcs of a stage without a coast between them: an engine cut-off or a
shift of the mixture ratio does not end it. Weakened engines stay weak in all remaining burns of
their stage. Boosters that burn beside them burn on.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

from ares_models.arrays import BURN
from ares_models.mission import Mission

#: Least and greatest ratio of thrust and mass flow, after a failure over before.
RATIOS = (0.01, 2.0)


class FailureError(ValueError):
    """Report an impossible failure; the text is one line."""


class FailureKind(StrEnum):
    """Name the kinds of failure and the vehicle's own reaction.

    Attributes:
        ENGINE_OUT: from `time_s` on thrust and mass flow are multiplied by `thrust_ratio`; the
            burn lasts until depletion, and an arc of fixed length until it has burnt its
            planned propellant.
        THRUST_LOW: from `time_s` on thrust is multiplied by `thrust_ratio` and mass flow by
            `flow_ratio`.
        EARLY_SHUTDOWN: the burn ends at `time_s`. The next arc begins at once, and remaining
            propellant is dropped with the stage; after the last burn there is no more thrust.
        FAILED_IGNITION: burn `arc` never ignites; the next arc begins at its planned ignition.
        STUCK_THROTTLE: from `time_s` on the throttle of the burn does not move.
        STUCK_JETTISON: `jettison` is never dropped.
    """

    ENGINE_OUT = "engine_out"
    THRUST_LOW = "thrust_low"
    EARLY_SHUTDOWN = "early_shutdown"
    FAILED_IGNITION = "failed_ignition"
    STUCK_THROTTLE = "stuck_throttle"
    STUCK_JETTISON = "stuck_jettison"


@dataclass(frozen=True)
class Failure:
    """Hold the failure of a flight.

    Attributes:
        kind: of the failure.
        time_s: mission elapsed time of the failure; nan if the kind has none.
        arc: index of the burn that does not ignite; -1 if the kind has none.
        jettison: index of the stuck jettison; -1 if the kind has none.
        thrust_ratio: thrust after over thrust before.
        flow_ratio: mass flow after over mass flow before.
    """

    kind: FailureKind
    time_s: float = math.nan
    arc: int = -1
    jettison: int = -1
    thrust_ratio: float = 1.0
    flow_ratio: float = 1.0


#: Keys of a failure's text by kind, each with its field of Failure.
_TIME = {"time": "time_s"}
KEYS: dict[FailureKind, dict[str, str]] = {
    FailureKind.ENGINE_OUT: _TIME | {"thrust_ratio": "thrust_ratio"},
    FailureKind.THRUST_LOW: _TIME | {"thrust_ratio": "thrust_ratio", "flow_ratio": "flow_ratio"},
    FailureKind.EARLY_SHUTDOWN: _TIME,
    FailureKind.FAILED_IGNITION: {"arc": "arc"},
    FailureKind.STUCK_THROTTLE: _TIME,
    FailureKind.STUCK_JETTISON: {"jettison": "jettison"},
}


def read_failure(text: str) -> Failure:
    """Parse the text KIND:KEY=NUMBER,... such as engine_out:time=200,thrust_ratio=0.8.

    Raises:
        FailureError: naming the wrong part and the expected one.
    """
    word, _, rest = text.partition(":")
    if word not in list(FailureKind):
        raise FailureError(f"failure is {word!r}; expected {', '.join(FailureKind)}")
    kind = FailureKind(word)
    keys = KEYS[kind]
    given: dict[str, float] = {}
    for item in filter(None, rest.split(",")):
        key, _, value = item.partition("=")
        if key not in keys or keys[key] in given:
            once = " once" if key in keys else ""
            raise FailureError(f"failure {kind}: {key!r}; expected {', '.join(keys)}{once}")
        try:
            given[keys[key]] = int(value) if keys[key] in ("arc", "jettison") else float(value)
        except ValueError:
            raise FailureError(f"failure {kind}: {key} is {value!r}; expected a number") from None
    for key, name in keys.items():
        if name not in given and not name.endswith("_ratio"):
            raise FailureError(f"failure {kind}: {key} is missing; expected a number")
    return Failure(kind, **given)  # type: ignore[arg-type]


def check_failure(failure: Failure, mission: Mission) -> None:
    """Check that a failure can happen in a mission.

    Raises:
        FailureError: naming the wrong value and the expected one.
    """
    kind = failure.kind
    begins = mission.initial_state.time_s
    if "time" in KEYS[kind] and not begins <= failure.time_s < math.inf:
        raise FailureError(
            f"failure {kind}: time is {failure.time_s}; expected from {begins:g} s, where the "
            "mission begins"
        )
    low, high = RATIOS
    highest = 1.0 if kind is FailureKind.ENGINE_OUT else high
    for name in ("thrust_ratio", "flow_ratio"):
        value = getattr(failure, name)
        if not low <= value <= highest:
            raise FailureError(
                f"failure {kind}: {name} is {value}; expected {low:g} to {highest:g}"
            )
    if "thrust_ratio" in KEYS[kind] and failure.thrust_ratio == failure.flow_ratio == 1.0:
        keys = " or ".join(key for key in KEYS[kind] if key != "time")
        raise FailureError(f"failure {kind}: nothing fails; expected {keys} other than 1")
    arcs = mission.arrays().arcs
    kinds = arcs["kind"]
    if kind is FailureKind.STUCK_THROTTLE and not any(map(math.isfinite, arcs["max_acceleration"])):
        raise FailureError(
            f"failure {kind}: nothing fails; expected a mission with a burn that is throttled "
            "(max_acceleration_m_s2)"
        )
    if kind is FailureKind.FAILED_IGNITION and not (
        0 <= failure.arc < len(kinds) and kinds[failure.arc] == BURN
    ):
        burns = ", ".join(str(k) for k, arc in enumerate(kinds) if arc == BURN)
        raise FailureError(f"failure {kind}: arc is {failure.arc}; expected a burn: {burns}")
    if kind is FailureKind.STUCK_JETTISON and not 0 <= failure.jettison < len(mission.drops):
        last = len(mission.drops) - 1
        raise FailureError(
            f"failure {kind}: jettison is {failure.jettison}; "
            + (f"expected 0 to {last}" if mission.drops else "the mission has none")
        )
