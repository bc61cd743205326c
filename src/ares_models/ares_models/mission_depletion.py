# SPDX-License-Identifier: Apache-2.0
"""Give burns to depletion their length, by the propellant of their stage."""

from typing import Any

from pydantic import ValidationError

from ares_models.input_file import KeyPath
from ares_models.mission_arcs import BurnArc
from ares_models.mission_keys import DEPLETION, fail
from ares_models.mission_parts import EnvironmentPart

#: Length of a burn while its propellant over its length is found, s.
_LONG_S = 1e5

_INSTEAD = "a time in s or free"


def end_at_depletion(data: Any) -> Any:
    """Return the content of a mission file with a number for each ``burn_time_s: depletion``.

    What is wrong with other keys is left for the checks that follow.

    Args:
        data: content of the file.

    Raises:
        PydanticCustomError: the length does not follow from the propellant.
    """
    if not isinstance(data, dict) or not isinstance(data.get("stages"), list):
        return data
    environment = data.get("environment")
    g0 = environment.get("g0_m_s2") if isinstance(environment, dict) else None
    if not isinstance(g0, float):
        g0 = EnvironmentPart.model_fields["g0_m_s2"].default
    stages = [
        _ended(("stages", i), stage, g0) if isinstance(stage, dict) else stage
        for i, stage in enumerate(data["stages"])
    ]
    return data | {"stages": stages}


def _ended(path: KeyPath, stage: dict[str, Any], g0: float) -> dict[str, Any]:
    """Return a stage in which the burn to depletion has a length, s."""
    arcs = stage.get("arcs")
    if not isinstance(arcs, list):
        arcs = []
    parts = [part if isinstance(part, dict) else {} for part in arcs] or [stage]
    ends = [part.get("burn_time_s") for part in parts]
    if DEPLETION not in ends:
        return stage
    k = ends.index(DEPLETION)
    place = (*path, "arcs", k, "burn_time_s") if arcs else (*path, "burn_time_s")
    if ends.count(DEPLETION) > 1 or "free" in ends:
        fail(place, DEPLETION, f"{_INSTEAD}: another burn of the stage takes what it leaves")
    if any(part.get("max_acceleration_m_s2") is not None for part in parts):
        fail(place, DEPLETION, f"{_INSTEAD}, in a stage with max_acceleration_m_s2")
    if stage.get("propellant_kg") is None:
        fail(place, DEPLETION, f"{_INSTEAD}: the stage has no propellant_kg")
    try:
        propellant = float(stage["propellant_kg"])
        burns = {n: _burn(part) for n, part in enumerate(parts) if "coast_s" not in part}
        flow = burns[k].mass_flow(g0)
        left = propellant - sum(burn.propellant(g0, 0.0) for burn in burns.values())
        length = _LONG_S + left / flow
    except (ValidationError, TypeError, ValueError):
        # the checks that follow tell what is wrong
        length = 1.0
    if length <= 0.0:
        least = propellant - length * flow
        fail((*path, "propellant_kg"), propellant, f"more than the {least:,.9g} kg of other burns")
    ended = parts[k] | {"burn_time_s": length}
    return stage | ({"arcs": [*arcs[:k], ended, *arcs[k + 1 :]]} if arcs else ended)


def _burn(part: dict[str, Any]) -> BurnArc:
    """Return a burn by its own keys, with a length for now if it ends at depletion."""
    keys = {key: part[key] for key in BurnArc.model_fields if key in part}
    if keys.get("burn_time_s") == DEPLETION:
        keys["burn_time_s"] = _LONG_S
    return BurnArc.model_validate(keys)
