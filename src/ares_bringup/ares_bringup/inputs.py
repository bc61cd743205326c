# SPDX-License-Identifier: Apache-2.0
"""Check what a flight is asked for, before anything is started."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ares_bringup.bag_paths import check_new_bag
from ares_bringup.facts import MissionFacts, facts_of
from ares_bringup.keeper import GUIDANCE, SIMULATOR
from ares_bringup.options import PEG, CannotStart, refusals
from ares_bringup.parameter_tables import tables
from ares_bringup.rehearsal import asks_for_plan

if TYPE_CHECKING:
    from ares_guidance.law import LawKind


def mission_facts(name: str) -> MissionFacts:
    """Read and check a mission.

    Raises:
        CannotStart: no such mission, or its file is wrong; one line.
    """
    from ares_models.mission import load_mission

    with refusals():
        mission = load_mission(name)
        # it may not be installed
        mission.atmosphere()
    return facts_of(mission)


def absolute_namespace(namespace: str) -> str:
    """Return a namespace with its leading slash.

    Raises:
        CannotStart: it is invalid in ROS.
    """
    from rclpy.exceptions import InvalidNamespaceException
    from rclpy.validate_namespace import validate_namespace

    absolute = namespace if namespace.startswith("/") else f"/{namespace}"
    try:
        validate_namespace(absolute)
    except InvalidNamespaceException as error:
        reason = str(error).partition(": ")[2].splitlines()[0].rstrip(":")
        raise CannotStart(f"namespace is {namespace!r}; {reason}") from error
    if absolute == "/":
        raise CannotStart(f"namespace is {namespace!r}; expected a name")
    return absolute


def heating_margin(dispersions: str, mission: str) -> float:
    """Return the margin to the heating limit for a guidance without a heating sensor.

    Raises:
        CannotStart: the dispersions or the mission are invalid; one line.
    """
    from ares_models.mission import load_mission
    from ares_vehicle_sim.dispersions import load_dispersions

    with refusals():
        return load_dispersions(dispersions, load_mission(mission)).heating_margin()


def check_possible(failure: str, mission: str) -> None:
    """Check that a failure is possible in a mission.

    Raises:
        CannotStart: it is not; one line.
    """
    from ares_models.failures import check_failure, read_failure
    from ares_models.mission import load_mission

    with refusals():
        check_failure(read_failure(failure), load_mission(mission))


def check_inputs(flown: Mapping[str, Any], bag: str) -> None:
    """Check the inputs of a flight before anything is started.

    Args:
        flown: parameters of simulator and guidance by name, as far as given.
        bag: folder of the bag; "": none.

    Raises:
        CannotStart: one of them is invalid; one line.
    """
    with refusals():
        for row in (*tables()[SIMULATOR], *tables()[GUIDANCE]):
            if row.name in flown:
                row.checked(flown[row.name])
    name = str(flown.get("mission", "ares_v"))
    mission_facts(name)
    _find_law(str(flown.get("law", PEG)))
    if flown.get("dispersions"):
        heating_margin(str(flown["dispersions"]), name)
    if flown.get("failure"):
        check_possible(str(flown["failure"]), name)
    if bag and os.path.lexists(bag):
        raise CannotStart(f"bag is {bag!r}, which exists; expected a new folder")
    if bag:
        check_new_bag(Path(bag))


def _find_law(name: str) -> "LawKind":
    from ares_guidance.laws import find_law

    try:
        return find_law(name)
    except ValueError as error:
        raise CannotStart(str(error).replace("law is", "guidance is", 1)) from error


def needs_trajectory(law: str) -> bool:
    """Tell whether a guidance law needs a trajectory of the optimizer.

    Raises:
        CannotStart: no such law; one line.
    """
    return _find_law(law).needs_trajectory


def needs_plan(mission: str, law: str) -> bool:
    """Tell whether a law flies a mission by a plan, which the optimizer must make.

    Raises:
        CannotStart: no such mission, or the law cannot fly it; one line.
    """
    from ares_models.mission import load_mission

    _find_law(law)
    with refusals():
        loaded = load_mission(mission)
    return loaded.needs_plan or asks_for_plan(loaded, law)
