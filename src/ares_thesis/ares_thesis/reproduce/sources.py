# SPDX-License-Identifier: Apache-2.0
"""Every solution and flight that the report shows, each computed once, when first asked for."""

import math
from functools import cached_property
from typing import Any

from ares_models.arrays import HEATING_LIMIT, MissionArrays
from ares_models.mission import Mission, load_mission
from ares_models.orbits import Insertion
from ares_optimizer.solution import OptimizerError, Solution
from ares_optimizer.solve import solve
from ares_studies.closed_loop import ready_law
from ares_studies.history import History, Profile, profile_of, record_flight
from ares_studies.pages.parts import number
from ares_thesis.analytic.flight import FittedPiece, PlanarFlight, fit_flight, planar_flight
from ares_thesis.analytic.options import AnalyticOptions
from ares_thesis.analytic.solve import AnalyticSolution, solve_analytic
from ares_thesis.pins import PinnedFlight, WrongThrust, pin_study, wrong_thrust_study
from ares_thesis.reproduce import printed
from ares_thesis.transients import (
    WITH_TRANSIENTS,
    TransientRow,
    mass_after_full_flow,
    transient_study,
)
from ares_vehicle_sim.simulator import Simulator

MISSION = "ares_v"

#: Rows of the study of the pins that sentences quote.
ALL_PINS = "peg_thesis: all pins, one pass a cycle"
PLANE_FREE = "plane free until the jettison"
SETTLED = "all pins, every cycle converged"


class Sources:
    """The thesis' mission, solved and flown.

    A solution that does not converge raises OptimizerError with its reason: a report with a
    failed result in it would be worth nothing.
    """

    @cached_property
    def mission(self) -> Mission:
        """Tables 2.1 and 2.2 as the mission file has them."""
        return load_mission(MISSION)

    @cached_property
    def arrays(self) -> MissionArrays:
        """The same for kernels."""
        return self.mission.arrays()

    @cached_property
    def start(self) -> Insertion:
        """Radius, speed and angles of the initial state."""
        start = self.mission.start()
        return Insertion.from_state(start.position, start.velocity)

    @cached_property
    def staging_s(self) -> float:
        """Mission elapsed time of the staging."""
        return self.mission.ignition_times()[1]

    @cached_property
    def heating_limit_w_m2(self) -> float:
        """Heating at which the fairing may go."""
        jettisons = self.arrays.jettisons
        return float(jettisons["value"][jettisons["criterion"] == HEATING_LIMIT][0])

    def _solved(self, mission: Mission, method: str, **options: object) -> Solution:
        solution = solve(mission, method, **options)  # type: ignore[arg-type]
        if not solution.converged:
            raise OptimizerError(f"{method} on {mission.name}: {solution.reason}")
        return solution

    @cached_property
    def optimum(self) -> Solution:
        """The thesis' optimum: 11 parameters."""
        return self._solved(self.mission, "direct11")

    @cached_property
    def optimum14(self) -> Solution:
        """14 parameters."""
        return self._solved(self.mission, "direct14")

    @cached_property
    def optimum20(self) -> Solution:
        """20 parameters."""
        return self._solved(self.mission, "direct20")

    @cached_property
    def jump(self) -> Solution:
        """The steering rate after the jettison from the jump condition."""
        return self._solved(self.mission, "jump")

    @cached_property
    def indirect(self) -> Solution:
        """The two-point problem: free control."""
        return self._solved(self.mission, "indirect")

    @cached_property
    def held(self) -> Solution:
        """The optimum with the jettison at the thesis' time."""
        at = printed.values("table-4.1")["thesis"]["jettison_s"]
        return self._solved(self.mission, "direct11", jettison_times={0: at})

    @cached_property
    def unheated(self) -> Solution:
        """The optimum with the heating ignored: the most that Table 2.2 can lift."""
        return self._solved(self.mission, "direct11", heating="ignored")

    @cached_property
    def spherical(self) -> Solution:
        """The optimum with altitudes above a sphere."""
        environment = self.mission.environment.model_copy(update={"altitude": "spherical"})
        mission = self.mission.model_copy(update={"environment": environment})
        return self._solved(mission, "direct11")

    @cached_property
    def with_transients(self) -> Solution:
        """The optimum with start and stop transients."""
        return self._solved(self.transients_mission, "direct11")

    @cached_property
    def transients_mission(self) -> Mission:
        """The mission with tail-off, separation coast and engine start."""
        return load_mission(WITH_TRANSIENTS)

    @cached_property
    def transients_profile(self) -> Profile:
        """Columns of the optimum with start and stop transients."""
        return profile_of(self.transients_mission, self.with_transients)

    @cached_property
    def transient_rows(self) -> dict[str, TransientRow]:
        """What each transient costs, up to OTIS' cut-off time, by name."""
        otis = printed.values("table-4.1")["otis"]["cutoff_s"]
        return {row.name: row for row in transient_study(otis)}

    @cached_property
    def planar_optimum(self) -> PlanarFlight:
        """The optimum in its plane."""
        return planar_flight(self.optimum)

    @cached_property
    def fits(self) -> tuple[FittedPiece, ...]:
        """The polynomials of chapter 5 fitted to the optimum, piece by piece."""
        return fit_flight(self.planar_optimum, self.staging_s, self.optimum.t_plf_s)

    def analytic(self, **options: object) -> AnalyticSolution:
        """The analytic solution, from the jettison state of the optimum unless told otherwise."""
        asked = {"jettison_target": "optimizer"} | options
        found = solve_analytic(
            self.mission,
            AnalyticOptions(**asked),  # type: ignore[arg-type]
            optimum=self.optimum,
        )
        if found.part_one is None or found.part_two is None or found.flight is None:
            raise OptimizerError(f"analytic with {asked}: {found.solution.reason}")
        return found

    @cached_property
    def analytic_printed(self) -> AnalyticSolution:
        """As Table 6.2 has it: the printed polynomials, a trapezoid of 100 and 100 steps."""
        steps = tuple(printed.values("table-6.3")[0]["steps"])
        return self.analytic(profile="thesis", position_integral="trapezoid", steps=steps)

    @cached_property
    def analytic_exact(self) -> AnalyticSolution:
        """The printed polynomials, position in closed form."""
        return self.analytic(profile="thesis", position_integral="exact")

    @cached_property
    def analytic_improved(self) -> AnalyticSolution:
        """The better polynomials."""
        return self.analytic(profile="improved")

    @cached_property
    def analytic_alone(self) -> AnalyticSolution:
        """The better polynomials, the jettison state from the mission instead of the optimum."""
        return self.analytic(profile="improved", jettison_target="mission")

    @cached_property
    def optimum_profile(self) -> Profile:
        """Columns of the optimum."""
        return profile_of(self.mission, self.optimum)

    @cached_property
    def optimum14_profile(self) -> Profile:
        """Columns of the optimum with 14 parameters."""
        return profile_of(self.mission, self.optimum14)

    @cached_property
    def optimum20_profile(self) -> Profile:
        """Columns of the optimum with 20 parameters."""
        return profile_of(self.mission, self.optimum20)

    @cached_property
    def held_profile(self) -> Profile:
        """Columns of the optimum with the jettison at the thesis' time."""
        return profile_of(self.mission, self.held)

    @cached_property
    def peg(self) -> History:
        """Multi-stage PEG, closed loop, from the navigation state alone."""
        return record_flight(self.mission, ready_law(self.mission))

    @cached_property
    def peg_printed(self) -> History:
        """PEG as the thesis flew it, by modes, from the analytic solution."""
        return record_flight(self.mission, ready_law(self.mission, "peg_thesis"))

    def first_solution(self, guess: Solution | None = None) -> int:
        """Iterations in which multi-stage PEG finds its first solution.

        Args:
            guess: where it starts; None: from the navigation state alone.
        """
        law = ready_law(self.mission, guess=guess)
        law.step(Simulator(self.mission).navigation)
        return int(law.state["iterations"])

    @cached_property
    def pins(self) -> dict[str, PinnedFlight]:
        """What each pin of the thesis' PEG costs, by name."""
        return {row.name: row for row in pin_study(self.mission)}

    @cached_property
    def wrong_thrust(self) -> list[WrongThrust]:
        """The same with engines that give more or less than guidance foresees."""
        return wrong_thrust_study(mission=self.mission)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Numbers that sentences quote, by the name in their braces."""
        table = printed.values("table-4.1")
        otis = table["otis"]
        peg = printed.values("table-6.7")
        full_otis = mass_after_full_flow(self.mission, otis["cutoff_s"])
        full_peg = mass_after_full_flow(self.mission, peg["cutoff_s"])
        part_one = self.analytic_printed.part_one
        assert part_one is not None
        partials = part_one.partials_m_per_deg
        return {
            "start_gamma_deg": math.degrees(self.start.flight_path_angle),
            "start_inclination_deg": math.degrees(self.start.inclination),
            "gain_held_kg": self.held.m_f_kg - table["thesis"]["final_mass_kg"],
            "otis_full_flow_kg": full_otis,
            "otis_gap_kg": full_otis - otis["final_mass_kg"],
            "peg_full_flow_kg": full_peg,
            "peg_gap_kg": full_peg - peg["final_mass_kg"],
            "partial_theta": number(partials["theta_end"], 0).text,
            "partial_gamma": number(partials["gamma_joint"], 0).text,
            "pinned_kg": self.pins[ALL_PINS].cost_kg,
            "plane_kg": self.pins[ALL_PINS].cost_kg - self.pins[PLANE_FREE].cost_kg,
            "settled_kg": self.pins[SETTLED].cost_kg,
            "low_thrust_kg": self.wrong_thrust[0].free_kg - self.wrong_thrust[0].pinned_kg,
            "jump_loss_kg": self.indirect.m_f_kg - self.jump.m_f_kg,
        }
