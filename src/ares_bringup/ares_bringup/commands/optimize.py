# SPDX-License-Identifier: Apache-2.0
"""Solve and print for `ares optimize`. No ROS."""

import math
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ares_bringup.commands.interrupts import note_found
from ares_bringup.doubts import show_warning, show_warnings
from ares_bringup.options import CannotStart, refusal
from ares_bringup.plain_json import print_json
from ares_bringup.progress import search
from ares_bringup.report import BLANK, console, number, shown_path
from ares_bringup.shared_plans import shared_plans
from ares_bringup.whole_file import check_file
from ares_models.kernels.environment import air_velocity, altitude
from ares_models.kernels.vectors import norm
from ares_models.mission import Mission, MissionError, load_mission
from ares_models.mission_physics import longest_flight
from ares_models.mission_warnings import FAR_ABOVE, pressure_warning
from ares_models.plans import flies_in_air
from ares_models.registry import registered
from ares_models.splines import hermite_table
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.kept import solve_once
from ares_optimizer.payload import greatest_payload
from ares_optimizer.solution import (
    Check,
    ConstraintCheck,
    OptimizerError,
    Solution,
    Status,
    SteeringArc,
)
from ares_optimizer.solve import solve

if TYPE_CHECKING:
    from ares_bringup.recorded import RecordedFlight

Array = NDArray[np.float64]
Found = TypeVar("Found")

EXIT_OPTIMAL = 0
EXIT_NOT_FOUND = 1
EXIT_FEASIBLE = 3
EXIT_INFEASIBLE = 4

#: Verdict and exit status by status of the solution; NOT_FOUND for any other.
VERDICTS = {
    Status.CONVERGED: ("optimal", EXIT_OPTIMAL),
    Status.FEASIBLE: ("feasible", EXIT_FEASIBLE),
    Status.INFEASIBLE: ("infeasible", EXIT_INFEASIBLE),
}
NOT_FOUND = ("not found", EXIT_NOT_FOUND)

#: Value of a constraint that is zero but for rounding.
_ROUNDING = 1e-12
#: Length of a coast that few upper stages last, s.
_LONG_COAST_S = 12 * 3600.0
#: Number of places between the states at which the dynamic pressure is computed.
_BETWEEN = 201

#: Entry points of this group tabulate results beside published ones, by name of the mission.
PUBLISHED = "ares_bringup.published"


def _write_page(
    out: Path, mission: Mission, solution: Solution, flown: "RecordedFlight | None"
) -> None:
    """Write the optimum as a page, with a flight beside it where there is one."""
    if solution.trajectory is None:
        raise CannotStart(f"no page: there is no flight to show ({solution.reason})")
    from ares_bringup.commands.optimum_page import write_page

    write_page(out, mission, solution, flown)


@shared_plans()
def optimize(
    mission_name: str,
    method: str,
    as_json: bool,
    heating: str | None,
    held: Sequence[str],
    time_limit_s: float,
    out: Path | None = None,
    beside: Path | None = None,
) -> int:
    """Solve, print, and return the exit status.

    Args:
        mission_name: shipped name or path.
        method: one of `ares_optimizer.solve.METHODS`.
        as_json: one JSON object instead of the tables.
        heating: phase in which the heating limit holds; None: that of the mission.
        held: jettisons at fixed times, `NAME=SECONDS` each.
        time_limit_s: wall time of the search, s.
        out: file of the page; None: no page.
        beside: bag of a flight to compare on the page; None: none.

    Returns:
        0 for a proven optimum, 3 for a feasible flight without proof, 4 if infeasible, 1 if none
        was found; the output has the reason.

    Raises:
        CannotStart: bad mission, method, option or bag, or the page cannot be written; one line.
    """
    if out is not None:
        check_file(out)
    flown = None
    if beside is not None:
        from ares_bringup.recorded import read_flight

        # before the search, so that an unreadable bag is reported at once
        flown = read_flight(beside)
    mission: Mission | None = None
    try:
        mission = load_mission(mission_name)
        show_warnings(mission_name)
        times = _held_times(mission, held)
        _load(method)
        with search(quiet=as_json) as tell:
            deadline = Deadline(time_limit_s, tell)
            heating = heating or mission.heating_limit_holds
            if times:
                solution = solve(
                    mission, method, heating=heating, jettison_times=times, deadline=deadline
                )
            else:
                # a flight finds it again
                begin = mission.start().navigation()
                solution = solve_once(mission.arrays(), method, begin, heating, deadline, anew=True)
    except (MissionError, OptimizerError) as error:
        raise refusal(error, mission, mission_name) from error
    _doubt_pressure(mission, solution)
    if as_json:
        print_json(solution.to_json(mission.arc_names))
    else:
        _print(mission, solution, console())
    if out is not None:
        _write_page(out, mission, solution, flown)
        if not as_json:
            print(f"page  {shown_path(str(out))}")
    return VERDICTS.get(solution.status, NOT_FOUND)[1]


def optimize_payload(mission_name: str, as_json: bool, time_limit_s: float) -> int:
    """Find the largest payload and print it with its flight; return the exit status of `optimize`.

    If the command is interrupted, the greatest payload so far is told.

    Args: see :func:`optimize`.

    Raises:
        CannotStart: bad mission, or one without a variable payload; one line.
    """
    mission, found = sought(
        mission_name,
        as_json,
        lambda mission, tell: greatest_payload(mission, time_limit_s, tell, _note_payload),
    )
    _doubt_pressure(found.mission, found.solution)
    if as_json:
        known = {"payload_kg": found.payload_kg, "left_kg": found.left_kg}
        print_json({**known, **found.solution.to_json(mission.arc_names)})
    else:
        out = console()
        asked = mission.payload_kg or 0.0
        out.print(f"greatest payload: {found.payload_kg:,.2f} kg; the file has {asked:,.2f} kg")
        if found.left_kg:
            out.print(
                f"{found.left_kg:,.3g} kg of propellant are left: with more payload no flight is "
                "found, and there may be one"
            )
        _print(found.mission, found.solution, out)
    return VERDICTS.get(found.solution.status, NOT_FOUND)[1]


def _doubt_pressure(mission: Mission, solution: Solution) -> None:
    """Warn of a dynamic pressure that no launcher flies through."""
    most = _most_pressure(mission, solution)
    if line := pressure_warning(mission, most[0] if most else math.nan):
        show_warning(line)


def _note_payload(payload_kg: float, left_kg: float) -> None:
    note_found(
        f"greatest payload so far: {payload_kg:,.2f} kg, which leaves {left_kg:,.3g} kg of "
        "propellant"
    )


def sought(
    mission_name: str, as_json: bool, seek: Callable[[Mission, Callable[[Progress], None]], Found]
) -> tuple[Mission, Found]:
    """Load a mission, show its warnings, and seek with a bar; return the mission and what is found.

    Args:
        mission_name: shipped name or path.
        as_json: no bar is shown.
        seek: of a mission and what the progress is told to.

    Raises:
        CannotStart: bad mission, or one that cannot be sought for; one line.
    """
    mission: Mission | None = None
    try:
        mission = load_mission(mission_name)
        show_warnings(mission_name)
        with search(quiet=as_json) as tell:
            return mission, seek(mission, tell)
    except (MissionError, OptimizerError) as error:
        raise refusal(error, mission, mission_name) from error


@cache
def _load(method: str) -> None:
    """Solve once without a time limit: the first call in a process loads or compiles kernels."""
    solve(load_mission("ares_v"), method)


def _held_times(mission: Mission, held: Sequence[str]) -> dict[int, float]:
    times = {}
    begin = mission.initial_state.time_s
    end = begin + longest_flight(mission)
    for text in held:
        name, _, value = text.rpartition("=")
        if name not in mission.jettison_names:
            known = ", ".join(repr(known) for known in mission.jettison_names) or "none at all"
            raise CannotStart(
                f"--hold-jettison is {text!r}; expected NAME=SECONDS, the name one of {known}"
            )
        try:
            time = float(value)
        except ValueError as error:
            raise CannotStart(
                f"--hold-jettison is {text!r}; expected a number of seconds after the ="
            ) from error
        if not begin <= time <= end:
            raise CannotStart(
                f"--hold-jettison is {text!r}; expected a time of the flight, "
                f"{begin:g} to {end:g} s"
            )
        times[mission.jettison_names.index(name)] = time
    return times


def _print(mission: Mission, solution: Solution, out: Console) -> None:
    out.print(Text(f"{mission.title} ({mission.name}), {solution.method}"), style="bold")
    word = VERDICTS.get(solution.status, NOT_FOUND)[0]
    verdict = word if solution.reason == word else f"{word}: {solution.reason}"
    out.print(Text(mission.with_names(verdict)), soft_wrap=True)
    for line in solution.steps:
        # of an infeasible mission the reason is all there is to say
        said = len(solution.steps) == 1 and line.endswith(solution.reason)
        if solution.trajectory is not None or not (said or solution.status is Status.INFEASIBLE):
            out.print(Text(f"  {mission.with_names(line)}"), soft_wrap=True)
    if solution.status is Status.INFEASIBLE and mission.payload_kg:
        out.print("  --maximize payload finds the greatest payload that arrives, if any does")
    if solution.trajectory is None:
        return
    out.print()
    results = _results(solution)
    published = registered(PUBLISHED).get(mission.name)
    if published is not None:
        out.print(published.load()(results))
    else:
        for name, value in results.items():
            if math.isfinite(value):
                out.print(f"{name:<18}{value:>14,.3f}")
    out.print()
    out.print(arc_table(solution))
    out.print()
    out.print(constraint_table(mission, solution))
    out.print()
    facts = _air_facts(mission, solution) | _coast_facts(solution) | proof_facts(solution)
    for name, text in facts.items():
        out.print(f"{name}: {text}", soft_wrap=True)


def _results(solution: Solution) -> dict[str, float]:
    return {
        "jettison, s": solution.t_plf_s,
        "from then to cut-off, s": solution.t_meco_s - solution.t_plf_s,
        "cut-off, s": solution.t_meco_s,
        "final mass, kg": solution.m_f_kg,
    }


def _most_pressure(mission: Mission, solution: Solution) -> tuple[float, float, float] | None:
    """Return the greatest dynamic pressure of a flight, Pa, with its time, s, and altitude, m.

    None of a flight above the air, and where it was greater before the first state, in a programme
    of the file.
    """
    track = solution.trajectory
    arrays = mission.arrays()
    if track is None or not flies_in_air(arrays.arcs):
        return None
    environment = arrays.environment[0]
    air, factor = mission.atmosphere(), mission.environment.atmosphere.density_factor
    time_s, first = np.unique(track.time_s, return_index=True)
    cubics = hermite_table(time_s, track.position[first].T, track.velocity[first].T)

    def passed(time: Array) -> tuple[list[float], Array]:
        """Return altitudes, m, and dynamic pressures, Pa."""
        i = np.searchsorted(time_s, time, side="right") - 1
        later = time - time_s[i]
        c0, c1, c2, c3 = np.moveaxis(cubics[:, i, 1:], -1, 0)
        places = [tuple(r) for r in (c0 + later * (c1 + later * (c2 + later * c3))).T.tolist()]
        moving = [tuple(v) for v in (c1 + later * (2.0 * c2 + 3.0 * later * c3)).T.tolist()]
        heights = [altitude(r, environment) for r in places]
        densities = np.array([factor * air.density(height) for height in heights])
        speeds = [norm(air_velocity(*at, environment)) for at in zip(places, moving, strict=True)]
        return heights, 0.5 * densities * np.square(speeds)

    k = int(np.argmax(passed(time_s)[1]))
    if not k:
        return None
    time = np.linspace(time_s[k - 1], time_s[min(k + 1, len(time_s) - 1)], _BETWEEN)
    heights, pressures = passed(time)
    k = int(np.argmax(pressures))
    return float(pressures[k]), float(time[k]), heights[k]


def _air_facts(mission: Mission, solution: Solution) -> dict[str, str]:
    """Describe the greatest dynamic pressure of a flight in the air, and its wind, by name."""
    if solution.trajectory is None or not flies_in_air(mission.arrays().arcs):
        return {}
    facts = {}
    if greatest := _most_pressure(mission, solution):
        pressure, time, height = greatest
        place = f"at {time:.1f} s and {height / 1e3:.1f} km"
        facts["greatest dynamic pressure"] = f"{pressure / 1e3:.2f} kPa {place}"
    if knots := mission.environment.atmosphere.wind_table:
        height, *most = max(knots, key=lambda knot: math.hypot(*knot[1:]))
        strongest = f"up to {math.hypot(*most):.1f} m/s at {height / 1e3:.1f} km"
        facts["planned in the wind of the mission"] = strongest
    return facts


def plain_table(first: str, *columns: str) -> Table:
    """Make a table without lines: names, then figures."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(first)
    for column in columns:
        table.add_column(column, justify="right")
    return table


def arc_table(solution: Solution) -> Table:
    """Tabulate the steering laws, one row each."""
    table = plain_table("steering from", "to s", "mass kg", "to kg", "delta-V m/s", "rate deg/s")
    for arc in solution.arcs:
        table.add_row(*(number(*figure) for figure in arc_figures(arc)))
    return table


def arc_figures(arc: SteeringArc) -> tuple[tuple[float, int], ...]:
    """Return begin and end, s, masses, kg, delta-V, m/s, and rate, deg/s, each with decimals."""
    return (
        (arc.start_s, 2),
        (arc.end_s, 2),
        (arc.start_mass_kg, 1),
        (arc.end_mass_kg, 1),
        (arc.delta_v_m_s, 2),
        (math.degrees(float(np.linalg.norm(arc.direction_rate))), 4),
    )


def name_and_state(mission: Mission, check: ConstraintCheck) -> tuple[str, str]:
    """Return the name of a constraint with its unit, and its state.

    That is active, slack, free (a length that no bound holds) or VIOLATED.
    """
    state = "active" if check.active else "free" if is_free(check) else "slack"
    name = mission.with_names(check.name)
    if check.unit:
        name = f"{name}, {check.unit}"
    return name, state if check.satisfied else "VIOLATED"


def is_free(check: ConstraintCheck) -> bool:
    """Tell whether it is the length of a free arc that is at none of its bounds."""
    return check.key is Check.ARC_LENGTH and check.satisfied and not check.active


def price_of(check: ConstraintCheck) -> float:
    """Return kg of final mass per unit of a limit; nan: not known, or the limit does not act."""
    return check.multiplier if check.active or not check.satisfied else math.nan


def constraint_table(mission: Mission, solution: Solution) -> Table:
    """Tabulate the constraints as found by the independent integration."""
    table = plain_table("constraint", "value", "limit", "", "kg per unit")
    for check in solution.constraints:
        name, state = name_and_state(mission, check)
        price = price_of(check)
        table.add_row(
            name,
            f"{check.value if abs(check.value) > _ROUNDING else 0.0:,.7g}",
            BLANK if is_free(check) else f"{check.limit:,.7g}",
            state,
            f"{price + 0.0:+.4g}" if math.isfinite(price) else BLANK,
        )
    return table


def _coast_facts(solution: Solution) -> dict[str, str]:
    """Describe a coast that is longer than a stage lasts that is not made for it."""
    coasts = [arc.end_s - arc.start_s for arc in solution.arcs if arc.coasts]
    longest = max(coasts, default=0.0)
    if longest < _LONG_COAST_S:
        return {}
    return {"longest coast": f"{longest / 3600.0:,.1f} h; max_s of a free coast bounds its length"}


def _higher(solution: Solution) -> str:
    """Name the key that raises the lowest part of a flight after its jettisons."""
    track = solution.trajectory
    assert track is not None
    after = track.time_s > solution.t_plf_s
    lowest = np.argmin(np.where(after, np.linalg.norm(track.position, axis=1), math.inf))
    at = float(track.time_s[lowest])
    arc = next(flown.arc for flown in solution.flown if at <= flown.end_s)
    coasts = next(piece.coasts for piece in solution.arcs if at <= piece.end_s)
    return f"a higher {'min_perigee_altitude_m' if coasts else 'min_altitude_m'} of arc {arc}"


def proof_facts(solution: Solution) -> dict[str, str]:
    """Describe the proof and the cost of the search, by name."""
    facts = {}
    proof = solution.verification
    if proof is not None:
        facts["proof"] = (
            "flown again by another integrator: within "
            f"{proof.position_defect_m:.2g} m, {proof.velocity_defect_m_s:.2g} m/s, "
            f"{proof.mass_defect_kg:.2g} kg"
        )
        peak = proof.peak_fmhr_after_jettison_w_m2
        if math.isfinite(peak):
            line = f"{peak:,.1f} W/m2 after the jettison"
            limit = min(
                (c.limit for c in solution.constraints if c.key is Check.HEATING_AT_JETTISON),
                default=math.inf,
            )
            if peak > FAR_ABOVE * limit:
                line += f", {peak / limit:,.0f} times the limit"
                # free arcs before the last have a length to check
                if any(c.key is Check.ARC_LENGTH for c in solution.constraints):
                    line += f"; {_higher(solution)} keeps it down"
            facts["greatest heating"] = line
    if solution.costates is not None:
        spread = max(solution.costates.hamiltonian_spread, default=math.nan)
        facts["Hamiltonian"] = f"constant on each arc within {spread:.1e}"
    restarts = f", {solution.restarts} restarts" if solution.restarts else ""
    facts["search"] = f"{solution.iterations} iterations{restarts}, {solution.solve_ms:.2f} ms"
    return facts
