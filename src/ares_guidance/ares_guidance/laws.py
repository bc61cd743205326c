"""Every guidance law by its name."""

from ares_guidance.law import CODES, Law, LawSettings
from ares_models.arrays import MissionArrays

#: What the node's parameter `law` may be, and the code of GuidanceStatus for it.
LAWS = {**CODES}


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
    return Law(arrays, settings, name)
