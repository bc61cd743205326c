# SPDX-License-Identifier: Apache-2.0
"""Hold the optimal ascent as plain arrays for the compiled solver."""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from ares_optimizer.kernels.algebra import Array, Index

# begin of a steering law
AT_START = 0
AT_FIXED_TIME = 1
AT_DROP = 2

# columns of Problem.profile and Problem.tail
P_TIME = 0
P_THRUST = 1
P_THRUST_SLOPE = 2
P_FLOW = 3
P_FLOW_SLOPE = 4
P_MASS = 5

# columns of Problem.drops
D_MASS = 0
D_LOG_LIMIT = 1
D_EARLIEST = 2

# columns of Problem.laws
L_BEGINS = 0
L_DROP = 1
L_DIRECTION = 2
L_RATE = 3

HEATING_AT_JETTISON = 0
HEATING_FROM_JETTISON = 1

MINIMISE_TIME = 0
MINIMISE_HEATING = 1

# most later heating peaks that the limit can constrain at once
PEAKS = 4

# scales of the solver's variables
DIRECTION_SCALE = 1.0
RATE_SCALE = 1.0e-3
TIME_SCALE = 100.0


class Problem(NamedTuple):
    """Hold one flight to be optimised, from one start state.

    The variables, in columns: for each law its direction at the law's begin (3, no unit)
    and its rate (3, in RATE_SCALE per second) where they are free; the direction of each burn
    in held attitude (3); the times of the free drops; the cut-off time (both in TIME_SCALE
    seconds after the start).

    Attributes:
        environment: shape (1,), dtype ENVIRONMENT.
        atmosphere: shape (k, 9).
        target: shape (1,), dtype TARGET.
        state: shape (6,), position m and velocity m/s at the start.
        start_time: s.
        profile: shape (k, 6): pieces of the thrust profile up to cut-off: begin s, thrust N,
            thrust slope N/s, mass flow kg/s, its slope kg/s2, and mass at the begin, kg, with
            every free drop still aboard.
        tail: shape (k, 5): pieces after cut-off, time relative to cut-off, no mass column;
            the last row is the end of thrust.
        drops: shape (k, 3): free drops: mass kg, log of the heating limit in W/m2, and
            earliest time s.
        laws: shape (k, 4): begin (AT_*), index of the drop, column of the direction (-1:
            continuous), column of the rate (-1: from the jump condition).
        law_time: shape (k,), s, for AT_FIXED_TIME.
        held: shape (k,): burns in held attitude: column of the direction.
        held_time: shape (k, 2): begin and end of these burns, s; inf: the end of thrust.
        longest_step: longest integration step, s.
        latest_cutoff: s.
        earliest_cutoff: s.
        heating: HEATING_AT_JETTISON or HEATING_FROM_JETTISON.
        objective: MINIMISE_TIME, or MINIMISE_HEATING (the heating at the last free drop).
        variables: number of columns.
        stop: shape (1,); another thread writes 1 there to end a search.
    """

    environment: NDArray[Any]
    atmosphere: Array
    target: NDArray[Any]
    state: Array
    start_time: float
    profile: Array
    tail: Array
    drops: Array
    laws: Index
    law_time: Array
    held: Index
    held_time: Array
    longest_step: float
    latest_cutoff: float
    earliest_cutoff: float
    heating: int
    objective: int
    variables: int
    stop: Index
