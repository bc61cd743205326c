# SPDX-License-Identifier: Apache-2.0
"""Guidance laws by name, of all installed packages."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import ERROR_NOT_CONVERGED, ERROR_TARGET_UNREACHABLE, STEEPEST
from ares_guidance.kernels.plans.floor import lowest_altitude
from ares_guidance.law import Law, LawKind
from ares_guidance.own_law import one_line_each
from ares_guidance.plan import ArcPlan
from ares_guidance.registry import GROUP, law_names
from ares_guidance.settings import LawSettings
from ares_models.arrays import NAMES_ARGUMENT_OF_PERIGEE, NAMES_TRUE_ANOMALY, MissionArrays
from ares_models.kernels.targets import names
from ares_models.orbits import Insertion
from ares_models.plans import needs_plan
from ares_models.registry import load_registered

#: Elements that together fix the place of insertion on the orbit.
_PLACE = NAMES_ARGUMENT_OF_PERIGEE | NAMES_TRUE_ANOMALY


class FindsNoWay(ValueError):
    """Report that a law finds no solution from the start of the flight to its target."""


@cache
def find_law(name: str) -> LawKind:
    """Load a law by its name.

    Raises:
        ValueError: no such law, or its import fails; one line.
    """
    if name not in law_names():
        raise ValueError(f"law is {name!r}; expected one of {', '.join(law_names())}")
    with one_line_each(name):
        return load_registered(GROUP, "law", name, LawKind)


def self_starting_laws() -> list[str]:
    """Return the names of the laws that need no trajectory to start from.

    Raises:
        ValueError: a law cannot be imported; one line.
    """
    return [name for name in law_names() if not find_law(name).needs_trajectory]


def make_law(
    name: str,
    arrays: MissionArrays,
    settings: LawSettings | None = None,
    start: NDArray[np.void] | None = None,
) -> Law:
    """Build a law, ready for the first navigation state or, if it flies by a plan, for that.

    Args:
        name: one of `ares_guidance.registry.law_names`.
        arrays: the mission as guidance believes it.
        settings: cycle and gates.
        start: of the mission, shape (1,), dtype NAVIGATION, from which the law may ask for a plan;
            None: it flies by a plan only if the mission needs one.

    Raises:
        ValueError: no such law, the law cannot fly this mission, or it fails; one line.
    """
    kind = find_law(name)
    with one_line_each(name):
        law = kind.build(arrays, settings) if kind.build else Law(arrays, settings, kind)
    law.asks = start is not None and asks_for_plan(name, arrays, start)
    return law


def asks_for_plan(name: str, arrays: MissionArrays, start: NDArray[np.void]) -> bool:
    """Return whether a law flies by a plan only because it finds no steering without.

    Args: as in :func:`check_law`.

    Raises:
        ValueError: the law cannot fly to this target.
    """
    return not needs_plan(arrays.arcs, arrays.target[0], arrays.environment[0]) and not finds_way(
        name, arrays, start, None
    )


def check_law(
    name: str, arrays: MissionArrays, start: NDArray[np.void], plan: ArcPlan | None = None
) -> None:
    """Check that a law with default settings finds a solution at a mission's start.

    Args:
        name: of the law.
        arrays: the mission.
        start: navigation state, shape (1,), dtype NAVIGATION.
        plan: of what is free, or what the law asked for.

    Raises:
        FindsNoWay: it finds none; one line, which names the laws that do.
        ValueError: the law cannot fly to this target, or lacks a plan.
    """
    if finds_way(name, arrays, start, plan):
        return
    others = [
        other
        for other in self_starting_laws()
        if other != name and _may_fly(other, arrays, start, plan)
    ]
    advice = f"; try law {' or '.join(others)}" if others else ", nor does any other law"
    raise FindsNoWay(
        f"law is {name!r}, which finds no steering from the start of the mission to its "
        f"target{advice}"
    )


def _may_fly(
    name: str, arrays: MissionArrays, start: NDArray[np.void], plan: ArcPlan | None
) -> bool:
    """Return :func:`finds_way`, or False if the law cannot fly the mission at all."""
    try:
        return finds_way(name, arrays, start, plan)
    except ValueError:
        return False


def finds_way(
    name: str, arrays: MissionArrays, start: NDArray[np.void], plan: ArcPlan | None
) -> bool:
    """Return whether the first cycle of a law at a mission's start finds a solution.

    Args: as in :func:`check_law`.

    Raises:
        ValueError: the law cannot fly to this target, lacks a plan, or fails; one line.
    """
    law = make_law(name, arrays)
    if names(arrays.target[0], _PLACE) and not law.kind.meets_place:
        raise ValueError(
            f"law is {name!r}, which flies to no place on an orbit whose argument of perigee is "
            "named; leave either out of the target, or use another law"
        )
    with one_line_each(name):
        if plan is not None:
            law.follow_arcs(plan)
        law.step(start[0])
    solution = law.state["solution"]
    # with a plan the target plane is known to be in reach
    lost = law.state["error"] == ERROR_NOT_CONVERGED or (
        plan is not None and law.state["error"] == ERROR_TARGET_UNREACHABLE
    )
    past = solution["primer"]["gradient"] == 0.0 and solution["turn"] > STEEPEST
    return bool(law.kind.needs_trajectory or not (lost or past))


def rehearse(name: str, arrays: MissionArrays, start: NDArray[np.void]) -> None:
    """Compile a law that has no plan yet, by one step on a dummy plan.

    Args: as in :func:`check_law`.

    Raises:
        ValueError: the law cannot fly this mission, or it fails; one line.
    """
    law = make_law(name, arrays)
    there = Insertion.from_state(start["position"][0], start["velocity"][0])
    every = range(len(arrays.arcs))
    with one_line_each(name):
        law.follow_arcs(ArcPlan(dict.fromkeys(every, 0.0), dict.fromkeys(every, there)))
        law.step(start[0])
    none = np.zeros((0, 3))
    lowest_altitude(0.0, 0.0, True, np.zeros(0), none, none, arrays.environment)
