# SPDX-License-Identifier: Apache-2.0
"""The two-point problem that law `optimal` solves on board.

It has the mission's arcs with the engines as measured, heating limits less their margin, and
inverse-square gravity.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import Onboard
from ares_guidance.kernels.prediction.jettison import on_board_heating
from ares_models.arrays import BURN, HEATING_LIMIT, MissionRecords, Record
from ares_models.jit import inlined, kernel
from ares_models.kernels.sequence import empty_mass
from ares_optimizer.two_point.arrays import AT_ONCE, HELD, INVERSE_SQUARE, RUNGE_KUTTA
from ares_optimizer.two_point.contract import HEATING_OPTIMAL, MAX_UNKNOWNS

#: Longest integration step on board, s; the error of the cut-off is at most 0.1 ms.
STEP = 40.0
#: The same as a fraction of the time in which the last burn would consume all mass.
STEP_SHARE = 0.07
#: Last Newton step in scaled unknowns: 1e-4 s of cut-off.
TOLERANCE = 1e-6
#: Largest number of cycles on one Jacobian.
REFRESH = 20
#: Largest relative change of thrust or mass flow for which the Jacobian is kept.
SAME_ENGINE = 0.01
#: Time before the planned end of an arc, s, from which that end is fixed.
NEAR_END = 1.0


@kernel
def plans_whole(state: Record) -> bool:
    """Return whether the ends of free arcs before the last are unknowns too."""
    return state.plan.made == 1 and state.plan.by_legs == 0


@kernel
def believed_limits(jettisons: NDArray[Any], onboard: Onboard) -> None:
    """Write the heating limits, less the margin, scaled to the on-board density model."""
    settings = onboard.settings
    state = onboard.state
    memory = state.optimal
    below = (1.0 - settings.heating_margin) / on_board_heating(settings, state)
    for j in range(jettisons.shape[0]):
        memory.jettisons[j] = jettisons[j]
        if jettisons[j].criterion == HEATING_LIMIT:
            memory.jettisons[j].value *= below


@kernel
def believed_arcs(mission: MissionRecords, onboard: Onboard) -> None:
    """Write the mission's arcs, those of the present stage with the measured engines."""
    nav = onboard.navigation
    state = onboard.state
    arcs = mission.arcs
    memory = state.optimal
    stage = arcs[nav.arc].stage
    if (
        memory.arcs_from == nav.arc + 1
        and memory.thrust_ratio == state.thrust_ratio
        and memory.flow_ratio == state.flow_ratio
    ):
        return
    for k in range(arcs.shape[0]):
        memory.arcs[k] = arcs[k]
        if plans_whole(state):
            memory.arcs[k].duration = memory.duration[k]
        if arcs[k].stage == stage and arcs[k].kind == BURN and state.thrust_ratio > 0.0:
            memory.arcs[k].thrust *= state.thrust_ratio
            memory.arcs[k].mass_flow *= state.flow_ratio
            memory.arcs[k].exhaust_velocity *= state.thrust_ratio / state.flow_ratio
    # the old Jacobian is valid only for small changes of the engine
    if (
        abs(memory.thrust_ratio - state.thrust_ratio) > SAME_ENGINE
        or abs(memory.flow_ratio - state.flow_ratio) > SAME_ENGINE
    ):
        memory.age = REFRESH
    present = memory.arcs[nav.arc]
    if present.duration == 0.0:
        # after an engine failure the others burn the remaining propellant
        left = nav.mass - empty_mass(arcs[nav.arc], arcs, mission.jettisons, nav.jettisoned)
        present.duration = nav.time - nav.arc_start_time + left / present.mass_flow
        memory.age = REFRESH
    memory.arcs_from = nav.arc + 1
    memory.thrust_ratio = state.thrust_ratio
    memory.flow_ratio = state.flow_ratio


@inlined
def believed_mission(mission: MissionRecords, onboard: Onboard) -> MissionRecords:
    """Return the mission with scaled limits and measured engines, from the law's memory."""
    believed_limits(mission.jettisons, onboard)
    believed_arcs(mission, onboard)
    memory = onboard.state.optimal
    return MissionRecords(
        mission.environment,
        mission.atmosphere,
        memory.arcs[: mission.arcs.shape[0]],
        memory.jettisons[: mission.jettisons.shape[0]],
        mission.target,
    )


@kernel
def drop_past_ends(mission: MissionRecords, onboard: Onboard, first: int) -> None:
    """Remove the ends of past arcs from the unknowns; fix the end of an arc that is about to end.

    Args:
        mission: as returned by :func:`believed_mission`.
        onboard: state of guidance. Its memory is changed.
        first: column of the first end.
    """
    nav = onboard.navigation
    memory = onboard.state.optimal
    u = memory.unknowns
    switches = memory.work.switches
    for k in range(memory.solved_in, nav.arc):
        if not math.isinf(mission.arcs[k].duration):
            continue
        memory.age = REFRESH
        for i in range(first, MAX_UNKNOWNS - 1):
            u[i] = u[i + 1]
        for f in range(switches.shape[0] - 1):
            switches[f].hold = switches[f + 1].hold
            switches[f].length = switches[f + 1].length
    memory.solved_in = nav.arc
    last = mission.arcs.shape[0] - 1
    if nav.arc == last or not math.isinf(mission.arcs[nav.arc].duration):
        return
    if u[first] - nav.time < NEAR_END:
        if switches[0].hold != HELD:
            memory.age = REFRESH
        u[first] = max(u[first], nav.time + AT_ONCE)
        switches[0].hold = HELD
        switches[0].length = u[first] - nav.arc_start_time


@kernel
def set_options(mission: MissionRecords, onboard: Onboard) -> None:
    """Set up the on-board problem: inverse-square gravity, coarse steps."""
    options = onboard.state.optimal.options
    last = mission.arcs[mission.arcs.shape[0] - 1]
    options.gravity = INVERSE_SQUARE
    options.propagator = RUNGE_KUTTA
    options.heating = HEATING_OPTIMAL
    options.step = min(STEP, STEP_SHARE * onboard.navigation.mass / last.mass_flow)
    options.max_iterations = onboard.settings.max_solve_iterations
    options.tolerance = TOLERANCE
