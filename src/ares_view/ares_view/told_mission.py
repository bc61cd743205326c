# SPDX-License-Identifier: Apache-2.0
"""The mission of a flight, as its simulator tells it."""

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
    """Read the mission that a simulator flies: from the text of its file, else by a shipped name.

    What comes over the graph opens no file.

    Args:
        simulator: its word.

    Raises:
        MissionError: it tells no mission, or a wrong one; one line.
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
