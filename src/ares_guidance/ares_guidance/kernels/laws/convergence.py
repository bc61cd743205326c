# SPDX-License-Identifier: Apache-2.0
"""Search of a law that iterates a predictor-corrector pass to convergence.

`iterate` and `LAW` are PEG's. A law with another pass gets a copy of this module
(`ares_models.jit.specialised`).
"""

import math

from ares_guidance.arrays import ERROR_NONE, ERROR_NOT_CONVERGED, LAW_PEG, STEEPEST, Onboard
from ares_guidance.kernels.laws.large_turn import (
    PIECE,
    converge_held,
    converge_large_turn,
    converge_lofted,
)
from ares_guidance.kernels.laws.near import may_release_place
from ares_guidance.kernels.laws.peg import iterate
from ares_guidance.kernels.laws.start import start_guess
from ares_guidance.kernels.monitors.shortfall import SETTLED, lacking_speed
from ares_guidance.kernels.prediction.segments import least_time_to_go, plan_segments
from ares_models.arrays import TARGET_ELEMENTS, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.targets import leaves_place_free
from ares_models.kernels.vectors import load, norm

#: Value of `state.law` for solutions by the pass.
LAW = LAW_PEG
#: Fraction of the tolerance, and number of extra passes, in the last cycle before the steering is
#: held: no later cycle corrects its residual.
LAST_SHARE = 0.01
LAST_PASSES = 20
#: Replaces `small_turn_limit`, rad, after a failure, in a flight by legs and where the target is an
#: orbit. Their burns may be long at low thrust, where the expansion about the mean direction costs
#: mass.
SMALL_WHERE_LONG = 0.2
#: Range angle of a burn, rad, up to which a pass other than PEG's predicts gravity well enough
#: there. The mean of both ends errs by 10 m/s over it, and with the third power of the angle.
FAR_BY_MEAN = 0.25
#: Excess of the delta-V that a first solution by large angles lacks over that by small angles, from
#: which it is another flight, as a fraction of the velocity-to-go.
FAR_SHORT = 0.1
#: Surplus of a leg that the clock ends, as a fraction of its length, that may be an error of the
#: prediction: spent too early it is missing at the end.
SAME_LENGTH = 3e-3


@kernel
def converge(mission: MissionRecords, onboard: Onboard) -> tuple[int, bool]:
    """Iterate the pass to convergence.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns:
        ERROR_NONE or ERROR_NOT_CONVERGED, and whether the target plane can be reached.
    """
    settings = onboard.settings
    state = onboard.state
    reachable = True
    moved = math.inf
    for _ in range(settings.max_iterations):
        if moved > 0.0:
            plan_segments(mission, onboard)
        miss, moved, reachable = iterate(mission, onboard)
        state.iterations += 1
        state.solution.miss_speed = miss
        if not (math.isfinite(miss) and math.isfinite(state.solution.time_to_go)):
            break
        if miss < settings.velocity_to_go_tolerance and moved < settings.jettison_time_tolerance:
            return ERROR_NONE, reachable
    return ERROR_NOT_CONVERGED, reachable


@kernel
def settle(mission: MissionRecords, onboard: Onboard) -> int:
    """Tighten the convergence in the last cycle before the steering is held.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns:
        ERROR_NONE, immediately in any other cycle, or ERROR_NOT_CONVERGED.
    """
    settings = onboard.settings
    solution = onboard.state.solution
    if solution.time_to_go > settings.hold_time + settings.cycle_period:
        return ERROR_NONE
    for _ in range(LAST_PASSES):
        if solution.miss_speed < LAST_SHARE * settings.velocity_to_go_tolerance:
            return ERROR_NONE
        solution.miss_speed, _, _ = iterate(mission, onboard)
        onboard.state.iterations += 1
    return ERROR_NOT_CONVERGED


@kernel
def begin_again(mission: MissionRecords, onboard: Onboard, cold: bool) -> None:
    """Restore the initial guess of the search."""
    if cold:
        start_guess(mission, onboard)
    else:
        onboard.state.solution = onboard.state.saved


@kernel
def goes_far(mission: MissionRecords, onboard: Onboard) -> bool:
    """Return whether the burn ahead covers more of the orbit than a pass predicts gravity for.

    A pass predicts it by one coast, or by the mean of both ends, and its turn says nothing of the
    error there.
    """
    radius = norm(load(onboard.navigation.position))
    rate = math.sqrt(mission.environment.mu / radius**3)
    farthest = PIECE if LAW == LAW_PEG else FAR_BY_MEAN
    return rate * onboard.state.solution.time_to_go > farthest


@kernel
def seek_free(mission: MissionRecords, onboard: Onboard, cold: bool) -> tuple[int, bool]:
    """Solve with the cut-off free, by small angles if possible, else by large angles.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Changed.
        cold: there is no solution to continue from.

    Returns: as in :func:`converge`.
    """
    state = onboard.state
    state.turn.held = 0.0
    limit = onboard.settings.small_turn_limit
    by_orbit = state.leg.count > 0 or mission.target.kind == TARGET_ELEMENTS
    if (state.found.count > 0 or by_orbit) and math.isfinite(limit):
        limit = min(limit, SMALL_WHERE_LONG)
        if by_orbit and goes_far(mission, onboard):
            limit = 0.0
    small_does = False
    dear, short = 0.0, math.inf
    if state.solution.primer.gradient == 0.0:
        state.law = LAW
        error, reachable = converge(mission, onboard)
        if math.isinf(limit):
            return error, reachable
        good = error == ERROR_NONE and reachable and state.solution.turn <= limit
        released = may_release_place(mission, onboard, state.solution.turn, math.inf)
        released = released or state.solution.released == 1
        # where the place is free the pass moves the aim instead, if it has not just begun
        released = released and not (good and leaves_place_free(mission.target))
        if error == ERROR_NONE and reachable and released:
            # too short a burn to correct the place: it meets the orbit's speed there
            return error, True
        # too late to correct the position: accept a solution for speed and angle
        late = state.solution.time_to_go <= onboard.settings.restart_time
        small = state.solution.turn < STEEPEST or not reachable or late
        small_does = error == ERROR_NONE and small
        short = lacking_speed(state) if small_does and cold else math.inf
        # a first solution may lack propellant only because of its small-angle expansion
        dear = short if good and cold else 0.0
        if good and not dear > SETTLED and settle(mission, onboard) == ERROR_NONE:
            return ERROR_NONE, True
        if good or error != ERROR_NONE or state.leg.time_to_go > 0.0:
            begin_again(mission, onboard, cold)
    state.law = LAW_PEG
    error = converge_large_turn(mission, onboard)
    if error != ERROR_NONE and cold:
        error = converge_lofted(mission, onboard)
    lacks = lacking_speed(state) if cold and error == ERROR_NONE else 0.0
    worse = dear > SETTLED and error == ERROR_NONE and not lacks < dear
    # it may know nothing of a jettison that is to come
    worse = worse or lacks - short > FAR_SHORT * norm(load(state.solution.velocity_to_go))
    if (error != ERROR_NONE or worse) and small_does:
        state.law = LAW
        begin_again(mission, onboard, cold)
        return converge(mission, onboard)
    return error, True


@kernel
def ends_by_clock(mission: MissionRecords, state: Record) -> bool:
    """Return whether the last burn of a leg has a least length: of a burn of fixed length, its own.

    Args:
        mission: the leg as a mission.
        state: record GUIDANCE_STATE.
    """
    return state.leg.count > 0 and mission.arcs[mission.arcs.shape[0] - 1].shortest > 0.0


@kernel
def seek(mission: MissionRecords, onboard: Onboard, cold: bool) -> tuple[int, bool]:
    """Solve with the arcs before the last flown in full.

    Args: as in :func:`seek_free`.

    Returns: as in :func:`seek_free`; the target counts as out of reach if surplus delta-V of the
        earlier arcs cannot be spent.
    """
    state = onboard.state
    if state.turn.held > 0.0:
        plan_segments(mission, onboard)
        least = least_time_to_go(mission.arcs, onboard.navigation, state)
        if converge_held(mission, onboard, least) == ERROR_NONE:
            return ERROR_NONE, True
        begin_again(mission, onboard, cold)
    error, reachable = seek_free(mission, onboard, cold)
    if error != ERROR_NONE:
        return error, reachable
    least = least_time_to_go(mission.arcs, onboard.navigation, state)
    surplus = least - state.solution.time_to_go
    clocked = ends_by_clock(mission, state)
    if clocked:
        surplus -= SAME_LENGTH * least
    if surplus <= 0.0 or least <= onboard.settings.hold_time:
        return error, reachable
    if state.lowered > 0.0:
        # a surplus brings the full target nearer, before any of it is spent
        return error, reachable
    if converge_held(mission, onboard, least) != ERROR_NONE:
        # a later leg corrects the surplus
        reachable = reachable and clocked
    state.solution.time_to_go = least
    return error, reachable
