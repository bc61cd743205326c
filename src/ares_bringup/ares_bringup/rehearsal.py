# SPDX-License-Identifier: Apache-2.0
"""Fly a mission ahead, before the nodes start, to check that its law reaches the target."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from ares_bringup.facts import facts_of
from ares_bringup.insertion import judgement
from ares_bringup.options import PEG, CannotStart, refusal

if TYPE_CHECKING:
    from ares_guidance.settings import LawSettings
    from ares_models.mission import Mission
    from ares_optimizer.solution import Solution
    from ares_vehicle_sim.simulator import SimulatorOptions

#: Propellant of the last burn, kg, below which the burns before it give too much.
_SPARE_KG = 1.0
#: Relative loss of final mass against the plan above which a note is returned.
TOLERATED = 3e-3


@dataclass(frozen=True)
class _Rehearsal:
    """Hold the inputs common to all laws.

    Attributes:
        mission: flown mission.
        plan: the optimizer's plan for its free quantities.
        options: integration of the plant.
        settings: cycle and gates of the law.
        arc: last one of the last stage with a free burn, at whose end laws differ in mass.
    """

    mission: "Mission"
    plan: "Solution"
    options: "SimulatorOptions"
    settings: "LawSettings"
    arc: int

    @property
    def ends_before(self) -> bool:
        """Return whether arcs follow the one at whose end masses are compared."""
        return self.arc != self.plan.flown[-1].arc

    @property
    def planned_kg(self) -> float:
        """Return the mass at the end of the arc by the plan."""
        return self.plan.end_mass_kg(self.arc)

    @property
    def least_kg(self) -> float:
        """Return the mass there below which a law does not count as one that flies the mission."""
        return 0.0 if self.mission.needs_plan else self.planned_kg * (1.0 - TOLERATED)


@dataclass(frozen=True)
class _End:
    """Hold the end of a flight.

    Attributes:
        missed: quantities beyond their tolerance.
        mass_kg: at the end of the arc of the rehearsal; 0 if the target is missed.
        most_pa: greatest dynamic pressure; nan: not known.
    """

    missed: str
    mass_kg: float = 0.0
    most_pa: float = math.nan


def rehearse(flown: Mapping[str, Any]) -> str:
    """Check that a law can fly a mission; fly it ahead, without dispersions, if it is by a plan.

    Args:
        flown: parameters of guidance and simulator by name, as far as given.

    Returns:
        The expected loss of mass and an implausible dynamic pressure, one line; "" if there is
        neither, or no plan.

    Raises:
        CannotStart: no plan is found, or the law does not reach the target by it, or asks for it
            and loses mass; one line.
    """
    from ares_models.mission import load_mission
    from ares_models.mission_warnings import pressure_warning

    name = str(flown.get("mission", "ares_v"))
    mission = load_mission(name)
    law = str(flown.get("law", PEG))
    if not (mission.needs_plan or asks_for_plan(mission, law)):
        return ""
    try:
        rehearsal = _prepare(mission, law, flown)
    except ValueError as error:
        raise refusal(error, mission, name) from error
    try:
        if not mission.needs_plan:
            _check_start(rehearsal, law)
        end = _fly_ahead(rehearsal, law)
    except ValueError as error:
        said = mission.with_names(str(error))
        raise CannotStart(f"{said}{_surplus(rehearsal.plan)}") from error
    if not end.mass_kg:
        raise CannotStart(
            f"law is {law!r}, which misses the target when the mission is flown ahead "
            f"({end.missed}); {_advice(rehearsal, law)}"
        )
    doubt = pressure_warning(mission, end.most_pa)
    plan_kg = rehearsal.planned_kg
    lost = 1.0 - end.mass_kg / plan_kg
    if lost <= TOLERATED:
        return doubt
    ends = f"end arc {rehearsal.arc}" if rehearsal.ends_before else "end"
    loss = mission.with_names(
        f"expected to {ends} with {end.mass_kg:,.1f} kg, {100.0 * lost:.2f} % less than "
        f"the plan's {plan_kg:,.1f} kg"
    )
    if end.mass_kg < rehearsal.least_kg:
        raise CannotStart(f"law is {law!r}, which is {loss}; {_advice(rehearsal, law)}")
    return "; ".join(filter(None, (f"law {law} is {loss}", doubt)))


def asks_for_plan(mission: "Mission", law: str) -> bool:
    """Return whether a law flies a mission by a plan only because it finds no steering without.

    Raises:
        CannotStart: the law cannot fly it; one line.
    """
    from ares_guidance import laws

    try:
        return laws.asks_for_plan(law, mission.arrays(foreseen=True), mission.start().navigation())
    except ValueError as error:
        raise refusal(error, mission) from error


def _prepare(mission: "Mission", law: str, flown: Mapping[str, Any]) -> _Rehearsal:
    """Solve for the plan.

    Raises:
        ValueError: there is none, or the law cannot fly such a mission; one line.
    """
    from ares_guidance.laws import find_law, make_law
    from ares_guidance.settings import LawSettings
    from ares_optimizer.plan import saving_stage
    from ares_studies.closed_loop import plan_solution
    from ares_vehicle_sim.simulator import SimulatorOptions

    known = {
        kind: {item.name: flown[item.name] for item in fields(kind) if item.name in flown}
        for kind in (SimulatorOptions, LawSettings)
    }
    limit = float(flown.get("attitude_rate_limit_deg_s", 0.0))
    if limit > 0.0:
        known[SimulatorOptions]["attitude_rate_limit_rad_s"] = math.radians(limit)
    settings = LawSettings(**known[LawSettings])
    # what it cannot fly is told before the search for a plan
    make_law(law, mission.arrays(foreseen=True), settings)
    plan = plan_solution(mission, find_law(law), time_limit_s=flown.get("plan_timeout_s"))
    arrays = mission.arrays()
    saving = saving_stage(arrays, mission.start().navigation()[0])
    stages = arrays.arcs["stage"].tolist()
    arc = max(k for k, stage in enumerate(stages) if stage == saving or saving < 0)
    return _Rehearsal(
        mission,
        plan,
        SimulatorOptions(**known[SimulatorOptions]),
        settings,
        arc,
    )


def _check_start(rehearsal: _Rehearsal, law: str) -> None:
    """Check that a law finds a way by the plan that it asked for.

    Raises:
        ValueError: it finds none; one line, which names the laws that do.
    """
    from ares_guidance.laws import check_law
    from ares_guidance.plan import plan_of
    from ares_studies.closed_loop import offline_trajectory

    arrays = rehearsal.mission.arrays(foreseen=True)
    plan = plan_of(offline_trajectory(rehearsal.plan), arrays)
    check_law(law, arrays, rehearsal.mission.start().navigation(), plan)


def _fly_ahead(rehearsal: _Rehearsal, law: str) -> _End:
    """Fly a law to its end.

    Raises:
        ValueError: it cannot fly such a mission; one line.
    """
    from ares_models.judge import End
    from ares_studies.closed_loop import fly_stepwise, ready_law
    from ares_vehicle_sim.arrays import ARC_ENDED, DEPLETION
    from ares_vehicle_sim.simulator import CommandRefused

    ready = ready_law(rehearsal.mission, law, rehearsal.settings, rehearsal.plan)
    try:
        flight = fly_stepwise(rehearsal.mission, rehearsal.options, law=ready)
    except CommandRefused as error:
        return _End(f"the vehicle refuses its command {error}")
    plant = flight.plant
    judged = judgement(facts_of(rehearsal.mission), plant["position"], plant["velocity"])
    mass_kg, arc = float(plant["mass"]), rehearsal.arc
    ends = [(ARC_ENDED, arc), (DEPLETION, rehearsal.mission.arrays().arcs["stage"][arc])]
    for event in flight.events if rehearsal.ends_before else ():
        # a stage that is dropped has what it saves until then
        if (event["type"], event["index"]) in ends:
            mass_kg = float(event["mass"])
    if judged.end is not End.TARGET:
        mass_kg = 0.0
    return _End("; ".join(judged.misses()), mass_kg, float(plant["most_dynamic_pressure"]))


def _surplus(plan: "Solution") -> str:
    """Return the cause and a remedy if the burns before the last one reach the target; else ""."""
    if plan.last_burn_kg > _SPARE_KG:
        return ""
    return (
        ": the burns of fixed length reach the target without the last one, which leaves it no "
        "time to correct the flight; give it a longer least length (min_s), or add payload"
    )


def _advice(rehearsal: _Rehearsal, law: str) -> str:
    """Name the other self-starting laws that reach the target."""
    from ares_guidance.laws import self_starting_laws

    others = [name for name in self_starting_laws() if name != law]
    ways = []
    for name in others:
        with suppress(ValueError):
            if _fly_ahead(rehearsal, name).mass_kg > rehearsal.least_kg:
                ways.append(name)
    if ways:
        return f"try law {' or '.join(ways)}"
    return f"no other law reaches it{_surplus(rehearsal.plan)}"
