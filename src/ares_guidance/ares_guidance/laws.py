"""Every guidance law by its name, and how it is told of a trajectory found off line."""

import math

import numpy as np

from ares_guidance.arrays import LAW_PEG_THESIS
from ares_guidance.guess import OfflineTrajectory
from ares_guidance.law import CODES, Law, LawSettings
from ares_guidance.peg_thesis import ThesisPeg
from ares_models.arrays import HEATING_LIMIT, MissionArrays

#: The law that starts from an off-line trajectory only.
PEG_THESIS = "peg_thesis"

#: What the node's parameter `law` may be, and the code of GuidanceStatus for it.
LAWS = {**CODES, PEG_THESIS: LAW_PEG_THESIS}


def make_law(name: str, arrays: MissionArrays, settings: LawSettings | None = None) -> Law:
    """A law, ready for the first navigation state.

    Args:
        name: one of LAWS.
        arrays: the mission as guidance believes it.
        settings: cycle and gates.

    Raises:
        ValueError: no such law, or one that cannot fly this mission.
    """
    if name not in LAWS:
        raise ValueError(f"law is {name!r}; expected one of {', '.join(LAWS)}")
    if name == PEG_THESIS:
        return ThesisPeg(arrays, settings)
    return Law(arrays, settings, name)


def start_from(law: Law, trajectory: OfflineTrajectory, arrays: MissionArrays) -> None:
    """Tell a law of a trajectory, as much of it as the law takes.

    Args:
        law: before its first navigation state.
        trajectory: from where the flight is.
        arrays: the mission of the law.

    Raises:
        ValueError: the trajectory is no start.
    """
    if isinstance(law, ThesisPeg):
        law.follow(trajectory.jettison_plan())
        return
    planned = np.full(len(arrays.jettisons), math.inf)
    if math.isfinite(trajectory.jettison_time):
        planned[arrays.jettisons["criterion"] == HEATING_LIMIT] = trajectory.jettison_time
    law.seed(trajectory.velocity_to_go(), planned)
