# SPDX-License-Identifier: Apache-2.0
"""Records of the two-point problem: what is asked, and the memory to work in."""

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

#: Where the unknowns stand: primer and lambda_r at the start, then the cut-off time in
#: COLUMN_CUTOFF, then time and pi of each heating jettison, the ends of free arcs, and the
#: directions of burns in held attitude.
PRIMER = slice(0, 3)
LAMBDA_R = slice(3, 6)
TIMES = slice(COLUMN_JETTISON, None, 2)
PIS = slice(COLUMN_JETTISON + 1, None, 2)

#: s after its earliest time, of a drop that is held there; least length of a free arc.
AT_ONCE = 1e-6

#: What holds the end of a free arc: nothing, the bounds of its length, its stage's propellant,
#: or a length of the searcher's.
NOT_HELD = 0
AT_SHORTEST = 1
AT_LONGEST = 2
DRY = 3
HELD = 4

#: The end of a free arc, as the conditions on it see it; one more for the cut-off.
SWITCH = np.dtype(
    [
        ("hold", np.int64),  # NOT_HELD, AT_SHORTEST, ...
        ("length", np.float64),  # s, of an arc that is HELD
        ("arc", np.int64),
        ("segment", np.int64),  # that it ends
        ("flow", np.float64),  # kg/s there; 0: a coast
        # Hamiltonian there without the mass costate and the cost, m/s2, and what the mass
        # costate makes of it: what a second more of the arc is worth is worth - cost * flow
        ("value", np.float64),
        ("cost", np.float64),  # kg/s
        ("flow_by", np.float64, (MAX_COLUMNS,)),
        ("value_by", np.float64, (MAX_COLUMNS,)),
        ("cost_by", np.float64, (MAX_COLUMNS,)),
        ("worth", np.float64),  # m/s2, with the cost of propellant taken off
    ],
    align=True,
)

#: The mass costate: ``value`` and ``priced`` times the price of propellant, m/s2 per kg/s.
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
        ("corrected", np.int64),  # 1: closed form with the rest of gravity as impulses
        ("heating", np.int64),  # timetable.HEATING_*
        ("step", np.float64),  # s, longest step or closed-form arc
        ("max_iterations", np.int64),
        ("tolerance", np.float64),  # of the last Newton step, in scaled unknowns
        ("max_steps", np.int64),  # of the integrator, in one search; 0: no limit
    ],
    align=True,
)

#: Of a target by elements: state and costate at cut-off, scaled to its radius and speed.
TERMINAL_FRAME = np.dtype(
    [
        ("size", np.float64, (6,)),  # radius, radius, radius, speed, speed, speed
        ("costate", np.float64, (6,)),
        ("span", np.float64, (6, 6)),  # by row, orthonormal: what the target's gradients span
        ("factor", np.float64, (6, 6)),  # lower triangle: gradient = factor . span
        ("free", np.float64, (6, 6)),  # by row, orthonormal: the motions that it leaves free
        ("multipliers", np.float64, (6,)),
        ("values", np.float64, (6,)),
        ("ahead", np.float64, (6, 6)),  # gradients beside the state
        ("behind", np.float64, (6, 6)),
        ("bend", np.float64, (6, 6)),  # Hessian of multipliers . rows
    ],
    align=True,
)

#: A burn in held attitude.
AIM = np.dtype(
    [
        ("direction", np.float64, (3,)),  # w; of length 1 at a root
        # integral of lambda_v T/m over the burn, along which w is best, m/s
        ("pull", np.float64, (3,)),
        ("pull_by", np.float64, (MAX_COLUMNS, 3)),
    ],
    align=True,
)

WORK = np.dtype(
    [
        ("state", np.float64, (ROWS,)),  # r, V, lambda_v, lambda_v'
        ("tangent", np.float64, (MAX_COLUMNS, ROWS)),  # its derivative by each unknown
        ("stage", np.float64, (STAGES, 6)),
        ("moved", np.float64, (MAX_COLUMNS, 6)),  # of position and primer at the present stage
        ("stage_tangent", np.float64, (STAGES, MAX_COLUMNS, 6)),
        # by column: derivatives of T/m, of a step's length, of omega and omega^2
        ("thrust", np.float64, (MAX_COLUMNS,)),
        ("thrust_after", np.float64, (MAX_COLUMNS,)),  # just after a drop
        ("stretch", np.float64, (MAX_COLUMNS,)),
        ("omega", np.float64, (MAX_COLUMNS,)),
        ("omega_square", np.float64, (MAX_COLUMNS,)),
        ("columns", np.int64),  # tangents carried now,
        ("columns_wanted", np.int64),  # and by the end of the flight; 0: residuals only
        ("first_free", np.int64),  # column of the first free end,
        ("first_held", np.int64),  # and of the first direction of a held burn
        ("residual", np.float64, (MAX_COLUMNS,)),
        ("jacobian", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("factors", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("pivots", np.int64, (MAX_COLUMNS,)),
        ("step", np.float64, (MAX_COLUMNS,)),
        ("correction", np.float64, (MAX_COLUMNS,)),
        ("trial", np.float64, (MAX_COLUMNS,)),
        ("unit", np.float64, (MAX_COLUMNS,)),  # size of each unknown
        ("floor", np.float64, (MAX_COLUMNS,)),  # earliest time of each unknown time
        ("arc_ends", np.float64, (MAX_FREE,)),
        ("layout", LAYOUT),
        # free arcs: their ends, and what the mass costate needs of the segments
        ("planned", np.int64),  # 1: there is more to decide than the cut-off
        ("switches", SWITCH, (MAX_FREE + 1,)),
        ("price", np.float64),  # of propellant: m/s2 of worth per kg/s
        ("impulse_rate", np.float64),  # |lambda_v| T/m^2 at the present stage
        ("impulse_rate_by", np.float64, (MAX_COLUMNS,)),
        ("costate_rise", np.float64),  # its integral over the last segment
        ("costate_rise_by", np.float64, (MAX_COLUMNS,)),
        ("rises", np.float64, (MAX_SEGMENTS + 1,)),  # the same for each segment
        ("rises_by", np.float64, (MAX_SEGMENTS + 1, MAX_COLUMNS)),
        ("mass_costate", MASS_COSTATE),
        ("aims", AIM, (MAX_HELD,)),  # held burns
        ("pull_rate", np.float64, (3,)),  # lambda_v T/m at the present stage
        ("pull_rate_by", np.float64, (MAX_COLUMNS, 3)),
        ("aiming", np.int64),  # 1: they thrust along the primer, as if they were guided
        ("ceiling", np.float64),  # latest cut-off: the mass is gone
        ("terminal", np.float64, (6,)),
        ("terminal_gradient", np.float64, (6, 6)),
        ("terminal_frame", TERMINAL_FRAME),
        ("heating_times", np.float64, (8,)),
        ("jettisons", JETTISON, (MAX_JETTISONS,)),  # as flown: inactive limits become times
        ("segments", SEGMENT, (MAX_SEGMENTS + 1,)),  # one to spare
        ("steps", np.int64, (MAX_SEGMENTS,)),
        ("segment_count", np.int64),
        ("lowest", np.float64),  # smallest radius of the last flight, m
        ("evaluations", np.int64),
        ("spent", np.int64),  # steps of the integrator, in this search
        ("stop", np.int64),  # another thread writes 1 here to end the search
        ("passive", np.int64),  # 1: the steering does not know of the drops
        ("stuck", np.int64),  # heating unknown that ran into its earliest time
        ("stuck_arc", np.int64),  # switch that ran into a bound, and which:
        ("stuck_hold", np.int64),  # AT_SHORTEST, AT_LONGEST or DRY
        ("pinned", np.int64, (MAX_JETTISONS,)),  # 1: this heating unknown stays there
        ("waiting_pays", np.int64, (MAX_JETTISONS,)),  # 1: a later drop would be better
    ],
    align=True,
)


class Gravity(NamedTuple):
    """The field in which a flight is flown.

    Attributes:
        mu: m3/s2.
        omega_square: 1/s2, of linear gravity; 0 for the other.
        model: INVERSE_SQUARE or LINEAR.
        oblateness: 1.5 J2 mu R^2, m5/s2, beside inverse-square gravity.
    """

    mu: float
    omega_square: float
    model: int
    oblateness: float


class Effort(NamedTuple):
    """How far a search goes.

    Attributes:
        guessed: the unknowns hold a guess; it is tried first.
        restart: go on with own guesses when the guess leads nowhere.
        thorough: seek one root from the guess, one from own guesses and, with a free node, one
            in the other plane, and take that which cuts off first; else take the first root.
        first: how many of the own guesses have been tried in vain, over and over.
    """

    guessed: bool
    restart: bool
    thorough: bool
    first: int
