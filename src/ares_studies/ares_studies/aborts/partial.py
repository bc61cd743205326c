# SPDX-License-Identifier: Apache-2.0
"""Return missions with a share of a failure: the way from the flight without it to the whole."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MAX_JETTISONS, MISSION_TIME, MissionArrays
from ares_models.failures import Failure, FailureKind
from ares_models.kernels.sequence import SAME_TIME, arc_after_burnout
from ares_optimizer.foreknown import Foreknown, begin_times, burning_at, foreknown

#: Time before the end of a burn, s, at which its shutdown changes next to nothing.
_JUST_BEFORE_S = 1e-3
#: Power of what is left of a failure by which limits of q alpha widen. By the first power alone, a
#: heavy vehicle that is weak is led to another extremal.
_WIDENING = 4


def partly(
    arrays: MissionArrays, start: NDArray[np.void], failure: Failure, share: float, cutoff_s: float
) -> Foreknown | None:
    """Return the mission with a share of a failure; None if its kind has none.

    A share of an early shutdown is a later one; of a stuck part, so much of its mass. From the
    failure on limits of q alpha are lifted: the attitude programme, which goes by speed, passes
    them where the vehicle is too slow. A share of that is a wider limit.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        failure: the failure.
        share: from 0 to 1, the whole of any kind.
        cutoff_s: of the flight without failure.

    Raises:
        OptimizerError: the failure is impossible.
    """
    start_s = float(start["time"][0])
    if share < 1.0:
        if failure.kind is FailureKind.STUCK_JETTISON:
            return _partly_stuck(arrays, failure.jettison, share)
        if failure.kind is FailureKind.EARLY_SHUTDOWN:
            following = arc_after_burnout(burning_at(arrays, start_s, failure.time_s), arrays.arcs)
            end = min(float(begin_times(arrays, start_s)[following]), cutoff_s) - _JUST_BEFORE_S
            later = max(0.0, end - failure.time_s) * (1.0 - share)
            failure = replace(failure, time_s=failure.time_s + later)
        elif failure.kind in (FailureKind.ENGINE_OUT, FailureKind.THRUST_LOW):
            thrust, flow = (
                1.0 - share * (1.0 - ratio) for ratio in (failure.thrust_ratio, failure.flow_ratio)
            )
            failure = replace(failure, thrust_ratio=thrust, flow_ratio=flow)
        else:
            return None
    known = foreknown(arrays, start, failure)
    after = begin_times(known.arrays, start_s)[:-1] >= failure.time_s - SAME_TIME
    arcs = known.arrays.arcs.copy()
    arcs["max_q_alpha"][after] *= (1.0 - share) ** -_WIDENING if share < 1.0 else math.inf
    return known._replace(arrays=known.arrays._replace(arcs=arcs))


def _partly_stuck(arrays: MissionArrays, jettison: int, share: float) -> Foreknown | None:
    """Divide a part in one that drops and one that never does; None if there is no room for it."""
    jettisons = arrays.jettisons
    if len(jettisons) == MAX_JETTISONS:
        return None
    jettisons = np.append(jettisons, jettisons[jettison])
    jettisons["mass"][jettison] *= 1.0 - share
    stuck = jettisons[-1:]
    stuck["mass"] *= share
    stuck["criterion"], stuck["value"] = MISSION_TIME, math.inf
    return Foreknown(arrays._replace(jettisons=jettisons), math.inf)
