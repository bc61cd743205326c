# SPDX-License-Identifier: Apache-2.0
"""Fly closed loops without ROS, by the same steps as the nodes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.law import Law, LawKind, why_no_plan
from ares_guidance.laws import check_law, make_law
from ares_guidance.plan import ArcPlan, plan_of
from ares_guidance.settings import LawSettings
from ares_guidance.trajectory import OfflineTrajectory
from ares_models.failures import Failure
from ares_models.mission import Mission
from ares_models.plans import needs_plan
from ares_optimizer.solution import Solution
from ares_studies.arrays import closed_loop
from ares_studies.loops import flight_loop
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.simulator import CommandRefused, Simulator, SimulatorOptions, true_vehicle


@dataclass(frozen=True)
class Flight:
    """Hold the end of a flight.

    Attributes:
        plant: record PLANT with the true final state and the events.
        guidance: record GUIDANCE_STATE.
    """

    plant: Any
    guidance: Any

    @property
    def events(self) -> NDArray[np.void]:
        """Return the events, dtype EVENT."""
        return self.plant["events"][: self.plant["event_count"]]


def offline_trajectory(solution: Solution) -> OfflineTrajectory:
    """Convert the optimizer's solution for a guidance law.

    Raises:
        ValueError: the solution has no trajectory.
    """
    track = solution.trajectory
    if track is None:
        raise ValueError(f"{solution.method} has no trajectory: {solution.reason}")

    def column(name: str) -> NDArray[np.float64]:
        return np.array([getattr(arc, name) for arc in solution.arcs])

    return OfflineTrajectory(
        jettison_time=solution.heating_jettison_s,
        cutoff_time=solution.t_meco_s,
        arc_start_time=column("start_s"),
        arc_end_time=column("end_s"),
        arc_start_mass=column("start_mass_kg"),
        arc_end_mass=column("end_mass_kg"),
        arc_delta_v=column("delta_v_m_s"),
        steering_reference_time=column("reference_time_s"),
        steering_direction=column("direction"),
        steering_direction_rate=column("direction_rate"),
        primer_rate=column("primer_rate"),
        sample_time=track.time_s,
        sample_position=track.position,
        sample_velocity=track.velocity,
        sample_mass=track.mass,
        sample_direction=track.thrust_directions(solution.arcs),
        flown_arc=np.array([arc.arc for arc in solution.flown], dtype=np.int64),
        flown_start_time=np.array([arc.start_s for arc in solution.flown]),
        flown_end_time=np.array([arc.end_s for arc in solution.flown]),
        by_legs=solution.by_legs,
    )


def plan_solution(
    mission: Mission,
    law: LawKind,
    state: NDArray[np.void] | None = None,
    time_limit_s: float | None = None,
    verify: bool = False,
) -> Solution:
    """Solve for the free quantities of a mission.

    Args:
        mission: to be flown.
        law: guidance law.
        state: start of the plan, shape (1,), dtype NAVIGATION; None: the mission's start.
        time_limit_s: wall time of the search; None: no limit.
        verify: fly it by another integrator too, and find its costates.

    Raises:
        ValueError: the optimizer finds no plan, or one through the ground; one line.
    """
    from ares_optimizer.deadline import Deadline
    from ares_optimizer.kept import solve_once  # slow to import

    arrays = mission.arrays(foreseen=True)
    begin = mission.start().navigation() if state is None else state
    heating, deadline = mission.heating_limit_holds, Deadline(time_limit_s)
    solution = solve_once(mission.arrays(), "auto", begin, heating, deadline, verify=verify)
    if not solution.flyable:
        raise ValueError(why_no_plan(law.name, arrays, solution.reason))
    try:
        plan_of(offline_trajectory(solution), arrays)
    except ValueError as error:
        raise ValueError(why_no_plan(law.name, arrays, str(error))) from error
    return solution


def arc_plan(
    mission: Mission,
    law: LawKind,
    state: NDArray[np.void] | None = None,
    time_limit_s: float | None = None,
    asked: bool = False,
) -> ArcPlan | None:
    """Solve for the plan of what a mission leaves free; None if it leaves nothing free.

    Args:
        mission, law, state, time_limit_s: see :func:`plan_solution`.
        asked: solve for one although nothing is free.

    Raises: see :func:`plan_solution`.
    """
    arrays = mission.arrays(foreseen=True)
    if not (asked or needs_plan(arrays.arcs, arrays.target[0], arrays.environment[0])):
        return None
    return plan_of(offline_trajectory(plan_solution(mission, law, state, time_limit_s)), arrays)


def ready_law(
    mission: Mission,
    name: str = "peg",
    settings: LawSettings | None = None,
    guess: Solution | None = None,
    state: NDArray[np.void] | None = None,
    time_limit_s: float | None = None,
    plan: ArcPlan | None = None,
) -> Law:
    """Make a guidance law, ready for its first navigation state.

    Args:
        mission: to be flown.
        name: one of `ares_guidance.registry.law_names`.
        settings: cycle and gates.
        guess: initial solution. None: none, except for a law that needs a trajectory, which gets
            the answer of its method, and one that flies by a plan, which is solved.
        state: start of that solution, shape (1,), dtype NAVIGATION; None: the mission's start.
        time_limit_s: wall time of the search for a plan; None: no limit.
        plan: of another such law; None: none, it is solved for.

    Raises:
        ValueError: the law cannot fly the mission, the guess is unusable, or the law has no
            solution for the plan.
    """
    arrays = mission.arrays(foreseen=True)
    state = None if state is None else mission.start_of_plan(state)
    law = make_law(name, arrays, settings, mission.start().navigation())
    if guess is None and law.kind.needs_trajectory:
        from ares_optimizer.solve import solve

        guess = solve(mission, law.kind.trajectory_method, state=state)
    if guess is not None:
        law.start_from(offline_trajectory(guess))
        return law
    plan = plan or arc_plan(mission, law.kind, state, time_limit_s, law.asks)
    if plan is not None:
        law.follow_arcs(plan)
        begin = mission.start().navigation() if state is None else state
        check_law(name, arrays, begin, plan)
    return law


def fly_compiled(
    mission: Mission,
    options: SimulatorOptions | None = None,
    dispersions: Dispersions | None = None,
    seed: int = 0,
    flight: int = 0,
    law: str | Law = "peg",
    failure: Failure | None = None,
) -> Flight:
    """Fly a mission in one compiled loop.

    Args:
        mission: to be flown.
        options: integration of the plant.
        dispersions: of the truth; None: none.
        seed: master seed of the dispersions.
        flight: number of the flight among those of the seed.
        law: one of `ares_guidance.registry.law_names`, or an unused law made by :func:`ready_law`,
            with its own settings.
        failure: injected failure; None: none.

    Raises:
        ValueError: the law cannot fly the mission, or dispersions or failure do not fit it.
    """
    options = options or SimulatorOptions()
    believed = mission.arrays(foreseen=True)
    true, vehicle = true_vehicle(
        mission, options, dispersions or Dispersions(), seed, flight, failure
    )
    if isinstance(law, str):
        law = ready_law(mission, law, state=vehicle.navigation)
    law.check_plan()
    flight_loop(law.kind)(closed_loop(true, vehicle, believed, law.onboard))
    return Flight(vehicle.plant[0], law.state)


def fly_stepwise(
    mission: Mission,
    options: SimulatorOptions | None = None,
    dispersions: Dispersions | None = None,
    seed: int = 0,
    flight: int = 0,
    law: str | Law = "peg",
    failure: Failure | None = None,
) -> Flight:
    """Fly a mission through the objects that the nodes use.

    Args: see :func:`fly_compiled`.

    Raises:
        CommandRefused: the vehicle refuses a command; one line with its time.
        ValueError: see :func:`fly_compiled`.
    """
    simulator = Simulator(mission, options, dispersions, seed, flight, failure)
    if isinstance(law, str):
        first = np.array([simulator.navigation])
        law = ready_law(mission, law, state=first)
    while not simulator.complete:
        law.step(simulator.navigation)
        try:
            simulator.command(law.steering)
        except CommandRefused as error:
            raise CommandRefused(f"at {simulator.plant['time']:.9g} s: {error}") from error
        simulator.advance()
    return Flight(simulator.plant, law.state)
