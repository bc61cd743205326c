# SPDX-License-Identifier: Apache-2.0
"""A flight flown ahead, before a node starts: does its law reach the target by the plan? No ROS."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from ares_bringup.options import PEG, CannotStart

if TYPE_CHECKING:
    from ares_guidance.law import LawSettings
    from ares_models.mission import Mission
    from ares_optimizer.solution import Solution
    from ares_vehicle_sim.simulator import SimulatorOptions

#: Part of the plan's final mass that a law may lose without a word.
TOLERATED = 3e-3


@dataclass(frozen=True)
class _Stage:
    """What every law is tried with.

    Attributes:
        mission: what is flown.
        plan: of what the mission leaves free.
        options: how the plant is stepped.
        settings: cycle and gates of the law.
    """

    mission: "Mission"
    plan: "Solution"
    options: "SimulatorOptions"
    settings: "LawSettings"


@dataclass(frozen=True)
class _End:
    """What a law comes to.

    Attributes:
        word: of the judge, or why the law does not fly at all.
        mass_kg: at cut-off; 0 where the target is not reached.
    """

    word: str
    mass_kg: float = 0.0


def rehearse(flown: Mapping[str, Any]) -> str:
    """Fly a mission that needs a plan ahead, undisturbed.

    Args:
        flown: parameters of guidance and simulator by name, as far as given.

    Returns:
        what the law is expected to lose, in a line; empty: next to nothing, or there is no plan
        to lose of.

    Raises:
        CannotStart: no plan is found, or the law does not reach the target by it; one line.
    """
    from ares_models.mission import load_mission

    mission = load_mission(str(flown.get("mission", "ares_v")))
    if not mission.needs_plan:
        return ""
    law = str(flown.get("law", PEG))
    stage = _stage(mission, law, flown)
    end = _fly_ahead(stage, law)
    if end.mass_kg >= stage.plan.m_f_kg * (1.0 - TOLERATED):
        return ""
    others = _others(stage, law)
    if not end.mass_kg:
        ways = [other for other in others if others[other].mass_kg]
        advice = f"; try law {' or '.join(ways)}" if ways else ", nor does any other law"
        raise CannotStart(
            f"guidance is {law!r}; expected a law that reaches the target by the plan: flown "
            f"ahead, this one ends {end.word}{advice}"
        )
    best = max(others, key=lambda other: others[other].mass_kg)
    line = f"law {law} is expected to lose {_lost(stage, end)} of the plan's final mass"
    if others[best].mass_kg > end.mass_kg:
        line += f", law {best} {_lost(stage, others[best])}"
    return line


def _stage(mission: "Mission", law: str, flown: Mapping[str, Any]) -> _Stage:
    """Find the plan.

    Raises:
        CannotStart: there is none; one line.
    """
    from ares_guidance.law import LawSettings
    from ares_guidance.laws import find_law
    from ares_studies.closed_loop import plan_solution
    from ares_vehicle_sim.simulator import SimulatorOptions

    known = {
        kind: {item.name: flown[item.name] for item in fields(kind) if item.name in flown}
        for kind in (SimulatorOptions, LawSettings)
    }
    limit = float(flown.get("attitude_rate_limit_deg_s", 0.0))
    if limit > 0.0:
        known[SimulatorOptions]["attitude_rate_limit_rad_s"] = math.radians(limit)
    try:
        plan = plan_solution(mission, find_law(law))
    except ValueError as error:
        raise CannotStart(str(error)) from error
    return _Stage(
        mission,
        plan,
        SimulatorOptions(**known[SimulatorOptions]),
        LawSettings(**known[LawSettings]),
    )


def _fly_ahead(stage: _Stage, law: str) -> _End:
    from ares_models.judge import End, judge
    from ares_studies.closed_loop import fly_compiled, ready_law

    try:
        ready = ready_law(stage.mission, law, stage.settings, stage.plan)
        plant = fly_compiled(stage.mission, stage.options, law=ready).plant
    except ValueError as error:
        return _End(f"at once: {error}")
    arrays = stage.mission.arrays()
    end = judge(
        plant["position"],
        plant["velocity"],
        arrays.target[0],
        float(arrays.environment[0]["mu"]),
        float(arrays.environment[0]["equatorial_radius"]),
    ).end
    return _End(end.replace("_", " "), float(plant["mass"]) if end is End.TARGET else 0.0)


def _others(stage: _Stage, law: str) -> dict[str, _End]:
    """What the other laws come to, of those that start by themselves."""
    from ares_guidance.laws import self_starting_laws

    return {name: _fly_ahead(stage, name) for name in self_starting_laws() if name != law}


def _lost(stage: _Stage, end: _End) -> str:
    return f"{100.0 * (1.0 - end.mass_kg / stage.plan.m_f_kg):.2f} %"
