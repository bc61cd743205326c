# SPDX-License-Identifier: Apache-2.0
"""Measure the cost of thrust transients, and how close they bring the optimum to a published one.

The thesis omits them (section 4.2.1) and compares its optimum with one of OTIS, which has them.
Here the flight without transients gets those of the flight with them, one by one and all, and then
as much additional loss as is needed to cut off at the published time.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from scipy.optimize import brentq

from ares_models.mission import Mission, load_mission
from ares_models.mission_arcs import BurnArc, CoastArc
from ares_models.mission_parts import Stage
from ares_optimizer.solution import OptimizerError, Solution
from ares_optimizer.solve import solve

PLAIN = "ares_v"
WITH_TRANSIENTS = "ares_v_transients"

_TIME_TOLERANCE = 1e-6  # s
_SHORTEST = 1e-9  # s, of a coast


@dataclass(frozen=True)
class Transients:
    """Select the transients added to the flight without transients.

    Attributes:
        tail_off: of the core, as in the mission file, with its coast.
        separation: coast before the upper stage's start command, as in the mission file.
        start: of the upper stage, as in the mission file.
        lost_thrust_s: earlier core cut-off at unchanged separation; the propellant is dropped.
        dead_time_s: delay of the upper stage's start.
    """

    tail_off: bool = False
    separation: bool = False
    start: bool = False
    lost_thrust_s: float = 0.0
    dead_time_s: float = 0.0


@dataclass(frozen=True)
class TransientRow:
    """Hold the optimum with some transients.

    Attributes:
        name: of the case.
        transients: added.
        t_plf_s: fairing jettison; nan for the bound, which is no flight.
        t_meco_s: cut-off.
        m_f_kg: final mass.
        t_plf_change_s, t_meco_change_s, m_f_change_kg: from the flight without transients.
    """

    name: str
    transients: Transients
    t_plf_s: float
    t_meco_s: float
    m_f_kg: float
    t_plf_change_s: float
    t_meco_change_s: float
    m_f_change_kg: float


def transient_mission(transients: Transients) -> Mission:
    """Add transients to the mission without them."""
    plain, full = load_mission(PLAIN), load_mission(WITH_TRANSIENTS)
    core, upper = plain.stages
    full_core, full_upper = full.stages
    given_core = full_core if transients.tail_off else core
    (burn,) = given_core.burns
    cut_off = burn.duration_s - transients.lost_thrust_s
    core_arcs: list[BurnArc | CoastArc] = [
        burn.model_copy(update={"burn_time_s": cut_off}),
        *_coasts(given_core),
        *_coast(transients.lost_thrust_s),
    ]
    (engine,) = (full_upper if transients.start else upper).burns
    upper_arcs: list[BurnArc | CoastArc] = [
        *_coasts(full_upper if transients.separation else upper),
        *_coast(transients.dead_time_s),
        engine,
    ]
    stages = (_with_arcs(core, core_arcs), _with_arcs(upper, upper_arcs))
    return plain.model_copy(update={"stages": stages})


def _coasts(stage: Stage) -> list[CoastArc]:
    return [arc for arc in stage.flight_arcs if isinstance(arc, CoastArc)]


def _coast(duration_s: float) -> list[CoastArc]:
    return [CoastArc(coast_s=duration_s)] if duration_s > _SHORTEST else []


def _with_arcs(stage: Stage, arcs: list[BurnArc | CoastArc]) -> Stage:
    """Replace the arcs of a stage; keep its masses."""
    return Stage(
        name=stage.name,
        ignition_mass_kg=stage.ignition_mass_kg,
        propellant_kg=stage.propellant_kg,
        arcs=tuple(arcs),
    )


def _optimum(transients: Transients) -> Solution:
    mission = transient_mission(transients)
    solution = solve(mission, "indirect", verify=False)
    if not solution.converged:
        raise OptimizerError(f"{mission.name} with {transients}: {solution.reason}")
    return solution


def mass_after_full_flow(mission: Mission, t_meco_s: float) -> float:
    """Compute the last stage's mass, kg, after full flow since its first ignition, jettisons done.

    A lower bound: with a slower start of the engine, a flight with this cut-off has more.
    """
    last = mission.stages[-1]
    at = len(mission.stages) - 1
    (engine,) = last.burns
    left = mission.ignition_mass(at) - mission.jettison_mass(at)
    burning = t_meco_s - mission.ignition_times()[-1]
    return left - engine.mass_flow(mission.environment.g0_m_s2) * burning


def transient_study(published_t_meco_s: float) -> list[TransientRow]:
    """Compute the rows: none, each alone, all; 1 s of each loss; losses to a published cut-off.

    Args:
        published_t_meco_s: cut-off time of the published flight, later than the one with all
            transients of the mission file.

    Returns:
        The optimum of each case, the flight without transients first; last the least mass
        of any flight with this cut-off time, see :func:`mass_after_full_flow`.

    Raises:
        OptimizerError: a case without an optimum, or a published time before that of all
            transients.
    """
    every = Transients(tail_off=True, separation=True, start=True)

    def enough(losing: Callable[[float], Transients]) -> Transients:
        return losing(_loss_until(published_t_meco_s, losing))

    cases = {
        "no transients": Transients(),
        "RS-68 tail-off": Transients(tail_off=True),
        "separation": Transients(separation=True),
        "J-2X start": Transients(start=True),
        "all three": every,
        "1 s of RS-68 thrust lost": Transients(lost_thrust_s=1.0),
        "1 s of J-2X dead time": Transients(dead_time_s=1.0),
        "all three, and RS-68 thrust lost": enough(lambda x: replace(every, lost_thrust_s=x)),
        "all three, and J-2X dead time": enough(lambda x: replace(every, dead_time_s=x)),
        "RS-68 thrust lost, nothing else": enough(lambda x: Transients(lost_thrust_s=x)),
    }
    base = _optimum(Transients())
    rows = []
    for name, transients in cases.items():
        optimum = _optimum(transients)
        figures = optimum.t_plf_s, optimum.t_meco_s, optimum.m_f_kg
        rows.append(_row(name, transients, figures, base))
    least = mass_after_full_flow(load_mission(PLAIN), published_t_meco_s)
    bound = math.nan, published_t_meco_s, least
    return [*rows, _row("full flow from staging on", Transients(), bound, base)]


def _row(
    name: str, transients: Transients, figures: tuple[float, float, float], base: Solution
) -> TransientRow:
    """Make a row from jettison and cut-off time (s) and final mass (kg)."""
    before = base.t_plf_s, base.t_meco_s, base.m_f_kg
    changes = [after - x for after, x in zip(figures, before, strict=True)]
    return TransientRow(name, transients, *figures, *changes)


def _loss_until(t_meco_s: float, losing: Callable[[float], Transients]) -> float:
    """Solve for the loss in s with which the optimum cuts off at a time."""

    def late(lost_s: float) -> float:
        return _optimum(losing(lost_s)).t_meco_s - t_meco_s

    if late(0.0) > 0.0:
        raise OptimizerError(
            f"published_t_meco_s is {t_meco_s:g} s; expected at least the "
            f"{late(0.0) + t_meco_s:.2f} s of the flight with transients"
        )
    most = 1.0
    while late(most) < 0.0:
        most *= 2.0
    return float(brentq(late, 0.0, most, xtol=_TIME_TOLERANCE))
