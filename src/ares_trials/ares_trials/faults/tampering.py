# SPDX-License-Identifier: Apache-2.0
"""Tamper with messages, as functions for a relay."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from ares_models.mission import load_mission
from ares_trials.faults.relay import Tamper

#: False acceleration, m/s2.
DRIFT = 0.2


def lose(rng: Generator, share: float) -> Tamper:
    """Lose a fraction of the messages."""
    return lambda _now, message: [] if rng.random() < share else [(0.0, message)]


def double(rng: Generator, share: float) -> Tamper:
    """Deliver a fraction of the messages twice."""
    return lambda _now, message: [(0.0, message)] * (1 + (rng.random() < share))


def delay(rng: Generator, share: float, longest_s: float) -> Tamper:
    """Delay a fraction of the messages, by up to `longest_s` of flight time."""

    def tamper(_now: float, message: Any) -> list[tuple[float, Any]]:
        late = rng.random() < share
        return [(rng.uniform(0.01, longest_s) if late else 0.0, message)]

    return tamper


def change(changed: Callable[[float, Any], Any]) -> Tamper:
    """Change each message; return the same object to leave one as it is."""
    return lambda now, message: [(0.0, changed(now, message))]


# ---- navigation; arguments: record of a state, last true record, time in s since then, generator


def not_a_number(record: Any, _last: Any, _since: float, rng: Generator) -> None:
    """Set one component of position or velocity to NaN."""
    record[str(rng.choice(["position", "velocity"]))][rng.integers(3)] = np.nan


def infinite(record: Any, _last: Any, _since: float, rng: Generator) -> None:
    """Set one component of position or velocity to infinity."""
    record[str(rng.choice(["position", "velocity"]))][rng.integers(3)] = np.inf


def zero(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """Set position and velocity to zero."""
    record["position"] = record["velocity"] = 0.0


def flipped(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """Reverse position and velocity."""
    record["position"] *= -1.0
    record["velocity"] *= -1.0


def frozen(record: Any, last: Any, _since: float, _rng: Generator) -> None:
    """Repeat the last true record under advancing stamps."""
    for name in record.dtype.names:
        record[name] = last[name]


def far_off(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """Move the position by 50 km."""
    side = np.cross(record["position"], record["velocity"])
    record["position"] += 50e3 * side / np.linalg.norm(side)


def of_another_mission(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """Replace position and velocity by those of another mission's start."""
    start = load_mission("saturn_v_as506").start()
    record["position"] = start.position
    record["velocity"] = start.velocity


def drifting(record: Any, _last: Any, since: float, _rng: Generator) -> None:
    """Add a velocity error that grows by DRIFT, and its integral to the position."""
    along = record["velocity"] / np.linalg.norm(record["velocity"])
    record["velocity"] += DRIFT * since * along
    record["position"] += 0.5 * DRIFT * since**2 * along
