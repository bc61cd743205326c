# SPDX-License-Identifier: Apache-2.0
"""Compute every solution and flight of the report once, on first use."""

import math
from functools import cached_property
from typing import Any

from ares_models.arrays import HEATING_LIMIT, MissionArrays
from ares_models.mission import Mission, load_mission
from ares_models.orbits import Insertion
from ares_optimizer.solution import OptimizerError, Solution
from ares_optimizer.solve import solve
from ares_studies.closed_loop import ready_law
from ares_studies.pages.parts import number
from ares_thesis.analytic.flight import FittedPiece, PlanarFlight, fit_flight, planar_flight
from ares_thesis.analytic.options import AnalyticOptions
from ares_thesis.analytic.solve import AnalyticSolution, solve_analytic
from ares_thesis.history import FlightHistory, History, profile_of, record_flight
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

#: Rows of the pin study quoted in sentences.
ALL_PINS = "peg_thesis: all pins, one pass a cycle"
PLANE_FREE = "plane free until the jettison"
SETTLED = "all pins, every cycle converged"


class Sources:
    """Solve and fly the thesis' mission.

    A solution that does not converge raises OptimizerError with its reason: a report with a failed
    result would be worthless.
    """

    @cached_property
    def mission(self) -> Mission:
        """Return the mission of Tables 2.1 and 2.2."""
        return load_mission(MISSION)

    @cached_property
    def arrays(self) -> MissionArrays:
        """Return the mission for kernels."""
        return self.mission.arrays()

    @cached_property
    def start(self) -> Insertion:
        """Return radius, speed and angles of the initial state."""
        start = self.mission.start()
        return Insertion.from_state(start.position, start.velocity)

    @cached_property
    def staging_s(self) -> float:
        """Return the mission elapsed time of the staging."""
        return self.mission.ignition_times()[1]

    @cached_property
    def heating_limit_w_m2(self) -> float:
        """Return the heating limit of the fairing jettison."""
        jettisons = self.arrays.jettisons
        return float(jettisons["value"][jettisons["criterion"] == HEATING_LIMIT][0])

    def _solved(self, mission: Mission, method: str, **options: object) -> Solution:
        solution = solve(mission, method, **options)  # type: ignore[arg-type]
        if not solution.converged:
            raise OptimizerError(f"{method} on {mission.name}: {solution.reason}")
        return solution

    @cached_property
    def optimum(self) -> Solution:
        """Return the thesis' optimum: 11 parameters."""
        return self._solved(self.mission, "direct11")

    @cached_property
    def optimum14(self) -> Solution:
        """Return the optimum of 14 parameters."""
        return self._solved(self.mission, "direct14")

    @cached_property
    def optimum20(self) -> Solution:
        """Return the optimum of 20 parameters."""
        return self._solved(self.mission, "direct20")

    @cached_property
    def jump(self) -> Solution:
        """Return the solution with the steering rate after the jettison from the jump condition."""
        return self._solved(self.mission, "jump")

    @cached_property
    def indirect(self) -> Solution:
        """Return the solution of the two-point problem: free control."""
        return self._solved(self.mission, "indirect")

    @cached_property
    def held(self) -> Solution:
        """Return the optimum with the jettison at the thesis' time."""
        at = printed.values("table-4.1")["thesis"]["jettison_s"]
        return self._solved(self.mission, "direct11", jettison_times={0: at})

    @cached_property
    def unheated(self) -> Solution:
        """Return the optimum without heating limit: the largest mass that Table 2.2 allows."""
        return self._solved(self.mission, "direct11", heating="ignored")

    @cached_property
    def spherical(self) -> Solution:
        """Return the optimum with altitudes above a sphere."""
        environment = self.mission.environment.model_copy(update={"altitude": "spherical"})
        mission = self.mission.model_copy(update={"environment": environment})
        return self._solved(mission, "direct11")

    @cached_property
    def with_transients(self) -> Solution:
        """Return the optimum with start and stop transients."""
        return self._solved(self.transients_mission, "direct11")

    @cached_property
    def transients_mission(self) -> Mission:
        """Return the mission with tail-off, separation coast and engine start."""
        return load_mission(WITH_TRANSIENTS)

    @cached_property
    def transients_profile(self) -> FlightHistory:
        """Return the columns of the optimum with start and stop transients."""
        return profile_of(self.transients_mission, self.with_transients)

    @cached_property
    def transient_rows(self) -> dict[str, TransientRow]:
        """Return the cost of each transient, up to OTIS' cut-off time, by name."""
        otis = printed.values("table-4.1")["otis"]["cutoff_s"]
        return {row.name: row for row in transient_study(otis)}

    @cached_property
    def planar_optimum(self) -> PlanarFlight:
        """Return the optimum in its orbital plane."""
        return planar_flight(self.optimum)

    @cached_property
    def fits(self) -> tuple[FittedPiece, ...]:
        """Return the polynomials of chapter 5 fitted to the optimum, piece by piece."""
        return fit_flight(self.planar_optimum, self.staging_s, self.optimum.t_plf_s)

    def analytic(self, **options: object) -> AnalyticSolution:
        """Solve analytically, by default from the jettison state of the optimum."""
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
        """Return the solution of Table 6.2: printed polynomials, trapezoids of 100 steps."""
        steps = tuple(printed.values("table-6.3")[0]["steps"])
        return self.analytic(profile="thesis", position_integral="trapezoid", steps=steps)

    @cached_property
    def analytic_exact(self) -> AnalyticSolution:
        """Return the solution of the printed polynomials with position in closed form."""
        return self.analytic(profile="thesis", position_integral="exact")

    @cached_property
    def analytic_improved(self) -> AnalyticSolution:
        """Return the solution of the improved polynomials."""
        return self.analytic(profile="improved")

    @cached_property
    def analytic_alone(self) -> AnalyticSolution:
        """Return that of the improved polynomials with the mission's jettison state."""
        return self.analytic(profile="improved", jettison_target="mission")

    @cached_property
    def optimum_profile(self) -> FlightHistory:
        """Return the columns of the optimum."""
        return profile_of(self.mission, self.optimum)

    @cached_property
    def optimum14_profile(self) -> FlightHistory:
        """Return the columns of the optimum with 14 parameters."""
        return profile_of(self.mission, self.optimum14)

    @cached_property
    def optimum20_profile(self) -> FlightHistory:
        """Return the columns of the optimum with 20 parameters."""
        return profile_of(self.mission, self.optimum20)

    @cached_property
    def held_profile(self) -> FlightHistory:
        """Return the columns of the optimum with the jettison at the thesis' time."""
        return profile_of(self.mission, self.held)

    @cached_property
    def peg(self) -> History:
        """Return a flight of multi-stage PEG, closed loop, from the navigation state alone."""
        return record_flight(self.mission, ready_law(self.mission))

    @cached_property
    def peg_printed(self) -> History:
        """Return a flight of the thesis' PEG, by modes, from the analytic solution."""
        return record_flight(self.mission, ready_law(self.mission, "peg_thesis"))

    def first_solution(self, guess: Solution | None = None) -> int:
        """Count the iterations to multi-stage PEG's first solution.

        Args:
            guess: initial solution; None: from the navigation state alone.
        """
        law = ready_law(self.mission, guess=guess)
        law.step(Simulator(self.mission).navigation)
        return int(law.state["iterations"])

    @cached_property
    def pins(self) -> dict[str, PinnedFlight]:
        """Return the cost of each pin of the thesis' PEG, by name."""
        return {row.name: row for row in pin_study(self.mission)}

    @cached_property
    def wrong_thrust(self) -> list[WrongThrust]:
        """Return the cost of the pins with wrong thrust."""
        return wrong_thrust_study(mission=self.mission)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Return the numbers quoted in sentences, by the name in their braces."""
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
