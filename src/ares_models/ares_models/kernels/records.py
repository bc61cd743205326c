# SPDX-License-Identifier: Apache-2.0
"""Conversion of the arrays of Python callers to the records of kernels.

A record does not keep its array alive: convert only in a kernel that Python has called with the
arrays.
"""

from ares_models.arrays import MissionArrays, MissionRecords
from ares_models.jit import inlined


@inlined
def mission_records(mission: MissionArrays) -> MissionRecords:
    """Return the records of a mission."""
    return MissionRecords(
        mission.environment[0],
        mission.atmosphere,
        mission.arcs,
        mission.jettisons,
        mission.target[0],
    )
