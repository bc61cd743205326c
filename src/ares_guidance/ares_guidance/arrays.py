# SPDX-License-Identifier: Apache-2.0
"""Structured dtypes of the guidance laws: named settings, state between cycles."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    ARC,
    JETTISON,
    MAX_ARCS,
    MAX_JETTISONS,
    NAVIGATION,
    STEERING,
    TARGET,
    Record,
)
from ares_optimizer.two_point.arrays import MAX_COLUMNS, OPTIONS, WORK

MAX_SEGMENTS = 32

LAW_PEG = 1
LAW_IGM = 3
LAW_OPTIMAL = 4

PHASE_IDLE = 0
PHASE_CONVERGING = 1
PHASE_TRACKING = 2
PHASE_HOLD = 3
PHASE_CUTOFF = 4

ERROR_NONE = 0
ERROR_NOT_CONVERGED = 1
ERROR_NAVIGATION_INVALID = 2
ERROR_STEERING_JUMP = 3
ERROR_TIME_TO_GO_JUMP = 4
ERROR_PROPELLANT_SHORT = 5
ERROR_TARGET_UNREACHABLE = 6

#: Why a navigation state was refused, bits.
REFUSED_IMPLAUSIBLE = 1
REFUSED_TIME = 2
REFUSED_FROZEN = 4
REFUSED_SEQUENCE = 8
REFUSED_POSITION = 16
REFUSED_VELOCITY = 32
REFUSED_MASS = 64
REFUSED_DRIFT = 128

#: Which monitor an answer has set off, bits.
MONITOR_DIRECTION = 1
MONITOR_TIME_TO_GO = 2
MONITOR_JETTISON = 4
MONITOR_DEPLETION = 8
MONITOR_WORK = 16
MONITOR_STEERING_RATE = 32

HEATING_MODELLED = 0
HEATING_MEASURED = 1

#: rad from the mean; a turn held to it misses the position, and is no solution.
STEEPEST = 1.0

GUIDANCE_SETTINGS = np.dtype(
    [
        ("cycle_period", np.float64),  # s between guidance cycles
        ("hold_time", np.float64),  # s before cut-off from which the steering is frozen
        ("velocity_to_go_tolerance", np.float64),  # m/s, change in one iteration
        ("jettison_time_tolerance", np.float64),  # s, change in one iteration
        ("max_iterations", np.int64),  # in one cycle
        ("max_solve_iterations", np.int64),  # of law optimal, in one search
        ("steering_jump_limit", np.float64),  # rad between accepted solutions
        ("time_to_go_jump_limit", np.float64),  # s between accepted solutions
        ("max_stale_cycles", np.int64),  # then start again from nothing
        ("restart_time", np.float64),  # s to go below which the steering is held instead
        ("heating_source", np.int64),  # HEATING_MEASURED or HEATING_MODELLED
        ("heating_margin", np.float64),  # drop at limit x (1 - margin)
        ("small_turn_limit", np.float64),  # rad; beyond it no angle is taken as small
        # what a navigation state may differ by from the one before it, carried on to now
        ("navigation_gate", np.float64),  # sigmas
        ("position_sigma", np.float64),  # m, per axis
        ("velocity_sigma", np.float64),  # m/s, per axis
        ("acceleration_sigma", np.float64),  # m/s2 of gravity that the mission does not have
        ("sensed_sigma", np.float64),  # fraction of the sensed gain
        ("mass_sigma", np.float64),  # fraction, of one state against another
        ("load_sigma", np.float64),  # fraction, of the mission's masses
        ("navigation_window", np.float64),  # s over which a drift is looked for
        ("steering_rate_limit", np.float64),  # rad/s
    ],
    align=True,
)

SEGMENT = np.dtype(
    [
        ("start", np.float64),  # s from now
        ("duration", np.float64),  # s; inf for the free burn
        ("gain", np.float64),  # m/s over the whole of it; inf for the free burn
        ("exhaust_velocity", np.float64),  # m/s
        ("tau", np.float64),  # s, mass over mass flow at the start of the segment
        ("acceleration", np.float64),  # m/s2, to which it is throttled; 0: constant thrust
        ("held_at", np.float64),  # s from now, where its direction is taken; nan: as it turns
        ("arc", np.int64),
        ("capacity", np.float64),  # s until the propellant is gone
    ],
    align=True,
)

OPTIMAL_MEMORY = np.dtype(
    [
        ("solved", np.int64),  # 1: unknowns hold the solution of the last cycle
        ("age", np.int64),  # cycles since the Jacobian
        ("time", np.float64),  # s, where lambda_v and lambda_r hold
        ("jettisoned", np.int64),
        ("unknowns", np.float64, (MAX_COLUMNS,)),
        ("jettisons", JETTISON, (MAX_JETTISONS,)),  # with the limits in on-board units
        ("arcs", ARC, (MAX_SEGMENTS,)),  # with the engines as measured
        ("arcs_from", np.int64),  # the arc at which they were copied, + 1
        # where the ends of arcs are planned: the mission's own lengths, inf: free
        ("duration", np.float64, (MAX_ARCS,)),
        ("solved_in", np.int64),  # arc of the last solution
        ("wasted", np.int64),  # steps of the integrator in searches that found nothing
        ("first_start", np.int64),  # own guess that the next search begins with
        ("searched_in", np.int64),  # the cycle
        ("steps_left", np.int64),  # in it
        ("wasted_in", np.int64),  # the arc in which that was, + 1
        ("thrust_ratio", np.float64),
        ("flow_ratio", np.float64),
        ("options", OPTIONS),
        ("work", WORK),
    ],
    align=True,
)

ENGINE_WATCH = np.dtype(
    [  # the navigation state at the last measurement
        ("time", np.float64),
        ("mass", np.float64),  # 0: none yet
        ("sensed_delta_v", np.float64, (3,)),
        ("arc", np.int64),
        ("stage", np.int64),
        ("jettisoned", np.int64),
        ("jumped", np.int64),  # 1: the engine is another than in the last cycle
    ],
    align=True,
)

#: What is aimed at: the mission's target, an orbit that is safe; where that is out of reach too,
#: the target again, lowered. Near: all of it but the radius.
AIM_TARGET = 0
AIM_SAFE = 1
AIM_BELOW = 2
AIM_NEAR = 3

#: Whether a solution knows of what was found: it does, no cycle has sought one, none was found.
SOLVED = 0
JUST_FOUND = 1
UNSOLVED = 2

FOUND_NOTHING = 0
FOUND_ENGINE_LOST = 1
FOUND_THRUST_LOW = 2
FOUND_EARLY_END = 3
FOUND_NO_IGNITION = 4
FOUND_STUCK_THROTTLE = 5
FOUND_STUCK_JETTISON = 6

#: What has failed, as far as navigation shows it.
FOUND = np.dtype(
    [
        ("kind", np.int64),  # FOUND_*, the last that was found
        ("count", np.int64),  # how often something was found
        ("first_kind", np.int64),
        ("first_time", np.float64),  # s
        ("time", np.float64),  # of the last, s
        ("ratio", np.float64),  # measured over expected: thrust, or acceleration
        ("index", np.int64),  # arc or jettison, by kind
        ("fresh", np.int64),  # SOLVED, or there is no solution yet that knows of it
        ("sensed_delta_v", np.float64, (3,)),  # at the last state, m/s
        ("gain", np.float64),  # sensed since the last look, from state to state, m/s
        ("refused", np.int64),  # states, by the last look
        # the navigation state at the last look
        ("seen", np.float64),  # s
        ("mass", np.float64),  # 0: none yet
        ("arc", np.int64),
        ("arc_start_time", np.float64),
        ("jettisoned", np.int64),
        # of the present stage
        ("thrust", np.float64),  # measured over planned thrust; 0: not measured yet
        ("flow", np.float64),  # the same of the mass flow
        ("looks", np.int64),  # from which these are
        ("total", np.float64),  # product of the thrust ratios found since it began
        ("total_flow", np.float64),  # the same of the mass flow
        ("spread", np.float64),  # by which these may be off
        ("before", np.float64),  # thrust ratio of the look before; 0: no thrust in it
        ("overdue", np.float64, (MAX_JETTISONS,)),  # since when, s; inf: it is not
    ],
    align=True,
)

#: The vehicle after failures.
LEFT = np.dtype(
    [
        ("count", np.int64),  # of arcs; 0: nothing has changed
        ("arcs", ARC, (MAX_ARCS,)),
        ("jettisons", JETTISON, (MAX_JETTISONS,)),
        # lengths of the arcs, s, where the clock ends them, and where the propellant does
        ("by_clock", np.float64, (MAX_ARCS,)),
        ("by_propellant", np.float64, (MAX_ARCS,)),
    ],
    align=True,
)

#: What is done with the impact point, where no orbit is in reach: nothing, since one is; nothing,
#: since it stays outside the areas by itself; turned away; cut off before it enters one; or all in
#: vain, and as little inside as can be.
AVOID_NOTHING = 0
AVOID_CLEAR = 1
AVOID_STEER = 2
AVOID_CUT = 3
AVOID_LOST = 4

#: Where a flight ahead has come to.
WAY = np.dtype(
    [
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),
        ("arc", np.int64),
        ("begin", np.float64),  # s, of the arc
        ("end", np.float64),  # s, by the clock; inf: none
        ("lit", np.float64),  # s, from when it gives thrust; inf: never
        ("empty", np.float64),  # kg, where its propellant is gone
        ("over", np.int64),  # 1: no thrust any more
    ],
    align=True,
)

#: What becomes of the impact point on a flight ahead.
OUTLOOK = np.dtype(
    [
        ("outside", np.float64),  # m from the areas in the end; inf: it falls nowhere
        ("inside", np.float64),  # s that it is within one
        ("area", np.int64),  # which it enters first, or else ends nearest to; -1: none
        ("cut_time", np.float64),  # s, before it enters one; inf: it does not, or cannot be
        ("cut_inside", np.float64),  # s within one until then
        ("end_time", np.float64),  # s, of the thrust
        ("grounded", np.int64),  # 1: it meets the ground with thrust
    ],
    align=True,
)

AVOID = np.dtype(
    [
        ("mode", np.int64),  # AVOID_*
        ("next_time", np.float64),  # s, of the next look
        ("area", np.int64),  # that the flight would end in, or enter; -1: none
        ("direction", np.float64, (3,)),  # to which the thrust is turned
        ("cutoff_time", np.float64),  # s; nan: the law's own
        ("end_time", np.float64),  # s, of the thrust as the law steers
        ("score", np.float64),  # of what is done
        ("outside", np.float64),  # m, in the end
        ("own", STEERING),  # the law's last answer
        ("flown", STEERING),  # the last answer
        ("outlook", OUTLOOK),
        ("way", WAY),
        ("mark", WAY),
        ("kept", WAY),
    ],
    align=True,
)

#: Primer at the reference, its rate, time to go.
TURN_UNKNOWNS = 7

TURN_WORK = np.dtype(
    [
        ("reference", np.float64),  # s from now
        ("time_scale", np.float64),  # s
        ("speed_scale", np.float64),  # m/s
        ("length_scale", np.float64),  # m
        ("first_direction", np.float64, (3,)),
        ("pull", np.float64),  # downrange, where the burn gives more than the target needs
        ("held", np.float64),  # s, time to go that is not free; 0: it is
        ("unknowns", np.float64, (TURN_UNKNOWNS,)),
        ("before", np.float64, (TURN_UNKNOWNS,)),
        ("step", np.float64, (TURN_UNKNOWNS,)),
        # residuals, and behind them those with one unknown moved each
        ("rows", np.float64, (TURN_UNKNOWNS + 1, TURN_UNKNOWNS)),
        ("matrix", np.float64, (TURN_UNKNOWNS, TURN_UNKNOWNS)),
        ("pivots", np.int64, (TURN_UNKNOWNS,)),
    ],
    align=True,
)

#: The gravity gradient that a primer follows: its axis goes round with the vehicle.
PRIMER = np.dtype(
    [
        ("gradient", np.float64),  # its root, 1/s; 0: the turn is small, the primer a line
        ("turning", np.float64),  # of the axis, 1/s
        ("axis", np.float64, (3,)),  # up, now
        ("normal", np.float64, (3,)),  # which it turns about
    ],
    align=True,
)

#: What an iteration changes: a failed cycle puts it back as it was.
SOLUTION = np.dtype(
    [
        ("time_to_go", np.float64),
        ("velocity_to_go", np.float64, (3,)),
        ("gravity_displacement", np.float64, (3,)),
        ("gravity_time", np.float64),  # s of flight that it holds for
        ("displacement_bias", np.float64, (3,)),
        ("desired_position", np.float64, (3,)),
        ("plane_normal", np.float64, (3,)),
        ("direction", np.float64, (3,)),
        ("direction_rate", np.float64, (3,)),
        ("reference_time", np.float64),
        ("turn", np.float64),  # rad, the largest from the mean that a pass asked for
        ("primer", PRIMER),
        ("miss_speed", np.float64),  # m/s, change of velocity_to_go in the last iteration
        ("tail_gain", np.float64),  # s of full thrust that follow the cut-off command
        ("tail_drift", np.float64),  # s by which the tail outlasts them
        # of heating jettisons, MET; inf: beyond cut-off, planned without
        ("jettison_time", np.float64, (MAX_JETTISONS,)),
        # of free arcs, MET; nan: not free, past, or not planned
        ("arc_end_times", np.float64, (MAX_ARCS,)),
    ],
    align=True,
)

#: A navigation state, and three sums that good navigation leaves as they are: position less the
#: integral of velocity, velocity less those of gravity and of thrust, and the mass's likewise.
NAVIGATION_FIX = np.dtype(
    [
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("gravity", np.float64, (3,)),  # m/s2
        ("mass", np.float64),
        ("sensed_delta_v", np.float64, (3,)),
        ("arc", np.int64),
        ("arc_start_time", np.float64),
        ("jettisoned", np.int64),
        ("position_sum", np.float64, (3,)),  # m
        ("velocity_sum", np.float64, (3,)),  # m/s
        ("mass_sum", np.float64),  # of logarithms
        # by how much the sums may have moved for all that is known of the thrust, so far
        ("position_slack", np.float64),  # m
        ("mass_slack", np.float64),
    ],
    align=True,
)

NAVIGATION_WATCH = np.dtype(
    [
        ("accepted", np.int64),  # states
        ("refused", np.int64),  # states
        ("row", np.int64),  # refused since the last accepted one
        ("repeats", np.int64),  # of the last accepted one
        ("reasons", np.int64),  # REFUSED_* bits of the present row
        ("acquired", np.int64),  # how often a row ended with a new beginning
        ("told", np.int64),  # how often a refusal was worth a status
        ("told_time", np.float64),  # of the last such state
        ("interval", np.float64),  # s between the last two accepted
        ("last", NAVIGATION_FIX),  # accepted
        ("now", NAVIGATION_FIX),
        # of those accepted: where drifts are counted from now, and next
        ("anchor", NAVIGATION_FIX),
        ("next_anchor", NAVIGATION_FIX),
        # of those refused: the first and the last that agree with one another
        ("agreeing", np.int64),  # how many do
        ("first_agreeing", NAVIGATION_FIX),
        ("last_agreeing", NAVIGATION_FIX),
    ],
    align=True,
)

MONITORS = np.dtype(
    [
        ("flags", np.int64),  # MONITOR_* bits of the last answer
        ("violated", np.int64),  # of all so far
        ("violations", np.int64),  # answers that were not let out
        ("kept", np.int64),  # 1: there is a last good answer
        ("good", STEERING),  # it
    ],
    align=True,
)

#: How a mission is flown that leaves more free than the end of its last arc.
PLAN = np.dtype(
    [
        ("made", np.int64),  # 1: it has the lengths of free arcs before the last
        ("by_legs", np.int64),  # 1: law optimal flies it leg by leg too
        ("aims", np.int64),  # 1: target of the last arc is where the mission's is met
        ("ends_leg", np.int64, (MAX_ARCS,)),  # 1: a burn that ends a leg, before the last arc
        ("length", np.float64, (MAX_ARCS,)),  # s, of free arcs and of burns that end a leg
        ("target", TARGET, (MAX_ARCS,)),  # at the end of a burn that ends a leg
        # of the first and the last thrust in the leg that ends with the arc; 0: not known
        ("direction", np.float64, (MAX_ARCS, 2, 3)),
        # primer at the begin of a burn's thrust, a unit vector, its rate, 1/s; nan: not known
        ("primer", np.float64, (MAX_ARCS, 2, 3)),
        ("ignition", np.float64, (MAX_ARCS,)),  # when that is, s
        ("position", np.float64, (MAX_ARCS, 3)),  # at the end of that leg, m; 0: not known
        ("jettison_time", np.float64),  # of heating jettisons, MET; nan: not known
    ],
    align=True,
)

#: The leg that is flown: the arcs up to the next burn that ends one, as a mission of its own.
LEG = np.dtype(
    [
        ("count", np.int64),  # its arcs, counted from the mission's first; 0: none yet
        ("arcs", ARC, (MAX_ARCS,)),
        ("target", TARGET),
        ("navigation", NAVIGATION),  # in a coast: at the next ignition
        ("coasting", np.int64),
        ("cycle_time", np.float64),  # s, of the next cycle in a coast
        ("steering", STEERING),  # its cut-off is the leg's
        ("begin", np.float64),  # s, of its first burn, or where it was entered
        # a guess for a search that begins, from the plan
        ("time_to_go", np.float64),  # s, to the end of the leg; 0: none
        ("first_direction", np.float64, (3,)),
        ("last_direction", np.float64, (3,)),
        ("end_position", np.float64, (3,)),  # m
        ("jettison_time", np.float64),  # of heating jettisons, MET
    ],
    align=True,
)

GUIDANCE_STATE = np.dtype(
    [
        ("law", np.int64),  # LAW_* that gave the last solution
        ("phase", np.int64),  # PHASE_*
        ("error", np.int64),  # ERROR_* of the last cycle
        ("cycle", np.int64),
        ("next_cycle_time", np.float64),
        ("iterations", np.int64),  # of the last cycle
        ("total_iterations", np.int64),
        ("stale_cycles", np.int64),
        ("time", np.float64),  # of the last navigation state
        ("sensed_delta_v", np.float64, (3,)),
        ("solution", SOLUTION),  # under iteration
        ("saved", SOLUTION),  # that before this cycle
        ("exact", SOLUTION),  # that to the target, while another is sought
        ("shortest", SOLUTION),  # that of least time, while one that lasts longer is sought
        ("predicted_position", np.float64, (3,)),
        ("predicted_velocity", np.float64, (3,)),
        ("aim", np.int64),  # AIM_*
        ("lowered", np.float64),  # m/s that the propellant is short of what is aimed at
        ("target", TARGET),  # what is aimed at: the mission's, or the best within reach
        # where to start instead of the scalar impulse
        ("seeded", np.int64),
        ("density_ratio", np.float64),  # measured over modelled heating; nan: unknown
        # engines of the present stage, measured over the mission's; 0: not yet
        ("thrust_ratio", np.float64),
        ("flow_ratio", np.float64),
        ("engines", ENGINE_WATCH),
        ("found", FOUND),
        ("left", LEFT),
        ("navigation", NAVIGATION_WATCH),
        ("monitors", MONITORS),
        ("segments", SEGMENT, (MAX_SEGMENTS,)),
        ("segment_count", np.int64),
        ("turn", TURN_WORK),
        ("optimal", OPTIMAL_MEMORY),
        ("plan", PLAN),
        ("leg", LEG),
        ("avoid", AVOID),
    ],
    align=True,
)


#: `LawKind.memory` of a law that keeps nothing but GUIDANCE_STATE between states.
NO_MEMORY = np.dtype([("none", np.int64)])


class OnboardArrays(NamedTuple):
    """What is on board of one flight, beside the mission.

    Attributes:
        navigation: shape (1,), dtype NAVIGATION, the present state.
        settings: shape (1,), dtype GUIDANCE_SETTINGS.
        state: shape (1,), dtype GUIDANCE_STATE; all zero before the first step.
        steering: shape (1,), dtype STEERING, the answer.
        memory: shape (1,), of the law's own dtype; all zero before the first step, unless the
            law puts a plan there.
    """

    navigation: NDArray[Any]
    settings: NDArray[Any]
    state: NDArray[Any]
    steering: NDArray[Any]
    memory: NDArray[Any]


class Onboard(NamedTuple):
    """The same as kernels hand it to one another, as records; the law's own memory goes apart."""

    navigation: Record
    settings: Record
    state: Record
    steering: Record


def blank_onboard(settings: NDArray[Any], memory: np.dtype[Any] = NO_MEMORY) -> OnboardArrays:
    """Lay out what is on board before a flight: nothing known, nothing answered.

    Args:
        settings: shape (1,), dtype GUIDANCE_SETTINGS.
        memory: the law's own.
    """
    steering = np.zeros(1, STEERING)
    steering["cutoff_time"] = np.nan
    steering["jettison"] = -1
    steering["jettison_time"] = np.nan
    steering["arc_end_times"] = np.nan
    return OnboardArrays(
        np.zeros(1, NAVIGATION),
        settings,
        np.zeros(1, GUIDANCE_STATE),
        steering,
        np.zeros(1, memory),
    )
