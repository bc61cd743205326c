# SPDX-License-Identifier: Apache-2.0
"""Look for the propellant that the saving stage of a mission is short of."""

from itertools import islice
from typing import NamedTuple

import numpy as np

from ares_models.arrays import COAST
from ares_optimizer.collocation.ascents import first_guesses, try_known, try_other_plane
from ares_optimizer.collocation.bucket import try_throttle_bucket
from ares_optimizer.collocation.points import FoundOptimum
from ares_optimizer.collocation.search import Search
from ares_optimizer.plan import free_arcs, saving_stage, with_more_propellant
from ares_optimizer.solution import Cause, Status

#: Need over what there is from which another local optimum will not do, and number of starts that
#: must have led to the best one where it is less, or a coast is free.
_FAR_SHORT = 1.02
_SURE = 3
#: Starts without a flight after which the search ends.
_MOST_UNMET = 6
#: Share of what is left of a last stage at its end without which a flight is looked for, and most
#: starts for it.
_LEFT_BEHIND = 0.5
_MOST_LIGHTER = 8


class Shortage(NamedTuple):
    """Hold the propellant of the saving stage that the best flight takes, and what it has.

    Attributes:
        stage: such as "the last stage".
        burnt: by the best flight, kg.
        usable: what there is, kg.
        sure: true if enough starts led to this flight.
    """

    stage: str
    burnt: float
    usable: float
    sure: bool

    @property
    def cause(self) -> Cause:
        """Return the cause of a failed search."""
        short = self.burnt - self.usable
        digits = 0 if short >= 1.0 else 2
        return Cause(
            Status.INFEASIBLE if self.sure else Status.STALLED,
            f"propellant of {self.stage}: {short:,.{digits}f} kg short; best flight "
            f"{'needs' if self.sure else 'found needs'} {self.burnt:,.{digits}f} kg, "
            f"usable {self.usable:,.{digits}f} kg",
        )


def short_of_propellant(search: Search) -> Shortage | None:
    """Return the shortfall of propellant of a search without solution; None if there is none known.

    The search is repeated with more propellant in the saving stage: there is a flight to find,
    fast. A solution that needs no more than the mission has goes to the search of the mission.
    """
    if search.request.deadline.passed:
        return None
    arrays = with_more_propellant(search.arrays, search.start[0])
    arcs = arrays.arcs
    stage = saving_stage(search.arrays, search.start[0])
    if stage < 0:
        return None
    k = int(np.flatnonzero(arcs["stage"] == stage)[-1])
    usable = float(search.arrays.arcs[k]["propellant"])
    if usable >= arcs[k]["propellant"]:
        return None
    more = Search(arrays, search.start, search.floors, search.request)
    free = arcs[free_arcs(arrays, search.start[0])]
    alone = not (free["kind"] == COAST).any()
    try_known(more)
    if more.best is None:
        try_throttle_bucket(more)
    for trial in first_guesses(more) if more.best is None else ():
        if search.request.deadline.passed or (more.best is None and more.starts == _MOST_UNMET):
            break
        if more.best is not None and more.is_conclusive:
            far = alone and _burnt_in(stage, more.best) > _FAR_SHORT * usable
            if far or more.again >= _SURE:
                break
        more.try_start(trial)
    try_other_plane(more)
    search.iterations += more.iterations
    if more.best is None or (search.request.deadline.passed and not more.is_conclusive):
        return None
    burnt = _burnt_in(stage, more.best)
    if burnt <= usable:
        search.starts += more.starts
        # what is best with more propellant, and keeps to less, is best with less too
        search.keep(more.best, more.again)
        return None
    name = "the last stage" if stage == arcs[-1]["stage"] else f"stage {stage}"
    return Shortage(name, burnt, usable, alone or more.again >= _SURE)


def too_heavy(search: Search) -> Cause | None:
    """Return the cause of a search without solution that has one with less carried; else None.

    Where a weak last stage lacks what the stage before it should have given, more propellant in the
    last one finds no flight.
    """
    arcs, start = search.arrays.arcs.copy(), search.start.copy()
    less = _LEFT_BEHIND * float(arcs[-1]["stack_mass"] - arcs[-1]["propellant"])
    arcs["stack_mass"] -= less
    start["mass"] -= less
    lighter = Search(search.arrays._replace(arcs=arcs), start, search.floors, search.request)
    for trial in islice(first_guesses(lighter), _MOST_LIGHTER):
        if lighter.best is not None or search.request.deadline.passed:
            break
        lighter.try_start(trial)
    search.iterations += lighter.iterations
    if lighter.best is None:
        return None
    reason = f"no flight to the target found; with {less:,.4g} kg less on the last stage one exists"
    return Cause(Status.STALLED, reason)


def _burnt_in(stage: int, found: FoundOptimum) -> float:
    """Return the propellant of a stage that a flight takes, kg."""
    program, x = found.program, found.point.x
    stages = program.arrays.arcs["stage"]
    members = np.flatnonzero(stages[program.segments["arc"]] == stage)
    return program.mass * float((x[program.masses[members]] - x[program.ends[members]]).sum())
