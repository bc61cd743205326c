# SPDX-License-Identifier: Apache-2.0
"""List the failures of a mission: what can fail at which second."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN
from ares_models.failures import Failure, FailureKind
from ares_models.mission import Mission
from ares_models.plans import flies_in_air
from ares_optimizer.foreknown import begin_times, burning_at

#: Remaining fractions of thrust.
LOW_THRUST = (0.9, 0.7)


@dataclass(frozen=True)
class FailureRow:
    """Hold one failure at all its possible times.

    Attributes:
        name: for people.
        failures: in the order of `at_s`.
        at_s: times: of the failure, or of the ignition or drop that does not occur.
    """

    name: str
    failures: tuple[Failure, ...]
    at_s: tuple[float, ...]


def _engine_rows(arcs: NDArray[np.void], burning: Sequence[tuple[float, int]]) -> list[FailureRow]:
    """List the failures of burning engines, at times in s with the arc that burns then."""
    engines = [int(count) for count in arcs["engines"]]

    def row(name: str, failures: list[Failure]) -> FailureRow:
        return FailureRow(name, tuple(failures), tuple(f.time_s for f in failures))

    lost = [
        Failure(FailureKind.ENGINE_OUT, t, thrust_ratio=(engines[k] - 1) / engines[k])
        for t, k in burning
        if engines[k] > 1
    ]
    rows = [row("one engine lost", lost)]
    for ratio in LOW_THRUST:
        for name, flow in (("flow as before", 1.0), ("flow too", ratio)):
            low = [
                Failure(FailureKind.THRUST_LOW, t, thrust_ratio=ratio, flow_ratio=flow)
                for t, _ in burning
            ]
            rows.append(row(f"thrust at {100 * ratio:.0f} %, {name}", low))
    early = [Failure(FailureKind.EARLY_SHUTDOWN, t) for t, _ in burning]
    throttled = np.isfinite(arcs["max_acceleration"])
    stuck = [Failure(FailureKind.STUCK_THROTTLE, t) for t, k in burning if throttled[k]]
    return [*rows, row("shut down early", early), row("throttle stuck", stuck)]


def failure_rows(
    mission: Mission, cutoff_s: float, drops_s: tuple[float, ...], step_s: float
) -> tuple[FailureRow, ...]:
    """List the possible failures.

    Args:
        mission: only its last arc is free.
        cutoff_s: of the flight without failure.
        drops_s: of its jettisons; nan for one that does not occur.
        step_s: interval between failure times, s.

    Raises:
        UnfitMethod: the mission has other free arcs.
    """
    arrays = mission.arrays()
    start_s = mission.start().time_s
    # of a flight from the pad the lift-off itself
    earliest = start_s / step_s
    first = math.ceil(earliest) if flies_in_air(arrays.arcs) else math.floor(earliest) + 1
    last = math.ceil(cutoff_s / step_s) - 1
    burning = [
        (float(t), burning_at(arrays, start_s, float(t)))
        for t in step_s * np.arange(first, last + 1)
    ]
    rows = _engine_rows(arrays.arcs, [(t, k) for t, k in burning if k >= 0])
    begins = begin_times(arrays, start_s)
    kinds = arrays.arcs["kind"]
    lit = [k for k in range(1, len(kinds)) if kinds[k] == BURN and _is_lit(arrays.arcs, k)]
    rows.append(
        FailureRow(
            "ignition failed",
            tuple(Failure(FailureKind.FAILED_IGNITION, arc=k) for k in lit),
            tuple(float(begins[k]) for k in lit),
        )
    )
    dropped = [j for j, at in enumerate(drops_s) if math.isfinite(at)]
    rows.append(
        FailureRow(
            "jettison stuck",
            tuple(Failure(FailureKind.STUCK_JETTISON, jettison=j) for j in dropped),
            tuple(drops_s[j] for j in dropped),
        )
    )
    return tuple(found for found in rows if found.failures)


def _is_lit(arcs: np.ndarray, k: int) -> bool:
    """Tell whether burn `k` begins with an ignition, not as a continuation of its stage's burn."""
    before = arcs[k - 1]
    return bool(before["kind"] != BURN or before["stage"] != arcs[k]["stage"])
