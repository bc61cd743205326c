# SPDX-License-Identifier: Apache-2.0
"""Find whether the begin of a flight from the pad can keep its pressure limits at all."""

import math
from itertools import islice

import numpy as np

from ares_models.arrays import HEATING_LIMIT, TARGET_ELEMENTS, MissionArrays
from ares_models.kernels.environment import air_velocity, density
from ares_models.kernels.vectors import dot
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.guess import trials
from ares_optimizer.collocation.pilot import CONSTANTS, Array, Pilot, plane_from_ground
from ares_optimizer.collocation.search import Search, refined
from ares_optimizer.collocation.transcription import FreeTimes
from ares_optimizer.solution import Cause, Status

#: Excess of a limit from which it is surely out of reach, as a factor.
_SURELY = 1.02
#: First guesses that must fail to keep it, and factor on the intervals on which one must keep it.
_MOST_GUESSES = 3
_FINER = 0.7


def limits_out_of_reach(search: Search) -> Cause | None:
    """Return the limits that no flight from the pad keeps; None if none are known.

    The steeper a flight, the lower is its dynamic pressure. If a vertical flight exceeds the limit,
    the arcs that have limits are solved alone, to any end. Without a solution the limits are
    narrowed until there is none any more; with one it must keep them on finer intervals too.

    Args:
        search: of the mission.
    """
    alone = _limited_arcs(search)
    if alone is None:
        return None
    limit = float(alone.arcs["max_dynamic_pressure"].min())
    upwards = _vertical_pressure(search, alone)
    if upwards < limit:
        return None
    part = Search(alone, search.start, (), search.request)
    for trial in islice(trials(alone, search.start, ()), _MOST_GUESSES):
        part.try_start(trial)
        if part.best is not None or search.request.deadline.passed:
            break
    kept = part.best is not None and refined(part, part.best, (), _FINER) is not None
    search.iterations += part.iterations
    if kept or search.request.deadline.passed:
        return None
    sure = _SURELY < part.limits_met < math.inf
    factor = ""
    if part.limits_met < math.inf:
        factor = f"; limits {part.limits_met:.2f} times as high can be kept"
    return Cause(
        Status.INFEASIBLE if sure else Status.STALLED,
        f"no flight from the pad {'keeps' if sure else 'was found that keeps'} the "
        f"limits of dynamic pressure and q alpha: upwards at no angle of attack it reaches "
        f"{1e-3 * upwards:,.1f} kPa, limit {1e-3 * limit:,.1f} kPa{factor}; less thrust or a "
        f"throttle_bucket lowers the pressure",
    )


def _limited_arcs(search: Search) -> MissionArrays | None:
    """Return the mission of the arcs with limits at the begin of a flight from the pad.

    Returns:
        None if there are none, or if the length of one is free: a shorter burn may keep them.
    """
    arrays = search.arrays
    arcs = arrays.arcs
    if plane_from_ground(arrays, search.start) is None:
        return None
    limited = np.flatnonzero(np.isfinite(arcs["max_dynamic_pressure"]))
    first = arcs[: int(limited[-1]) + 1 if limited.size else 0].copy()
    if not first.size or not np.isfinite(first["duration"]).all():
        return None
    target = arrays.target.copy()
    target["kind"], target["named"] = TARGET_ELEMENTS, 0
    timed = arrays.jettisons[arrays.jettisons["criterion"] != HEATING_LIMIT]
    return arrays._replace(arcs=first, target=target, jettisons=timed)


def _vertical_pressure(search: Search, alone: MissionArrays) -> float:
    """Return the greatest dynamic pressure of a vertical flight, Pa."""
    arcs = alone.arcs.copy()
    arcs["vertical"] = 1
    pilot = Pilot(alone._replace(arcs=arcs), search.start, ())
    nothing = np.zeros(0)
    end = float(pilot.begins(nothing, float(arcs[-1]["duration"]))[-1])
    track = pilot.fly(FreeTimes(nothing, end, nothing), np.zeros(CONSTANTS * pilot.count))
    return float(pressure_on(alone, track).max(initial=0.0))


def pressure_on(arrays: MissionArrays, track: Array) -> Array:
    """Return the dynamic pressure on a track, Pa, shape (n,)."""
    environment = arrays.environment[0]

    def pressure(row: Array) -> float:
        r, v = (tuple(row[at : at + 3].tolist()) for at in (rollout.POSITION, rollout.VELOCITY))
        air = air_velocity(r, v, environment)
        return 0.5 * float(density(r, environment, arrays.atmosphere)) * float(dot(air, air))

    return np.array([pressure(row) for row in track])
