# SPDX-License-Identifier: Apache-2.0
"""Hold the data of a mission by which a flight is described and judged."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ares_models.mission import Mission


@dataclass(frozen=True)
class MissionFacts:
    """Hold the data of a mission by which its flight is described and judged.

    Attributes:
        name: short name.
        title: full name.
        mu: m3/s2.
        target: record of dtype TARGET.
        arcs: name of each arc.
        stages: name of each stage.
        jettisons: name of each jettison.
        fairing: index of the first heating jettison; None: none.
        equatorial_radius: m.
        environment: record of dtype ENVIRONMENT; None: longitude zero is unknown.
        areas: names of the areas that impacts must avoid.
        rises: indices of the arcs at whose end the vehicle leaves the vertical.
        held_s: time from the first ignition to the release.
        mission: itself; None: not known.
    """

    name: str
    title: str
    mu: float
    target: Any
    arcs: Sequence[str] = ()
    stages: Sequence[str] = ()
    jettisons: Sequence[str] = ()
    fairing: int | None = None
    equatorial_radius: float = math.nan
    environment: Any = None
    areas: Sequence[str] = ()
    rises: Sequence[int] = ()
    held_s: float = 0.0
    mission: "Mission | None" = None


def facts_of(mission: "Mission") -> MissionFacts:
    """Return the facts of a mission."""
    from ares_models.mission_target import target_record

    heating = [jettison.heating_limit_w_m2 is not None for jettison in mission.drops]
    return MissionFacts(
        name=mission.name,
        title=mission.title,
        mu=mission.environment.mu_m3_s2,
        target=target_record(mission)[0],
        arcs=mission.arc_names,
        stages=mission.stage_names,
        jettisons=mission.jettison_names,
        fairing=heating.index(True) if True in heating else None,
        equatorial_radius=mission.environment.earth.equatorial_radius_m,
        environment=None if mission.zero_longitude_deg is None else mission.environment_array()[0],
        areas=mission.area_names,
        rises=mission.vertical_rises,
        held_s=mission.held_s,
        mission=mission,
    )
