# SPDX-License-Identifier: Apache-2.0
"""How low a plan goes, and whether it may: nothing is flown into the ground by a plan."""

import math
from typing import TYPE_CHECKING

from ares_guidance.kernels.floor import lowest_altitude
from ares_models.arrays import COAST, MissionArrays

if TYPE_CHECKING:
    from ares_guidance.guess import OfflineTrajectory

#: How far a sample may be from the begin or the end of its arc, s.
SAME_TIME = 0.01
#: Lowest altitude of a flight, m.
GROUND = 0.0


def _lowest(trajectory: "OfflineTrajectory", arrays: MissionArrays) -> list[tuple[int, float]]:
    """Index and lowest altitude, m, of each arc that a trajectory flies."""
    return [
        (
            int(k),
            lowest_altitude(
                begin - SAME_TIME,
                float(end),
                bool(arrays.arcs["kind"][k] == COAST),
                trajectory.sample_time,
                trajectory.sample_position,
                trajectory.sample_velocity,
                arrays.environment,
            ),
        )
        for k, begin, end in zip(
            trajectory.flown_arc,
            trajectory.flown_start_time,
            trajectory.flown_end_time,
            strict=True,
        )
    ]


def lowest_coast(trajectory: "OfflineTrajectory", arrays: MissionArrays) -> float:
    """Lowest altitude of the coasts of a trajectory, m; inf: it has none.

    Args:
        trajectory: of this mission.
        arrays: the mission.
    """
    coasts = [at for k, at in _lowest(trajectory, arrays) if arrays.arcs["kind"][k] == COAST]
    return min(coasts, default=math.inf)


def check_floor(trajectory: "OfflineTrajectory", arrays: MissionArrays) -> None:
    """See that a trajectory stays above the ground.

    Args:
        trajectory: of this mission.
        arrays: the mission.

    Raises:
        ValueError: it does not; one line.
    """
    k, lowest = min(_lowest(trajectory, arrays), key=lambda arc: arc[1])
    if lowest < GROUND:
        kind = "coast" if arrays.arcs["kind"][k] == COAST else "burn"
        raise ValueError(
            f"arc {k}, a {kind}, goes through the ground, {GROUND - lowest:,.0f} m deep"
        )
