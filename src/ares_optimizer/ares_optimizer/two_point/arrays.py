"""Records of the two-point problem: what is asked, and the memory to work in."""

import numpy as np

from ares_models.arrays import JETTISON, MAX_JETTISONS
from ares_optimizer.kernels.timetable import COLUMN_JETTISON, MAX_SEGMENTS, SEGMENT

#: Gravity: Eq. 2.13 without J2, or Eq. 3.4.
INVERSE_SQUARE = 0
LINEAR = 1

#: Rows of a state: position, velocity, primer, rate of the primer.
ROWS = 12
MAX_COLUMNS = 24
#: Stages of the Runge-Kutta-Nystroem method.
STAGES = 6

MAX_UNKNOWNS = COLUMN_JETTISON + 2 * MAX_JETTISONS

#: s after its earliest time, of a drop that is held there.
AT_ONCE = 1e-6

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

WORK = np.dtype(
    [
        ("state", np.float64, (ROWS,)),
        ("tangent", np.float64, (MAX_COLUMNS, ROWS)),
        ("stage", np.float64, (STAGES, 6)),
        ("stage_tangent", np.float64, (STAGES, MAX_COLUMNS, 6)),
        ("scratch", np.float64, (4, MAX_COLUMNS)),
        ("residual", np.float64, (MAX_COLUMNS,)),
        ("jacobian", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("factors", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("pivots", np.int64, (MAX_COLUMNS,)),
        ("step", np.float64, (MAX_COLUMNS,)),
        ("correction", np.float64, (MAX_COLUMNS,)),
        ("trial", np.float64, (MAX_COLUMNS,)),
        ("unit", np.float64, (MAX_COLUMNS,)),  # size of each unknown
        ("floor", np.float64, (MAX_COLUMNS,)),  # earliest time of each unknown time
        ("ceiling", np.float64),  # latest cut-off: the mass is gone
        ("terminal", np.float64, (6,)),
        ("terminal_gradient", np.float64, (6, 6)),
        ("heating_times", np.float64, (8,)),
        ("jettisons", JETTISON, (MAX_JETTISONS,)),  # as flown: inactive limits become times
        ("segments", SEGMENT, (MAX_SEGMENTS + 1,)),  # one to spare
        ("steps", np.int64, (MAX_SEGMENTS,)),
        ("segment_count", np.int64),
        ("lowest", np.float64),  # smallest radius of the last flight, m
        ("evaluations", np.int64),
        ("spent", np.int64),  # steps of the integrator, in this search
        ("stop", np.int64),  # another thread writes 1 here to end the search
        ("stuck", np.int64),  # heating unknown that ran into its earliest time
        ("pinned", np.int64, (MAX_JETTISONS,)),  # 1: this heating unknown stays there
        ("waiting_pays", np.int64, (MAX_JETTISONS,)),  # 1: a later drop would be better
    ],
    align=True,
)
