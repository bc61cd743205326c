# SPDX-License-Identifier: Apache-2.0
"""Measure the cost of each pin of the thesis' PEG (section 6.4, Figs. 6.14, 6.16, 6.17)."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ares_guidance.law import Law
from ares_guidance.settings import LawSettings
from ares_models.mission import Mission, load_mission
from ares_models.orbits import Insertion
from ares_optimizer.solution import Solution
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, offline_trajectory, ready_law
from ares_thesis.peg.law import Pins, ThesisPeg
from ares_thesis.peg.plan import JettisonPlan
from ares_vehicle_sim.arrays import CUTOFF, JETTISON_DONE, STAGING
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.simulator import Simulator

#: Iterate every cycle to convergence, as multi-stage PEG does.
CONVERGED = LawSettings(passes_per_cycle=100, settled_below_m_s=0.1)
#: Table 6.8: jettison time of the thesis' optimum, s.
THESIS_JETTISON_S = 441.02
#: Table 6.6, m/s.
THESIS_DELTA_V = (4076.3, 562.0, 1970.7)
#: Half-width of the interval around staging in which the predicted jettison is observed, s.
WATCHED = 20.0


@dataclass(frozen=True)
class PinnedFlight:
    """Hold one flight of the study, or an optimum.

    Attributes:
        name: pins and settings, in words.
        m_f_kg: final mass.
        t_plf_s: fairing jettison.
        t_f_s: cut-off.
        cost_kg: final mass below the optimum's.
        heating_w_m2: at the jettison.
        jitter_s: range of the predicted jettison within 20 s of staging; nan for an optimum, which
            predicts nothing.
        inclination_deg: at the jettison; nan for an optimum.
        node_shift_deg: ascending node at the jettison minus at staging; nan for an optimum.
    """

    name: str
    m_f_kg: float
    t_plf_s: float
    t_f_s: float
    cost_kg: float
    heating_w_m2: float
    jitter_s: float = math.nan
    inclination_deg: float = math.nan
    node_shift_deg: float = math.nan


def pin_study(mission: Mission | None = None) -> list[PinnedFlight]:
    """Fly the thesis' PEG with its pins, without each of them, and the laws compared with it.

    Args:
        mission: two stages, one heating jettison in the second; default: `ares_v`.

    Raises:
        ValueError: another mission, or one that cannot be solved.
    """
    mission = mission or load_mission("ares_v")
    optimum = _solved(mission, "direct11")
    held = _solved(mission, "direct11", {0: THESIS_JETTISON_S})
    plan = _plan(_solved(mission, "analytic"))
    best = _plan(optimum)
    printed = replace(plan, delta_v_m_s=THESIS_DELTA_V)
    one_pass = LawSettings()

    def thesis(
        plan: JettisonPlan, settings: LawSettings = one_pass, pins: Pins | None = None
    ) -> Callable[[], Law]:
        def make() -> Law:
            law = ThesisPeg(mission.arrays(foreseen=True), settings, pins)
            law.follow(plan)
            return law

        return make

    flights = {
        "peg_thesis: all pins, one pass a cycle": thesis(plan),
        "plane not taken anew at staging": thesis(plan, pins=Pins("flight")),
        "plane free until the jettison": thesis(plan, pins=Pins("free")),
        "jettison state of the optimum": thesis(best),
        "steering held for the last 10 s only": thesis(
            plan, LawSettings(jettison_hold_time_s=10.0)
        ),
        "no new mode at staging": thesis(plan, pins=Pins(split_at_staging=False)),
        "first guess from Table 6.6": thesis(printed),
        "all pins, every cycle converged": thesis(plan, CONVERGED),
        "converged, plane free": thesis(plan, CONVERGED, Pins("free")),
        "converged, jettison state of the optimum": thesis(best, CONVERGED),
        f"converged, jettison state of the optimum at {THESIS_JETTISON_S} s": thesis(
            _plan(held), CONVERGED
        ),
        "multi-stage PEG: no pins": lambda: Law(mission.arrays(foreseen=True)),
    }
    rows = [
        _optimum("optimum", optimum, optimum),
        _optimum(f"optimum, jettison held at {THESIS_JETTISON_S} s", held, optimum),
    ]
    return rows + [_flown(name, mission, make, optimum) for name, make in flights.items()]


@dataclass(frozen=True)
class WrongThrust:
    """Hold final masses with the same thrust error in both stages.

    Attributes:
        error: fraction of the mission's thrust.
        pinned_kg: final mass of peg_thesis.
        converged_kg: the same with every cycle converged.
        free_kg: final mass of multi-stage PEG.
    """

    error: float
    pinned_kg: float
    converged_kg: float
    free_kg: float


def wrong_thrust_study(
    errors: tuple[float, ...] = (-0.02, -0.01, 0.01, 0.02), mission: Mission | None = None
) -> list[WrongThrust]:
    """Measure the cost of the pins when the thrust differs from guidance's.

    Args:
        errors: fractions of the mission's thrust, of both stages.
        mission: see :func:`pin_study`.
    """
    mission = mission or load_mission("ares_v")
    rows = []
    for error in errors:
        dispersions = Dispersions.model_validate({"thrust": {"mean": error}})
        masses = [
            float(fly_compiled(mission, dispersions=dispersions, law=law).plant["mass"])
            for law in ("peg_thesis", ready_law(mission, "peg_thesis", CONVERGED), "peg")
        ]
        rows.append(WrongThrust(error, *masses))
    return rows


def _solved(
    mission: Mission, method: str, jettison_times: dict[int, float] | None = None
) -> Solution:
    solution = solve(mission, method, jettison_times=jettison_times)
    if not solution.converged:
        raise ValueError(f"{method} on {mission.name}: {solution.reason}")
    return solution


def _plan(solution: Solution) -> JettisonPlan:
    return JettisonPlan.from_trajectory(offline_trajectory(solution))


def _optimum(name: str, solution: Solution, best: Solution) -> PinnedFlight:
    track = solution.trajectory
    dropped = np.argmin(np.abs(track.time_s - solution.t_plf_s)) if track else 0
    return PinnedFlight(
        name,
        solution.m_f_kg,
        solution.t_plf_s,
        solution.t_meco_s,
        best.m_f_kg - solution.m_f_kg,
        float(track.heating_rate[dropped]) if track else math.nan,
    )


def _flown(name: str, mission: Mission, make: Callable[[], Law], optimum: Solution) -> PinnedFlight:
    flight = fly_compiled(mission, law=make())

    def event(kind: int) -> Any:
        return flight.events[flight.events["type"] == kind][0]

    dropped = event(JETTISON_DONE)
    planes = [
        Insertion.from_state(at["position"], at["velocity"]) for at in (event(STAGING), dropped)
    ]
    mass = float(flight.plant["mass"])
    return PinnedFlight(
        name,
        mass,
        float(dropped["time"]),
        float(event(CUTOFF)["time"]),
        optimum.m_f_kg - mass,
        float(dropped["heating_rate"]),
        _jitter(mission, make(), float(event(STAGING)["time"])),
        math.degrees(planes[1].inclination),
        math.degrees(planes[1].ascending_node - planes[0].ascending_node),
    )


def _jitter(mission: Mission, law: Law, staging: float) -> float:
    """Compute the range of the predicted jettison around staging, s."""
    simulator = Simulator(mission)
    predicted = []
    while simulator.navigation["time"] < staging + WATCHED:
        law.step(simulator.navigation)
        if simulator.navigation["time"] > staging - WATCHED:
            predicted.append(float(law.steering[0]["jettison_time"]))
        simulator.command(law.steering)
        simulator.advance()
    return float(np.ptp(predicted))
