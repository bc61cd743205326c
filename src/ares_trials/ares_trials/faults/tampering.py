# SPDX-License-Identifier: Apache-2.0
"""What can happen to messages on their way, as functions that a relay applies."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from ares_models.mission import load_mission
from ares_trials.faults.relay import Tamper

#: Acceleration that is no true one, m/s2.
DRIFT = 0.2


def lose(rng: Generator, share: float) -> Tamper:
    """A share of the messages does not arrive."""
    return lambda _now, message: [] if rng.random() < share else [(0.0, message)]


def double(rng: Generator, share: float) -> Tamper:
    """A share arrives twice."""
    return lambda _now, message: [(0.0, message)] * (1 + (rng.random() < share))


def delay(rng: Generator, share: float, longest_s: float) -> Tamper:
    """A share arrives late, by so many s of flight at most."""

    def tamper(_now: float, message: Any) -> list[tuple[float, Any]]:
        late = rng.random() < share
        return [(rng.uniform(0.01, longest_s) if late else 0.0, message)]

    return tamper


def change(changed: Callable[[float, Any], Any]) -> Tamper:
    """Each is changed; one that is not at all stays the same object."""
    return lambda now, message: [(0.0, changed(now, message))]


# ---- navigation: of a state its record, that of the last true one, the time in s since then


def not_a_number(record: Any, _last: Any, _since: float, rng: Generator) -> None:
    """One component of position or velocity."""
    record[str(rng.choice(["position", "velocity"]))][rng.integers(3)] = np.nan


def infinite(record: Any, _last: Any, _since: float, rng: Generator) -> None:
    """One component of position or velocity."""
    record[str(rng.choice(["position", "velocity"]))][rng.integers(3)] = np.inf


def zero(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """Position and velocity."""
    record["position"] = record["velocity"] = 0.0


def flipped(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """The sign of position and velocity."""
    record["position"] *= -1.0
    record["velocity"] *= -1.0


def frozen(record: Any, last: Any, _since: float, _rng: Generator) -> None:
    """Everything is what it was; the stamps go on."""
    for name in record.dtype.names:
        record[name] = last[name]


def far_off(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """50 km beside the way."""
    side = np.cross(record["position"], record["velocity"])
    record["position"] += 50e3 * side / np.linalg.norm(side)


def of_another_mission(record: Any, _last: Any, _since: float, _rng: Generator) -> None:
    """Place and speed of another vehicle, at the begin of its flight."""
    start = load_mission("saturn_v_as506").start()
    record["position"] = start.position
    record["velocity"] = start.velocity


def drifting(record: Any, _last: Any, since: float, _rng: Generator) -> None:
    """A velocity that is wrong by DRIFT more each second, and the place that follows from it."""
    along = record["velocity"] / np.linalg.norm(record["velocity"])
    record["velocity"] += DRIFT * since * along
    record["position"] += 0.5 * DRIFT * since**2 * along
