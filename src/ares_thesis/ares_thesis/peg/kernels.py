# SPDX-License-Identifier: Apache-2.0
"""PEG as flown in the thesis: one target after another (sections 5.3.4 and 6.4).

Mode 1 steers from the start through staging, mode 2 from staging, both to the jettison with
its full state: radius, speed, flight-path angle and plane. Mode 3 steers to the mission's
target. Each mode starts from the scalar delta-V along the velocity (Eq. 6.1) and makes one
predictor-corrector pass per cycle. Passes are flown even before they converge: the thesis
describes a transient of "the first ten passes" (Fig. 6.15).

Beyond the thesis: mode 2 is rejected if it converges far from the solution of mode 1. Over so
short an arc the full target has a second solution, which climbs for minutes.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    ERROR_NONE,
    ERROR_NOT_CONVERGED,
    ERROR_TIME_TO_GO_JUMP,
    PHASE_CONVERGING,
    PHASE_HOLD,
    PHASE_IDLE,
    PHASE_TRACKING,
    Onboard,
)
from ares_guidance.kernels.cycle import accept, adopt_steering, guidance_step
from ares_guidance.kernels.laws.start import start_guess
from ares_guidance.kernels.plans.legs import aimed_by_plan, set_aim
from ares_models.arrays import (
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionRecords,
    Record,
)
from ares_models.jit import inlined, kernel
from ares_models.kernels.vectors import cross, is_finite, load, scale, store, unit
from ares_thesis.peg.arrays import LAW_PEG_THESIS, PLANE_FREE, PLANE_OF_MODE


@kernel
def mode_of(nav: Record, arcs: NDArray[Any], memory: Record) -> int:
    """Return the present mode of the flight: 1, 2 or 3."""
    if nav.jettisoned & 1 == 1:
        return 3
    if arcs[nav.arc].stage > 0 and memory.split_at_staging == 1:
        return 2
    return 1


@inlined
def mission_to_jettison(mission: MissionRecords, memory: Record) -> MissionRecords:
    """Return the mission of modes 1 and 2, which ends at the jettison as its target."""
    return MissionRecords(
        mission.environment,
        mission.atmosphere,
        memory.early_arcs[: mission.arcs.shape[0]],
        mission.jettisons[:0],
        memory.target,
    )


@inlined
def with_settings(onboard: Onboard, rules: Record) -> Onboard:
    """Return the state of guidance with the settings of a mode."""
    return Onboard(onboard.navigation, rules, onboard.state, onboard.steering)


@kernel
def hold_plane(nav: Record, memory: Record) -> None:
    """Write the plane constraint into the jettison's target.

    It has the ascending node of the present state and the inclination of the target.

    Args:
        nav: record NAVIGATION.
        memory: record THESIS_MEMORY. Changed.
    """
    target = memory.target
    if memory.plane == PLANE_FREE:
        target.kind = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
        return
    target.kind = TARGET_RADIUS_SPEED_ANGLE_PLANE
    if memory.mode == 0 or memory.plane == PLANE_OF_MODE:
        h = cross(load(nav.position), load(nav.velocity))
        target.ascending_node = math.atan2(h[0], -h[1])


@kernel
def keep_fallback(onboard: Onboard, memory: Record) -> None:
    """Save the solution in force, with the jettison as its end."""
    state = onboard.state
    steering = onboard.steering
    good = state.phase == PHASE_TRACKING or state.phase == PHASE_HOLD
    memory.fallback = 1 if good else 0
    memory.fallback_jettison_time = memory.jettison_time
    memory.fallback_reference_time = steering.reference_time
    store(memory.fallback_direction, load(steering.direction))
    store(memory.fallback_direction_rate, load(steering.direction_rate))


@kernel
def fly_fallback(onboard: Onboard, memory: Record) -> None:
    """Hold the saved solution until the jettison."""
    state = onboard.state
    steering = onboard.steering
    steering.cutoff_time = memory.fallback_jettison_time
    steering.reference_time = memory.fallback_reference_time
    store(steering.direction, load(memory.fallback_direction))
    store(steering.direction_rate, load(memory.fallback_direction_rate))
    adopt_steering(onboard)
    state.phase = PHASE_HOLD


@kernel
def begin_mode(mission: MissionRecords, onboard: Onboard, mode: int, memory: Record) -> None:
    """Start a mode: set its target, and its first velocity-to-go by Eq. 6.1.

    Args:
        mission: of the mode.
        onboard: state of guidance with the settings of the mode. Changed.
        mode: 1, 2 or 3.
        memory: record THESIS_MEMORY. Changed.
    """
    nav = onboard.navigation
    state = onboard.state
    memory.fallback = 0
    if mode == 2 and memory.mode == 1:
        keep_fallback(onboard, memory)
    state.stale_cycles = 0
    state.solution.tail_gain = 0.0
    state.next_cycle_time = nav.time
    state.time = nav.time
    store(state.sensed_delta_v, load(nav.sensed_delta_v))
    if memory.fallback == 1 and memory.jettison_time - nav.time <= onboard.settings.hold_time:
        # too late for more than holding the steering
        memory.mode = mode
        fly_fallback(onboard, memory)
        return
    speed = memory.delta_v[mode - 1]
    if mode == 1:
        speed += memory.delta_v[1]
    if mode < 3:
        hold_plane(nav, memory)
    memory.mode = mode
    state.phase = PHASE_CONVERGING
    state.seeded = 1
    store(state.solution.velocity_to_go, scale(speed, unit(load(nav.velocity))))
    for j in range(state.solution.jettison_time.shape[0]):
        state.solution.jettison_time[j] = math.inf
    start_guess(mission, onboard)


@kernel
def fly_mode(mission: MissionRecords, onboard: Onboard, mode: int, memory: Record) -> None:
    """Step a mode towards its own target.

    Args: as in :func:`begin_mode`.
    """
    state = onboard.state
    steering = onboard.steering
    now = onboard.navigation.time
    if mode != memory.mode:
        begin_mode(mission, onboard, mode, memory)
    elif (
        state.phase == PHASE_CONVERGING and steering.cutoff_time - now <= onboard.settings.hold_time
    ):
        # too late to converge
        adopt_steering(onboard)
        state.phase = PHASE_HOLD
    before = state.cycle
    guidance_step(mission, onboard)
    state.law = LAW_PEG_THESIS
    if (
        state.phase == PHASE_CONVERGING
        and state.cycle != before
        and is_finite(load(state.solution.direction))
        and is_finite(load(state.solution.direction_rate))
        and math.isfinite(state.solution.time_to_go)
    ):
        # fly the pass although it has not converged
        accept(onboard)
        state.error = ERROR_NONE
        state.stale_cycles = 0
    if state.phase == PHASE_TRACKING and state.error == ERROR_NOT_CONVERGED:
        # a change of engines can undo the convergence
        state.phase = PHASE_CONVERGING


@kernel
def fly_to_jettison(mission: MissionRecords, onboard: Onboard, mode: int, memory: Record) -> None:
    """Step mode 1 or 2 and command its "cut-off" as the jettison.

    Args: as in :func:`begin_mode`.
    """
    nav = onboard.navigation
    rules = onboard.settings
    state = onboard.state
    steering = onboard.steering
    steering.cutoff_time = memory.jettison_time if memory.mode > 0 else math.nan
    fly_mode(mission, onboard, mode, memory)
    if (
        state.phase <= PHASE_TRACKING
        and memory.fallback == 1
        and abs(steering.cutoff_time - memory.fallback_jettison_time) > rules.time_to_go_jump_limit
    ):
        fly_fallback(onboard, memory)
        state.error = ERROR_TIME_TO_GO_JUMP
    memory.jettison_time = steering.cutoff_time
    if math.isfinite(memory.jettison_time):
        steering.jettison = 0
        steering.jettison_time = memory.jettison_time
        if state.phase == PHASE_CONVERGING:
            # no jettison before convergence
            steering.jettison_time = max(steering.jettison_time, nav.time + rules.hold_time)
        steering.cutoff_time = memory.jettison_time + memory.part_two


@kernel
def step_by_modes(mission: MissionRecords, onboard: Onboard, memory: Record) -> None:
    """Answer one navigation state by modes, or without a plan by the shared cycle.

    In modes 1 and 2 the cycle's "cut-off" is the jettison; the engine's cut-off is expected the
    planned length of part two later.

    Args:
        mission: as guidance believes it; with a plan two stages and one jettison.
        onboard: state of guidance with the settings of the shared cycle. Changed.
        memory: record THESIS_MEMORY. Changed.
    """
    nav = onboard.navigation
    state = onboard.state
    set_aim(mission, state)
    if memory.planned == 0:
        guidance_step(aimed_by_plan(mission, state), onboard)
        return
    if state.phase == PHASE_IDLE:
        # the flight begins, or navigation is acquired anew
        memory.mode = 0
        memory.fallback = 0
    mode = mode_of(nav, mission.arcs, memory)
    if mode == 3:
        late = with_settings(onboard, memory.late_rules)
        fly_mode(aimed_by_plan(mission, state), late, mode, memory)
    else:
        early = mission_to_jettison(mission, memory)
        fly_to_jettison(early, with_settings(onboard, memory.early_rules), mode, memory)
