# SPDX-License-Identifier: Apache-2.0
"""Define a request of the optimizer: method, mission, start."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MISSION_TIME, NAVIGATION, MissionArrays
from ares_models.mission import Mission
from ares_models.tolerances import ROUNDING_M
from ares_optimizer.deadline import Deadline
from ares_optimizer.solution import OptimizerError

#: Upper bounds of a start: s, m, m/s, kg; beyond any flight, far below overflow.
MOST = {
    "time": 1e9,
    "arc_start_time": 1e9,
    "position": 1e12,
    "velocity": 3e8,
    "mass": 1e12,
}


class Heating(StrEnum):
    """Select where the heating limit of a jettison holds."""

    AT_JETTISON = "at_jettison"
    FROM_JETTISON = "from_jettison"
    #: nowhere: the drop is at the ignition of its stage
    IGNORED = "ignored"
    #: at the jettison, which waits for it, without a jump of the costates
    PASSIVE = "passive"


@dataclass(frozen=True)
class Request:
    """Hold one request of the optimizer.

    Attributes:
        arrays: the mission.
        state: start, shape (1,), dtype NAVIGATION.
        method: one of `registry.method_names`.
        guess: first guess in the form of the method; None: its built-in guesses.
        heating: where the heating limit holds.
        deadline: time limit.
        verify: fly the solution again.
        parts: solutions of ascents and of rests alone, by the bytes of their mission and start:
            like missions have the same ones.
    """

    arrays: MissionArrays
    state: NDArray[np.void]
    method: str
    heating: Heating
    deadline: Deadline
    guess: Any = None
    verify: bool = True
    parts: dict[bytes, Any] = field(default_factory=dict, compare=False)


def hold_jettisons(arrays: MissionArrays, times: Mapping[int, float]) -> MissionArrays:
    """Return the mission with some jettisons at given times, without heating limits.

    Args:
        arrays: the mission.
        times: mission elapsed time in s, by index of the jettison.

    Raises:
        OptimizerError: no such jettison, or a time that is not finite.
    """
    jettisons = arrays.jettisons.copy()
    for j, at in times.items():
        if not 0 <= j < len(jettisons):
            raise OptimizerError(
                f"jettison {j} does not exist; the mission has {len(jettisons)}, counted from 0"
            )
        if not math.isfinite(at):
            raise OptimizerError(f"jettison {j} is held at {at} s; expected a finite time")
        jettisons[j]["criterion"] = MISSION_TIME
        jettisons[j]["value"] = at
    return arrays._replace(jettisons=jettisons)


def check_state(arrays: MissionArrays, state: NDArray[np.void]) -> None:
    """Refuse a start from which no flight can be computed.

    Raises:
        OptimizerError: one line with the field, its value and what was expected.
    """
    if state.dtype != NAVIGATION or state.shape != (1,):
        raise OptimizerError(
            f"state has shape {state.shape}; expected one record of dtype NAVIGATION, shape (1,)"
        )
    row = state[0]
    for name, most in MOST.items():
        if not np.all(np.isfinite(row[name])):
            raise OptimizerError(f"state.{name} is {row[name]}; expected finite numbers")
        if np.any(np.abs(row[name]) > most):
            raise OptimizerError(f"state.{name} is {row[name]}; expected {most:g} at most")
    if not 0 <= row["arc"] < len(arrays.arcs):
        raise OptimizerError(
            f"state.arc is {row['arc']}; expected 0 to {len(arrays.arcs) - 1}, as the mission has"
        )
    if row["mass"] <= 0.0:
        raise OptimizerError(f"state.mass is {row['mass']:g} kg; expected more than 0")
    radius = float(np.linalg.norm(row["position"]))
    ground = float(arrays.environment[0]["polar_radius"])
    # a vehicle on its pad may be below by rounding
    if radius < ground - ROUNDING_M:
        raise OptimizerError(
            f"state.position is {radius:,.0f} m from the Earth's centre; expected at least "
            f"{ground:,.0f} m"
        )


def arrays_and_state(
    mission: Mission | MissionArrays, state: NDArray[np.void] | None
) -> tuple[MissionArrays, NDArray[np.void]]:
    """Return a mission as arrays, and a checked start: the given state or its own.

    Raises:
        OptimizerError: no start, or an invalid one.
    """
    if isinstance(mission, Mission):
        arrays = mission.arrays()
        state = mission.start().navigation() if state is None else state
    else:
        arrays = mission
    if state is None:
        raise OptimizerError("state is missing; a mission given as arrays has no start of its own")
    check_state(arrays, state)
    return arrays, state
