# SPDX-License-Identifier: Apache-2.0
"""Read the mission that a simulator announces."""

import json

from ares_models.mission import (
    MISSION_TEXT,
    Mission,
    MissionError,
    list_missions,
    load_mission,
    parse_mission,
)
from ares_msgs.msg import FlightMember


def told_mission(simulator: FlightMember) -> Mission:
    """Read the announced mission: from the text of its file, else by the name of a shipped one.

    No name from the graph opens another file.

    Args:
        simulator: announcement.

    Raises:
        MissionError: the announcement has no valid mission; one line.
    """
    try:
        settings = json.loads(simulator.settings or "{}")
    except (ValueError, RecursionError):
        settings = None
    text = settings.get(MISSION_TEXT) if isinstance(settings, dict) else None
    if isinstance(text, str) and text:
        return parse_mission(text, f"mission {simulator.mission}")
    if simulator.mission in list_missions():
        return load_mission(simulator.mission)
    raise MissionError(
        f"mission {simulator.mission}", ["is not among those here, and the flight tells no more"]
    )
