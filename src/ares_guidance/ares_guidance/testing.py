"""Made-up navigation states for tests; nothing else uses this module."""

from typing import Any

from ares_models.kernels.environment import heating_rate
from ares_models.kernels.vectors import load
from ares_models.mission import Mission


def first_navigation(mission: Mission, **changes: Any) -> Any:
    """The navigation state at the mission's start, record NAVIGATION.

    Args:
        mission: what is flown.
        changes: fields to write over it.
    """
    start = mission.start()
    arrays = mission.arrays()
    nav = start.navigation()
    nav["heating_rate"] = heating_rate(
        load(start.position), load(start.velocity), arrays.environment[0], arrays.atmosphere
    )
    for name, value in changes.items():
        nav[name] = value
    return nav[0]
