# SPDX-License-Identifier: Apache-2.0
"""Compute properties of a flight from its segments."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, Record


def first_ignitions(
    start: Record, pieces: NDArray[np.void], arcs: NDArray[np.void]
) -> tuple[float, ...]:
    """Return the first ignition of each stage, s; the start for stages in the past.

    Args:
        start: record NAVIGATION.
        pieces: dtype SEGMENT, from the start on.
        arcs: dtype ARC.
    """
    times = [math.inf] * (int(arcs["stage"].max()) + 1)
    present = int(start["arc"])
    stage = int(arcs[present]["stage"])
    for gone in range(stage):
        times[gone] = float(start["time"])
    begin = float(start["arc_start_time"])
    for k in range(present, -1, -1):
        if int(arcs[k]["stage"]) != stage:
            break
        if k < present:
            begin -= float(arcs[k]["duration"])
        if arcs[k]["kind"] == BURN:
            times[stage] = begin
    for piece in pieces:
        arc = arcs[piece["arc"]]
        if arc["kind"] == BURN and math.isinf(times[int(arc["stage"])]):
            times[int(arc["stage"])] = float(piece["start"])
    return tuple(times)
