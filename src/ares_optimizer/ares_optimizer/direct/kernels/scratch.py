# SPDX-License-Identifier: Apache-2.0
"""Work arrays of a flight, and their rows and columns."""

from typing import NamedTuple

from ares_optimizer.kernels.algebra import Array, Index
from ares_optimizer.kernels.nystroem import STAGES

# columns of a node: time, position, velocity, acceleration, mass, thrust direction
N_TIME = 0
N_POSITION = 1
N_VELOCITY = 4
N_ACCELERATION = 7
N_MASS = 10
N_DIRECTION = 11
N_COLUMNS = 14

# indices into ``Scratch.counts``
BREAKS = 0
STORED = 1
LATER_PEAKS = 2
COLUMNS = 3


class Scratch(NamedTuple):
    """Hold the work arrays of a flight and its evaluation, sized for one problem.

    Attributes:
        times, breaks: events in order of time, see :func:`lay_out`.
        work: scratch of the integration.
        nodes: shape (k, N_COLUMNS), room for every step of every break.
        drops: shape (d + PEAKS, 14), states at the free drops and at later heating peaks.
        drop_tangents: shape (d + PEAKS, 6, n).
        final: shape (8,).
        final_tangents: shape (6, n).
        rows: shape (MAX_ROWS, 6), terminal gradients by the state.
        state: shape (6,), current position and velocity of the integration.
        forces: shape (STAGES, 3), accelerations at the stages of a step.
        counts: shape (4,): numbers of BREAKS, STORED nodes, LATER_PEAKS of the heating after the
            last free drop, and COLUMNS of the tangents.
        peaks: shape (PEAKS,), times of these peaks, s after the start; set only where the limit
            holds from the jettison on.
    """

    times: Array
    breaks: Index
    work: Array
    nodes: Array
    drops: Array
    drop_tangents: Array
    final: Array
    final_tangents: Array
    rows: Array
    state: Array
    forces: Array
    counts: Index
    peaks: Array


class Run(NamedTuple):
    """Hold the arrays of a :class:`Scratch` that the integration writes.

    A record of few arrays: each call counts the references of every array in its arguments.
    """

    work: Array
    nodes: Array
    state: Array
    forces: Array
    counts: Index


# rows of the scratch array
W_POSITION = 0
W_VELOCITY = 1
W_BASE = 2
W_RATE = 3
W_STAGE = 4
W_FORCE = 5  # one per stage
W_HELD = W_FORCE + STAGES  # base and rate of a held direction
WORK_ROWS = W_HELD + 2
