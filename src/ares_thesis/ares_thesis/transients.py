# SPDX-License-Identifier: Apache-2.0
"""What start and stop transients cost, and how near they bring the optimum to a published one.

The thesis leaves them out (section 4.2.1) and sets its optimum beside one of OTIS, which had
them. Here the flight without them gets those of the flight with them, one by one and all, and
then as much more as it takes to cut off at the published time.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from scipy.optimize import brentq

from ares_models.mission import Mission, load_mission
from ares_models.mission_parts import BurnArc, CoastArc, Stage
from ares_optimizer.solution import OptimizerError, Solution
from ares_optimizer.solve import solve

PLAIN = "ares_v"
WITH_TRANSIENTS = "ares_v_transients"

_TIME_TOLERANCE = 1e-6  # s
_SHORTEST = 1e-9  # s, of a coast


@dataclass(frozen=True)
class Transients:
    """What the flight without transients is given.

    Attributes:
        tail_off: of the core, as in the mission file, with the coast that it takes.
        separation: coast before the upper stage's start command, as in the mission file.
        start: of the upper stage, as in the mission file.
        lost_thrust_s: core cut off so much earlier, separation not; that propellant is dropped.
        dead_time_s: upper stage started so much later.
    """

    tail_off: bool = False
    separation: bool = False
    start: bool = False
    lost_thrust_s: float = 0.0
    dead_time_s: float = 0.0


@dataclass(frozen=True)
class TransientRow:
    """The optimum with some transients.

    Attributes:
        name: of the case.
        transients: what was given.
        t_plf_s: fairing jettison; nan for the bound, which is no flight.
        t_meco_s: cut-off.
        m_f_kg: final mass.
        t_plf_change_s, t_meco_change_s, m_f_change_kg: against the flight without transients.
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
    """The mission without transients, with these."""
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
    """A stage with other arcs; its masses stay."""
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
    """The last stage's mass at a time, full flow from its first ignition on, parts dropped, kg.

    However slowly an engine starts, no flight that cuts off then has less.
    """
    last = mission.stages[-1]
    at = len(mission.stages) - 1
    (engine,) = last.burns
    left = mission.ignition_mass(at) - mission.jettison_mass(at)
    burning = t_meco_s - mission.ignition_times()[-1]
    return left - engine.mass_flow(mission.environment.g0_m_s2) * burning


def transient_study(published_t_meco_s: float) -> list[TransientRow]:
    """The rows: none, each alone, all; a second of each loss; what reaches a published cut-off.

    Args:
        published_t_meco_s: cut-off time of the published flight, later than the one with all
            transients of the mission file.

    Returns:
        the optimum of each case, the flight without transients first; last the least mass
        that any flight of this cut-off time can have, see :func:`mass_after_full_flow`.

    Raises:
        OptimizerError: a case without an optimum, or a published time that no loss leads to.
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
    """A row from jettison and cut-off time (s) and final mass (kg)."""
    before = base.t_plf_s, base.t_meco_s, base.m_f_kg
    changes = [after - x for after, x in zip(figures, before, strict=True)]
    return TransientRow(name, transients, *figures, *changes)


def _loss_until(t_meco_s: float, losing: Callable[[float], Transients]) -> float:
    """Seconds lost with which the optimum cuts off at a time."""

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
