# SPDX-License-Identifier: Apache-2.0
"""From the arrays that Python hands over to the records that kernels work on.

A record does not keep its array alive: only who was handed the arrays makes records of them.
"""

from ares_models.arrays import MissionArrays, MissionRecords
from ares_models.jit import inlined


@inlined
def mission_records(mission: MissionArrays) -> MissionRecords:
    """Records of a mission."""
    return MissionRecords(
        mission.environment[0],
        mission.atmosphere,
        mission.arcs,
        mission.jettisons,
        mission.target[0],
    )
