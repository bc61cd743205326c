# SPDX-License-Identifier: Apache-2.0
"""Masses of a mission, by stage with all above it or by item, and their balance.

In the form by item every mass is given once: dry mass, propellant and residuals of each stage,
jettisons, adapter and payload; ignition masses follow.
"""

from typing import TYPE_CHECKING

from ares_models.mission_arcs import BurnArc
from ares_models.mission_keys import fail

if TYPE_CHECKING:
    from ares_models.mission import Mission

# relative tolerance of the mass balance, for rounded values in files
_MASS_ROUNDING = 1e-6
#: Largest excess of what fixed burns take over the propellant that a file rounds, relative.
PROPELLANT_ROUNDING = 5e-4

_LOADS = ("payload_kg", "adapter_kg")
_ITEMS = ("dry_mass_kg", "residuals_kg")


def check_mass_forms(mission: "Mission") -> None:
    """Report masses that are given in both forms or in neither.

    Raises:
        PydanticCustomError: a key is missing or excess.
    """
    whole = [i for i, stage in enumerate(mission.stages) if stage.ignition_mass_kg is not None]
    if whole:
        _check_no_items(mission, f"no such key beside stages[{whole[0]}].ignition_mass_kg")
        for i in range(len(mission.stages)):
            if i not in whole:
                fail(("stages", i, "ignition_mass_kg"), None, "a number in kg")
        return
    if mission.payload_kg is None and not any(stage.given(_ITEMS) for stage in mission.stages):
        fail(
            ("stages", 0, "ignition_mass_kg"),
            None,
            "a number in kg, or masses by item: dry_mass_kg and propellant_kg of each stage, "
            "payload_kg",
        )
    if mission.payload_kg is None:
        fail(("payload_kg",), None, "a number in kg, because no stage has an ignition_mass_kg")
    for i, stage in enumerate(mission.stages):
        for key in ("dry_mass_kg", "propellant_kg"):
            if getattr(stage, key) is None:
                fail(("stages", i, key), None, "a number in kg, because masses are by item")


def _check_no_items(mission: "Mission", expected: str) -> None:
    mission.refuse(_LOADS, expected)
    for i, stage in enumerate(mission.stages):
        stage.refuse(_ITEMS, expected, ("stages", i))


def ignition_mass(mission: "Mission", stage: int) -> float:
    """Return the mass of a stage and everything above it at its start, kg."""
    part = mission.stages[stage]
    if part.ignition_mass_kg is not None:
        return part.ignition_mass_kg
    if stage + 1 < len(mission.stages):
        above = ignition_mass(mission, stage + 1)
    else:
        above = sum(getattr(mission, key) or 0.0 for key in _LOADS)
    items = (part.dry_mass_kg, part.propellant_kg, part.residuals_kg)
    own = sum(item or 0.0 for item in items) + part.booster_propellant_kg
    return own + mission.jettison_mass(stage) + above


def check_masses(mission: "Mission") -> None:
    """Check the mass balance of each stage: propellant, jettisons and the stages above.

    Raises:
        PydanticCustomError: it does not close.
    """
    stages = mission.stages
    for i, stage in enumerate(stages):
        whole = mission.ignition_mass(i)
        own = mission.jettison_mass(i)
        aboard = sum(mission.jettison_mass(k) for k in range(i, len(stages)))
        if aboard >= whole:
            expected = f"more than the {aboard:,.6g} kg of jettisons that it contains"
            fail(("stages", i, "ignition_mass_kg"), whole, expected)
        after = mission.ignition_mass(i + 1) if i + 1 < len(stages) else 0.0
        room = whole - own - after - stage.booster_propellant_kg
        slack = _MASS_ROUNDING * whole
        if after and room <= 0.0:
            below = f"{whole - own:,.9g} kg of stage {stage.name} without its jettisons"
            fail(("stages", i + 1, "ignition_mass_kg"), after, f"less than the {below}")
        if stage.propellant_kg is not None and stage.propellant_kg >= room + slack:
            expected = f"at most the {room:,.9g} kg that the stage can lose"
            fail(("stages", i, "propellant_kg"), stage.propellant_kg, expected)
        used = mission.fixed_propellant(i) - stage.booster_propellant_kg
        usable = room if stage.propellant_kg is None else stage.propellant_kg
        rounded = 0.0 if stage.propellant_kg is None else PROPELLANT_ROUNDING * usable
        if used > usable + max(slack, rounded):
            k = max(
                (k for k, arc in enumerate(stage.flight_arcs) if isinstance(arc, BurnArc)),
                key=lambda k: -1 if stage.flight_arcs[k].free else k,
            )
            arc = stage.flight_arcs[k]
            table = arc.thrust_table if isinstance(arc, BurnArc) else None
            if table is not None and stage.propellant_kg is not None:
                fail(
                    ("stages", i, "propellant_kg"),
                    stage.propellant_kg,
                    f"at least the {used:,.9g} kg that the fixed burns of stage {stage.name} take "
                    "by thrust_table and isp_s",
                )
            fail(
                ("stages", i, *stage.arc_path(k, "thrust_table" if table else "burn_time_s")),
                table or arc.duration_s,
                f"burns that take at most {usable:,.9g} kg; the fixed burns of stage "
                f"{stage.name} take {used:,.9g} kg",
            )
