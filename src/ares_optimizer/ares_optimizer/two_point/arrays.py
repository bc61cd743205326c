# SPDX-License-Identifier: Apache-2.0
"""Define the records of the two-point problem: options, guess and work memory."""

from typing import NamedTuple

import numpy as np

from ares_models.arrays import JETTISON, MAX_JETTISONS
from ares_optimizer.kernels.nystroem import STAGES
from ares_optimizer.kernels.timetable import (
    COLUMN_JETTISON,
    LAYOUT,
    MAX_FREE,
    MAX_HELD,
    MAX_SEGMENTS,
    MAX_UNKNOWNS,
    SEGMENT,
)

#: Gravity: Eq. 2.13 without J2, or Eq. 3.4.
INVERSE_SQUARE = 0
LINEAR = 1

#: Rows of a state: position, velocity, primer, rate of the primer.
ROWS = 12
MAX_COLUMNS = MAX_UNKNOWNS + 1

#: Order of the unknowns: primer and lambda_r at the start, the cut-off time in COLUMN_CUTOFF, time
#: and pi of each heating jettison, the ends of free arcs, the directions of burns in held attitude.
PRIMER = slice(0, 3)
LAMBDA_R = slice(3, 6)
TIMES = slice(COLUMN_JETTISON, None, 2)
PIS = slice(COLUMN_JETTISON + 1, None, 2)

#: Time of a pinned drop after its earliest time, and least length of a free arc, s.
AT_ONCE = 1e-6

#: Active constraint on the end of a free arc: none, a bound of its length, depletion of its stage,
#: or a length set by the caller.
NOT_HELD = 0
AT_SHORTEST = 1
AT_LONGEST = 2
DRY = 3
HELD = 4

#: Optimality condition at the end of a free arc, and one at the cut-off.
SWITCH = np.dtype(
    [
        ("hold", np.int64),  # NOT_HELD, AT_SHORTEST, ...
        ("length", np.float64),  # s, of an arc that is HELD
        ("arc", np.int64),
        ("segment", np.int64),  # last segment of the arc
        ("flow", np.float64),  # kg/s there; 0: a coast
        # switching function = value - price * cost
        ("value", np.float64),  # Hamiltonian at the end without the propellant term, m/s2
        ("cost", np.float64),  # factor of the propellant price, kg/s
        ("flow_by", np.float64, (MAX_COLUMNS,)),
        ("value_by", np.float64, (MAX_COLUMNS,)),
        ("cost_by", np.float64, (MAX_COLUMNS,)),
        ("worth", np.float64),  # switching function, m/s2: gain by a longer arc, per second
    ],
    align=True,
)

#: Mass costate = ``value`` + ``priced`` * propellant price, m/s2 per kg/s.
MASS_COSTATE = np.dtype(
    [
        ("value", np.float64),
        ("priced", np.float64),
        ("value_by", np.float64, (MAX_COLUMNS,)),
        ("priced_by", np.float64, (MAX_COLUMNS,)),
    ],
    align=True,
)

#: Propagators: Runge-Kutta-Nystroem, closed form with Simpson's or with Milne's rule.
RUNGE_KUTTA = 0

OPTIONS = np.dtype(
    [
        ("gravity", np.int64),  # INVERSE_SQUARE or LINEAR
        ("propagator", np.int64),  # RUNGE_KUTTA, closed_form.SIMPSON or MILNE
        ("corrected", np.int64),  # 1: closed form, nonlinear part of gravity as impulses
        ("heating", np.int64),  # timetable.HEATING_*
        ("step", np.float64),  # s, longest step or closed-form arc
        ("max_iterations", np.int64),
        ("tolerance", np.float64),  # of the last Newton step, in scaled unknowns
        ("max_steps", np.int64),  # of the integrator, in one search; 0: no limit
        ("in_air", np.int64),  # 1: segments that begin before air_end are flown in the air
        ("air_end", np.float64),  # s, from which on the forces of the air are small
    ],
    align=True,
)

#: Transversality of a target by elements; state and costate scaled to radius and speed at cut-off.
TERMINAL_FRAME = np.dtype(
    [
        ("size", np.float64, (6,)),  # radius, radius, radius, speed, speed, speed
        ("costate", np.float64, (6,)),
        ("span", np.float64, (6, 6)),  # orthonormal rows, span of the target's gradients
        ("factor", np.float64, (6, 6)),  # lower triangle: gradient = factor . span
        ("free", np.float64, (6, 6)),  # orthonormal rows, complement of ``span``
        ("multipliers", np.float64, (6,)),
        ("values", np.float64, (6,)),
        ("ahead", np.float64, (6, 6)),  # gradients at the state plus and minus a difference
        ("behind", np.float64, (6, 6)),
        ("hessian", np.float64, (6, 6)),  # Hessian of multipliers . rows
    ],
    align=True,
)

#: A burn in held attitude.
AIM = np.dtype(
    [
        ("direction", np.float64, (3,)),  # w; of length 1 at a root
        # integral of lambda_v T/m over the burn, m/s; the optimal w is parallel to it
        ("primer_impulse", np.float64, (3,)),
        ("primer_impulse_by", np.float64, (MAX_COLUMNS, 3)),
    ],
    align=True,
)

WORK = np.dtype(
    [
        ("state", np.float64, (ROWS,)),  # r, V, lambda_v, lambda_v'
        ("tangent", np.float64, (MAX_COLUMNS, ROWS)),  # its derivative by each unknown
        ("stage", np.float64, (STAGES, 6)),
        ("moved", np.float64, (MAX_COLUMNS, 6)),  # the same of position and primer at a stage
        ("stage_tangent", np.float64, (STAGES, MAX_COLUMNS, 6)),
        # derivatives by each unknown of T/m, step length, omega and omega^2
        ("thrust", np.float64, (MAX_COLUMNS,)),
        ("thrust_after", np.float64, (MAX_COLUMNS,)),  # just after a drop
        ("stretch", np.float64, (MAX_COLUMNS,)),
        ("omega", np.float64, (MAX_COLUMNS,)),
        ("omega_square", np.float64, (MAX_COLUMNS,)),
        ("columns", np.int64),  # tangents integrated in the current segment
        ("columns_wanted", np.int64),  # tangents at the end of the flight; 0: residuals only
        ("first_free", np.int64),  # column of the first free end
        ("first_held", np.int64),  # column of the first direction of a held burn
        ("residual", np.float64, (MAX_COLUMNS,)),
        ("jacobian", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("factors", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("pivots", np.int64, (MAX_COLUMNS,)),
        ("step", np.float64, (MAX_COLUMNS,)),
        ("correction", np.float64, (MAX_COLUMNS,)),
        ("trial", np.float64, (MAX_COLUMNS,)),
        ("unit", np.float64, (MAX_COLUMNS,)),  # scale of each unknown
        ("floor", np.float64, (MAX_COLUMNS,)),  # earliest time of each unknown time
        ("arc_ends", np.float64, (MAX_FREE,)),
        ("layout", LAYOUT),
        # free arcs: conditions at their ends, mass costate
        ("planned", np.int64),  # 1: free arcs before the last, or a last burn of fixed length
        ("switches", SWITCH, (MAX_FREE + 1,)),
        ("price", np.float64),  # price of propellant c, m/s2 per kg/s
        ("costate_rate", np.float64),  # rate of the mass costate at a stage, |lambda_v| T/m^2
        ("costate_rate_by", np.float64, (MAX_COLUMNS,)),
        ("costate_rise", np.float64),  # its integral over the last segment
        ("costate_rise_by", np.float64, (MAX_COLUMNS,)),
        ("rises", np.float64, (MAX_SEGMENTS + 1,)),  # the same for each segment
        ("rises_by", np.float64, (MAX_SEGMENTS + 1, MAX_COLUMNS)),
        ("mass_costate", MASS_COSTATE),
        ("aims", AIM, (MAX_HELD,)),  # held burns
        ("primer_thrust", np.float64, (3,)),  # lambda_v T/m at a stage
        ("primer_thrust_by", np.float64, (MAX_COLUMNS, 3)),
        ("aiming", np.int64),  # 1: held burns thrust along the primer, to estimate directions
        ("ceiling", np.float64),  # latest cut-off, s: nearly no mass is left
        ("terminal", np.float64, (6,)),
        ("terminal_gradient", np.float64, (6, 6)),
        ("terminal_frame", TERMINAL_FRAME),
        ("heating_times", np.float64, (8,)),
        ("jettisons", JETTISON, (MAX_JETTISONS,)),  # inactive limits replaced by times
        ("segments", SEGMENT, (MAX_SEGMENTS + 1,)),  # the last row stays unused
        ("steps", np.int64, (MAX_SEGMENTS,)),
        ("segment_count", np.int64),
        ("lowest", np.float64),  # smallest radius of the last flight, m
        ("free_kept", np.float64, (6, 6)),  # of the terminal frame, while differences are taken
        ("pressure_share", np.float64),  # greatest dynamic pressure over its limit, in the air
        ("evaluations", np.int64),
        ("spent", np.int64),  # steps of the integrator, in this search
        ("stop", np.int64),  # another thread writes 1 here to end the search
        ("passive", np.int64),  # 1: no costate jump at drops, the steering ignores them
        ("stuck", np.int64),  # heating unknown that reached its earliest time
        ("stuck_arc", np.int64),  # switch that reached a bound
        ("stuck_hold", np.int64),  # that bound: AT_SHORTEST, AT_LONGEST or DRY
        ("pinned", np.int64, (MAX_JETTISONS,)),  # 1: this drop is fixed at its earliest time
        ("waiting_pays", np.int64, (MAX_JETTISONS,)),  # 1: a later drop would be better
    ],
    align=True,
)


class Gravity(NamedTuple):
    """Hold the gravity field of a flight.

    Attributes:
        mu: m3/s2.
        omega_square: 1/s2, of linear gravity; 0 with inverse-square gravity.
        model: INVERSE_SQUARE or LINEAR.
        oblateness: 1.5 J2 mu R^2, m5/s2, added to inverse-square gravity.
    """

    mu: float
    omega_square: float
    model: int
    oblateness: float


class Effort(NamedTuple):
    """Hold the extent of a search.

    Attributes:
        guessed: true if the unknowns hold a guess, which is tried first.
        restart: try the built-in guesses when that guess fails.
        thorough: find one root from the guess, one from built-in guesses and, with a free node,
            one in the other plane, and return the earliest cut-off; else return the first root.
        first: number of built-in guesses that failed before, in cyclic order.
    """

    guessed: bool
    restart: bool
    thorough: bool
    first: int
