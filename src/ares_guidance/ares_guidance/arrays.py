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
    MAX_PROGRAMME,
    NAVIGATION,
    STEERING,
    TARGET,
    Record,
)
from ares_optimizer.two_point.arrays import MAX_COLUMNS, OPTIONS, WORK

MAX_SEGMENTS = 64

LAW_PEG = 1
LAW_IGM = 3
LAW_OPTIMAL = 4

PHASE_IDLE = 0
PHASE_CONVERGING = 1
PHASE_TRACKING = 2
PHASE_HOLD = 3
PHASE_CUTOFF = 4
PHASE_BOOST = 5

ERROR_NONE = 0
ERROR_NOT_CONVERGED = 1
ERROR_NAVIGATION_INVALID = 2
ERROR_STEERING_JUMP = 3
ERROR_TIME_TO_GO_JUMP = 4
ERROR_PROPELLANT_SHORT = 5
ERROR_TARGET_UNREACHABLE = 6

#: Reasons for refusing a navigation state, bits.
REFUSED_IMPLAUSIBLE = 1
REFUSED_TIME = 2
REFUSED_FROZEN = 4
REFUSED_SEQUENCE = 8
REFUSED_POSITION = 16
REFUSED_VELOCITY = 32
REFUSED_MASS = 64
REFUSED_DRIFT = 128

#: Monitors that an answer has violated, bits.
MONITOR_DIRECTION = 1
MONITOR_TIME_TO_GO = 2
MONITOR_JETTISON = 4
MONITOR_DEPLETION = 8
MONITOR_WORK = 16
MONITOR_STEERING_RATE = 32

#: Flip of the thrust, half round in a moment, in the present burn: none, near, past.
FLIP_NONE = 0
FLIP_NEAR = 1
FLIP_PAST = 2

#: Steering in the air: the planned programme, or the optimum solved anew in each cycle.
BOOST_PROGRAMME = 0
BOOST_REPLAN = 1

HEATING_MODELLED = 0
HEATING_MEASURED = 1

#: Largest turn from the mean direction, rad. A turn clipped to it misses the position and is no
#: solution.
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
        ("max_stale_cycles", np.int64),  # then restart without a guess
        ("restart_time", np.float64),  # s to go; below it the steering is held, not restarted
        ("heating_source", np.int64),  # HEATING_MEASURED or HEATING_MODELLED
        ("heating_margin", np.float64),  # drop at limit x (1 - margin)
        ("boost_steering", np.int64),  # BOOST_PROGRAMME or BOOST_REPLAN
        ("small_turn_limit", np.float64),  # rad; beyond it no small-angle expansion is used
        # bounds on a navigation state against the previous one, propagated to now
        ("navigation_gate", np.float64),  # sigmas
        ("position_sigma", np.float64),  # m, per axis
        ("velocity_sigma", np.float64),  # m/s, per axis
        ("acceleration_sigma", np.float64),  # m/s2, error of the mission's gravity model
        ("sensed_sigma", np.float64),  # fraction of the sensed gain
        ("mass_sigma", np.float64),  # fraction, between two states
        ("load_sigma", np.float64),  # fraction, of the mission's stage and jettison masses
        ("navigation_window", np.float64),  # s over which a drift accumulates
        ("steering_rate_limit", np.float64),  # rad/s
    ],
    align=True,
)

SEGMENT = np.dtype(
    [
        ("start", np.float64),  # s from now
        ("duration", np.float64),  # s; inf for the free burn
        ("gain", np.float64),  # m/s over the whole segment; inf for the free burn
        ("exhaust_velocity", np.float64),  # m/s
        ("tau", np.float64),  # s, mass over mass flow at the start of the segment
        ("acceleration", np.float64),  # m/s2 that the throttle holds; 0: constant thrust
        # s from now, time of the steering that gives its held direction; nan: not held
        ("held_at", np.float64),
        ("arc", np.int64),
        ("capacity", np.float64),  # s until the propellant is gone
    ],
    align=True,
)

OPTIMAL_MEMORY = np.dtype(
    [
        ("solved", np.int64),  # 1: unknowns hold the solution of the last cycle
        ("flip", np.int64),  # FLIP_*
        ("age", np.int64),  # cycles since the Jacobian was computed
        ("time", np.float64),  # s, epoch of lambda_v and lambda_r
        ("jettisoned", np.int64),
        ("unknowns", np.float64, (MAX_COLUMNS,)),
        ("kept", np.float64, (MAX_COLUMNS,)),  # of the last solution, in a search after a flip
        ("jettisons", JETTISON, (MAX_JETTISONS,)),  # heating limits scaled to the modelled density
        ("arcs", ARC, (MAX_SEGMENTS,)),  # with the measured engines
        ("arcs_from", np.int64),  # 1 + index of the arc during which they were copied
        # the mission's own arc lengths, s, where a plan sets the ends; inf: free
        ("duration", np.float64, (MAX_ARCS,)),
        ("solved_in", np.int64),  # arc of the last solution
        ("wasted", np.int64),  # integrator steps in searches that failed
        ("first_start", np.int64),  # number of the built-in guess that the next search starts with
        ("searched_in", np.int64),  # cycle of the last search
        ("steps_left", np.int64),  # integrator steps left in that cycle
        ("wasted_in", np.int64),  # 1 + index of the arc that `wasted` counts in
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
        ("jumped", np.int64),  # 1: the thrust has stepped since the last cycle
    ],
    align=True,
)

#: Aim of guidance: the mission's target; the safe orbit; the lowered target where the safe orbit
#: is out of reach too; the target with its radius released.
AIM_TARGET = 0
AIM_SAFE = 1
AIM_BELOW = 2
AIM_NEAR = 3

#: Status of the solution after a failure: it accounts for the failure, no cycle has run yet, or no
#: solution has been found since.
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

#: Detected failure and the memory of its detection.
FOUND = np.dtype(
    [
        ("kind", np.int64),  # FOUND_* of the last finding
        ("count", np.int64),  # number of findings
        ("first_kind", np.int64),
        ("first_time", np.float64),  # s
        ("time", np.float64),  # of the last, s
        ("ratio", np.float64),  # measured over expected: thrust, or acceleration
        ("index", np.int64),  # arc or jettison, by kind
        ("fresh", np.int64),  # SOLVED, JUST_FOUND or UNSOLVED
        ("sensed_delta_v", np.float64, (3,)),  # at the last state, m/s
        ("gain", np.float64),  # sensed since the last check, summed state by state, m/s
        ("refused", np.int64),  # states refused up to the last check
        # the navigation state at the last check
        ("seen", np.float64),  # s
        ("mass", np.float64),  # 0: none yet
        ("arc", np.int64),
        ("arc_start_time", np.float64),
        ("jettisoned", np.int64),
        # of the present stage
        ("thrust", np.float64),  # measured over planned thrust; 0: not measured yet
        ("flow", np.float64),  # measured over planned mass flow
        ("looks", np.int64),  # measurements of the stage without a finding
        ("total", np.float64),  # product of the thrust ratios of all findings in the stage
        ("total_flow", np.float64),  # the same for the mass flow
        ("spread", np.float64),  # error bound of `total`
        ("before", np.float64),  # thrust ratio at the previous check; 0: no thrust then
        ("overdue", np.float64, (MAX_JETTISONS,)),  # time since which it is overdue, s; inf: not
    ],
    align=True,
)

#: Arcs and jettisons of the vehicle after failures.
LEFT = np.dtype(
    [
        ("count", np.int64),  # number of arcs; 0: no failure
        ("arcs", ARC, (MAX_ARCS,)),
        ("jettisons", JETTISON, (MAX_JETTISONS,)),
        # lengths of the arcs, s, if ended by the clock and if ended by depletion
        ("by_clock", np.float64, (MAX_ARCS,)),
        ("by_propellant", np.float64, (MAX_ARCS,)),
    ],
    align=True,
)

#: Impact-point avoidance, where no orbit is in reach: none (an orbit is in reach); clear (the
#: impact point stays outside the areas by itself); steered away; cut off before it enters an area;
#: lost (it cannot be kept clear, and ends as little inside as possible).
AVOID_NOTHING = 0
AVOID_CLEAR = 1
AVOID_STEER = 2
AVOID_CUT = 3
AVOID_LOST = 4

#: State of the flight that is propagated ahead.
LOOKAHEAD = np.dtype(
    [
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),
        ("arc", np.int64),
        ("begin", np.float64),  # s, start of the arc
        ("end", np.float64),  # s, its end by the clock; inf: none
        ("lit", np.float64),  # s, start of its thrust; inf: never
        ("empty", np.float64),  # kg, mass at depletion
        ("over", np.int64),  # 1: all thrust is over
    ],
    align=True,
)

#: Impact point over the flight that is propagated ahead.
OUTLOOK = np.dtype(
    [
        ("outside", np.float64),  # m from the areas at the end; inf: no impact
        ("inside", np.float64),  # s spent inside an area
        ("area", np.int64),  # first area entered, else the nearest at the end; -1: none
        # s, cut-off before it enters an area; inf: it enters none, or no cut-off is possible
        ("cut_time", np.float64),
        ("cut_inside", np.float64),  # s inside an area before that cut-off
        ("end_time", np.float64),  # s, end of the thrust
        ("grounded", np.int64),  # 1: it reaches the ground under thrust
    ],
    align=True,
)

AVOID = np.dtype(
    [
        ("mode", np.int64),  # AVOID_*
        ("next_time", np.float64),  # s, time of the next decision
        ("area", np.int64),  # area that the flight would enter or end in; -1: none
        ("direction", np.float64, (3,)),  # commanded thrust direction
        ("cutoff_time", np.float64),  # s; nan: the law's own
        ("end_time", np.float64),  # s, end of the thrust under the law's steering
        ("score", np.float64),  # cost of the choice in force
        ("outside", np.float64),  # m from the areas at the end
        ("own", STEERING),  # last answer of the law
        ("flown", STEERING),  # last answer sent to the vehicle
        ("outlook", OUTLOOK),
        ("lookahead", LOOKAHEAD),
        ("mark", LOOKAHEAD),  # at the start of the last step
        ("kept", LOOKAHEAD),  # saved while the cut-off is bisected
    ],
    align=True,
)

#: Number of unknowns: primer at the reference (3), its rate (3), time to go (1).
TURN_UNKNOWNS = 7

TURN_WORK = np.dtype(
    [
        ("reference", np.float64),  # s from now
        ("time_scale", np.float64),  # s
        ("speed_scale", np.float64),  # m/s
        ("length_scale", np.float64),  # m
        ("first_direction", np.float64, (3,)),
        ("pull", np.float64),  # downrange multiplier that spends surplus delta-V
        ("held", np.float64),  # s, prescribed time to go; 0: free
        ("unknowns", np.float64, (TURN_UNKNOWNS,)),
        ("before", np.float64, (TURN_UNKNOWNS,)),
        ("step", np.float64, (TURN_UNKNOWNS,)),
        # row 0: residuals; row 1 + k: residuals with unknown k perturbed
        ("rows", np.float64, (TURN_UNKNOWNS + 1, TURN_UNKNOWNS)),
        ("matrix", np.float64, (TURN_UNKNOWNS, TURN_UNKNOWNS)),
        ("pivots", np.int64, (TURN_UNKNOWNS,)),
        ("factored", np.int64),  # 1: matrix and pivots hold the factors of the last Jacobian
    ],
    align=True,
)

#: Gravity gradient that drives the primer; its axis rotates with the vehicle.
PRIMER = np.dtype(
    [
        ("gradient", np.float64),  # square root of the gradient, 1/s; 0: linear primer, small turn
        ("turning", np.float64),  # rotation rate of the axis, rad/s
        ("axis", np.float64, (3,)),  # radial unit vector now
        ("normal", np.float64, (3,)),  # rotation axis
    ],
    align=True,
)

#: Variables of the iteration; a failed cycle restores them.
SOLUTION = np.dtype(
    [
        ("time_to_go", np.float64),
        ("velocity_to_go", np.float64, (3,)),
        ("gravity_displacement", np.float64, (3,)),
        ("gravity_time", np.float64),  # s of flight that gravity_displacement covers
        ("displacement_bias", np.float64, (3,)),
        ("desired_position", np.float64, (3,)),
        ("plane_normal", np.float64, (3,)),
        ("direction", np.float64, (3,)),
        ("direction_rate", np.float64, (3,)),
        ("reference_time", np.float64),
        ("turn", np.float64),  # rad, largest turn from the mean direction in the last pass
        ("released", np.int64),  # 1: the last pass left the place as it comes
        ("primer", PRIMER),
        ("miss_speed", np.float64),  # m/s, change of velocity_to_go in the last iteration
        ("tail_gain", np.float64),  # s of full thrust with the impulse of the tail-off
        ("tail_drift", np.float64),  # s by which the tail-off outlasts tail_gain
        # of heating jettisons, MET, s; inf: after cut-off, not planned
        ("jettison_time", np.float64, (MAX_JETTISONS,)),
        # of free arcs, MET, s; nan: not free, past, or not planned
        ("arc_end_times", np.float64, (MAX_ARCS,)),
    ],
    align=True,
)

#: A navigation state and three sums that stay constant under good navigation: position minus the
#: integral of velocity, velocity minus the integrals of gravity and of thrust, and the logarithm
#: of mass minus that of its depletion.
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
        ("mass_sum", np.float64),  # of logarithms of mass ratios
        # accumulated bounds on the change of the sums due to the unknown thrust
        ("position_slack", np.float64),  # m
        ("mass_slack", np.float64),
    ],
    align=True,
)

NAVIGATION_WATCH = np.dtype(
    [
        ("accepted", np.int64),  # states
        ("refused", np.int64),  # states
        ("row", np.int64),  # consecutive refusals since the last accepted state
        ("repeats", np.int64),  # repetitions of the last accepted state
        ("reasons", np.int64),  # REFUSED_* bits of the present row of refusals
        ("acquired", np.int64),  # number of reacquisitions
        ("reported", np.int64),  # number of refusals that were reported in a status
        ("reported_time", np.float64),  # s, time of the last such state
        ("interval", np.float64),  # s between the last two accepted states
        ("last", NAVIGATION_FIX),  # last accepted state
        ("now", NAVIGATION_FIX),
        # accepted states that drift is measured from: the present and the next reference
        ("anchor", NAVIGATION_FIX),
        ("next_anchor", NAVIGATION_FIX),
        # refused states that are consistent with one another: the first and the last
        ("agreeing", np.int64),  # their number
        ("first_agreeing", NAVIGATION_FIX),
        ("last_agreeing", NAVIGATION_FIX),
    ],
    align=True,
)

MONITORS = np.dtype(
    [
        ("flags", np.int64),  # MONITOR_* bits of the last answer
        ("violated", np.int64),  # MONITOR_* bits of all answers so far
        ("violations", np.int64),  # number of answers held back
        ("kept", np.int64),  # 1: `good` is valid
        ("good", STEERING),  # last good answer
    ],
    align=True,
)

#: Plan of a mission that leaves more free than the end of its last arc.
PLAN = np.dtype(
    [
        ("made", np.int64),  # 1: it holds the lengths of the free arcs before the last
        ("by_legs", np.int64),  # 1: law optimal flies it leg by leg too
        ("aims", np.int64),  # 1: it fixes the place on the mission's target orbit
        ("ends_leg", np.int64, (MAX_ARCS,)),  # 1: a burn that ends a leg, before the last arc
        ("length", np.float64, (MAX_ARCS,)),  # s, of free arcs and of burns that end a leg
        ("target", TARGET, (MAX_ARCS,)),  # at the end of a burn that ends a leg
        # first and last thrust direction of the leg that ends with the arc; 0: not known
        ("direction", np.float64, (MAX_ARCS, 2, 3)),
        # primer at the start of a burn's thrust, a unit vector, and its rate, 1/s; nan: not known
        ("primer", np.float64, (MAX_ARCS, 2, 3)),
        ("ignition", np.float64, (MAX_ARCS,)),  # start of the thrust, MET, s
        # at the end of that leg, or of a free coast, m; 0: not known
        ("position", np.float64, (MAX_ARCS, 3)),
        ("jettison_time", np.float64),  # of heating jettisons, MET; nan: not known
        # 1: the orbit at the end is nearly a circle; radius, speed and flight-path angle there, and
        # what the target names of its plane
        ("ends_round", np.int64),
        ("round_end", TARGET),
    ],
    align=True,
)

#: The present leg, the arcs up to the next burn that ends a leg, as a mission of its own.
LEG = np.dtype(
    [
        ("count", np.int64),  # its arcs, counted from the mission's first; 0: none yet
        ("arcs", ARC, (MAX_ARCS,)),
        ("target", TARGET),
        ("navigation", NAVIGATION),  # in a coast: at the next ignition
        ("coasting", np.int64),
        ("cycle_time", np.float64),  # s, time of the next cycle in a coast
        ("steering", STEERING),  # its cut-off is the end of the leg
        ("begin", np.float64),  # s, start of its first burn, or entry into the leg
        # initial guess of a search, from the plan
        ("time_to_go", np.float64),  # s, to the end of the leg; 0: no guess
        ("first_direction", np.float64, (3,)),
        ("last_direction", np.float64, (3,)),
        ("end_position", np.float64, (3,)),  # m
        ("jettison_time", np.float64),  # of heating jettisons, MET
    ],
    align=True,
)

#: Attitude in the air: by the mission file, and from there on as planned off line, the thrust
#: direction over the speed over the ground.
PROGRAMME = np.dtype(
    [
        ("given_over", np.int64),  # 1: that of the mission file is over
        # of the last state that it answered, and the answer
        ("last_time", np.float64),
        ("last_arc", np.int64),
        ("last_mass", np.float64),  # kg
        ("last_sensed", np.float64, (3,)),  # m/s
        ("sent", STEERING),
        ("wind", np.float64, (3,)),  # m/s, estimated: beyond the mission's, across the thrust axis
        ("hottest", np.float64),  # W/m2, largest heating under it
        ("count", np.int64),  # number of planned knots; 0: none
        ("active", np.int64),  # 1: it gave the last answer
        ("over", np.int64),  # 1: the law has taken over
        ("cycle", np.int64),  # guidance cycles flown by it
        ("next_cycle_time", np.float64),
        ("arc", np.int64, (MAX_PROGRAMME,)),  # index into the mission's arcs
        ("time", np.float64, (MAX_PROGRAMME,)),  # s, mission elapsed time, as planned
        ("speed", np.float64, (MAX_PROGRAMME,)),  # m/s over the ground, not falling within a burn
        ("direction", np.float64, (MAX_PROGRAMME, 3)),  # unit vectors
        ("air_direction", np.float64, (MAX_PROGRAMME, 3)),  # of the velocity in the air
        ("relief", np.float64, (MAX_PROGRAMME,)),  # turn of the thrust per turn of that direction
        ("replanned", np.int64),  # 1: the last cycle found the optimum through the air
        ("replans", np.int64),  # cycles that found it
        ("lost", np.int64),  # cycles in a row that did not
        # its steering
        ("new_time", np.float64),
        ("new_direction", np.float64, (3,)),
        ("new_rate", np.float64, (3,)),
        # rates of primer and of -lambda_r there, 1/s
        ("new_p_rate", np.float64, (3,)),
        ("new_q_rate", np.float64, (3,)),
    ],
    align=True,
)

GUIDANCE_STATE = np.dtype(
    [
        ("law", np.int64),  # LAW_* of the last solution
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
        ("saved", SOLUTION),  # before this cycle
        ("exact", SOLUTION),  # to the exact target, while one with a released radius is sought
        ("shortest", SOLUTION),  # of least time, while a longer one is sought
        ("predicted_position", np.float64, (3,)),
        ("predicted_velocity", np.float64, (3,)),
        ("aim", np.int64),  # AIM_*
        ("lowered", np.float64),  # m/s taken off the target for lack of propellant
        ("target", TARGET),  # aim: the mission's target, or the best within reach
        # 1: velocity-to-go holds an initial guess
        ("seeded", np.int64),
        ("density_ratio", np.float64),  # measured over modelled heating; nan: unknown
        # engines of the present stage, measured over the mission's; 0: not measured yet
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
        ("programme", PROGRAMME),
        ("leg", LEG),
        ("avoid", AVOID),
    ],
    align=True,
)


#: `LawKind.memory` of a law that keeps nothing but GUIDANCE_STATE between states.
NO_MEMORY = np.dtype([("none", np.int64)])


class OnboardArrays(NamedTuple):
    """Hold the arrays of guidance for one flight, beside the mission.

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
    """Hold the records of `OnboardArrays`, as kernels pass them on; the law's own memory apart."""

    navigation: Record
    settings: Record
    state: Record
    steering: Record


def blank_onboard(settings: NDArray[Any], memory: np.dtype[Any] = NO_MEMORY) -> OnboardArrays:
    """Return the arrays of guidance before a flight: no memory, no answer.

    Args:
        settings: shape (1,), dtype GUIDANCE_SETTINGS.
        memory: dtype of the law's own memory.
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
