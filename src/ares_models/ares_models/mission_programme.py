# SPDX-License-Identifier: Apache-2.0
"""A boost programme of a mission's own: attitude by a table, or a zero-lift turn."""

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from ares_models import arrays as layout
from ares_models import mission_keys as allowed
from ares_models.kernels.boost import horizon
from ares_models.mission_arcs import BurnArc
from ares_models.mission_keys import Part, fail, one_of, optional

if TYPE_CHECKING:
    from ares_models.mission import Mission

#: What a programme may go by, with the codes of the kernels.
OVER = {
    "time_s": layout.OVER_TIME,
    "altitude_m": layout.OVER_ALTITUDE,
    "speed_m_s": layout.OVER_SPEED,
}
#: Least difference of two knots that are no jump.
MIN_STEP = 1e-3


class WhenPart(Part):
    """Hold a moment of a flight: a time, an altitude, or a speed in the air."""

    model_config = ConfigDict(json_schema_extra=one_of(*((key,) for key in OVER)))

    time_s: allowed.MissionTime | None = optional("at this mission elapsed time")
    altitude_m: allowed.FloorAltitude | None = optional("where this altitude is reached")
    speed_m_s: allowed.Speed | None = optional("where this speed in the air is reached")

    @model_validator(mode="after")
    def _one_form(self) -> "WhenPart":
        keys = tuple(type(self).model_fields)
        if not self.take_one(keys):
            fail((keys[0],), None, "one of " + ", ".join(keys))
        return self

    @property
    def by(self) -> tuple[str, float]:
        """Return what it goes by, a key of OVER, and its value; the time inf if none is given."""
        found = self.given(OVER)
        return (found[0], getattr(self, found[0])) if found else ("time_s", math.inf)


class UntilPart(WhenPart):
    """Hold the end of a programme: a moment of the flight, or the end of an arc or a stage."""

    model_config = ConfigDict(json_schema_extra=one_of(*((key,) for key in OVER), ("end_of",)))

    end_of: allowed.Name | None = optional("name of a stage, a burn or a coast that it ends with")


class ProgrammePart(Part):
    """Hold a boost programme."""

    model_config = ConfigDict(
        json_schema_extra=one_of(("over", "table"), ("kick", "kick_deg", "azimuth_deg"))
    )

    over: Literal["time_s", "altitude_m", "speed_m_s"] | None = optional(
        "what the table goes by: mission elapsed time, altitude, or speed in the air"
    )
    table: allowed.AttitudeTable | None = optional(
        "of the thrust, knots [time, altitude or speed, pitch above the horizon in "
        "deg, azimuth from north to east in deg]; straight between them, constant beyond both ends"
    )
    horizon: Literal["local", "launch"] = Field(
        default="local",
        description="that pitch and azimuth refer to: below the vehicle, or that of the start, "
        "which does not turn",
    )
    beyond: Literal["constant", "velocity"] = Field(
        default="constant",
        description="from the last knot on: its angles, or along the velocity in the air once "
        "that is no steeper",
    )
    kick: WhenPart | None = optional(
        "in place of over and table: vertical until then, then off it, then along the "
        "velocity in the air"
    )
    kick_deg: allowed.Kick | None = optional("off the vertical until the velocity is so too")
    azimuth_deg: allowed.Turn | None = optional("of the kick, from north to east")
    until: UntilPart | None = optional(
        "its end, after which guidance takes over; default: none, no law guides"
    )

    @model_validator(mode="after")
    def _one_form(self) -> "ProgrammePart":
        turn: tuple[str, ...] = ("kick", "kick_deg", "azimuth_deg")
        table: tuple[str, ...] = ("over", "table")
        instead = ""
        if self.kick is None and self.kick_deg is None:
            needed, others = table, turn
            instead = ", or a kick in its place" if self.table is None else ""
        else:
            needed, others = turn, (*table, "horizon", "beyond")
        named = [key for key in others if key in self.model_fields_set]
        there = [key for key in needed if key in self.model_fields_set] or needed[-1:]
        self.refuse(named, f"no such key beside {there[0]}")
        for key in reversed(needed):
            if getattr(self, key) is None:
                fail((key,), None, _NEEDED[key] + instead)
        for k in range(1, len(self.table or ())):
            before, now = (self.table or ())[k - 1][0], (self.table or ())[k][0]
            if before != now < before + MIN_STEP:
                expected = f"{before:g} again, or at least {before + MIN_STEP:g}"
                fail(("table", k, 0), now, expected)
        return self


_NEEDED = {
    "over": "time_s, altitude_m or speed_m_s",
    "table": "a list of knots",
    "kick": "one of time_s, altitude_m, speed_m_s",
    "kick_deg": "a number in deg",
    "azimuth_deg": "a number in deg",
}


def flown_whole(mission: "Mission") -> bool:
    """Return whether a mission is flown by its programme to its end, without guidance."""
    return mission.programme is not None and mission.programme.until is None


def check_programme(mission: "Mission") -> None:
    """Report a programme that ends with no arc before the last, or never though arcs are free."""
    if mission.programme is None:
        return
    until = mission.programme.until
    if until is None:
        for place in mission.walk:
            if place.arc.free:
                expected = "a time in s, because programme has no until"
                fail(place.path(place.arc.LENGTH), "free", expected)
        return
    begin = mission.initial_state.time_s
    if until.time_s is not None and until.time_s <= begin:
        expected = f"a time after initial_state.time_s, {begin:g} s"
        fail(("programme", "until", "time_s"), until.time_s, expected)
    kick = mission.programme.kick
    if kick is not None and until.end_of is None and until.by[0] == kick.by[0]:
        key, value = until.by
        if value <= kick.by[1]:
            fail(("programme", "until", key), value, f"more than {kick.by[1]:g}, that of its kick")
    if until.end_of is not None:
        last = last_arc_of(mission, until.end_of)
        if last is None:
            names = dict.fromkeys(name for name, _ in _named_arcs(mission))
            expected = "the name of a stage, a burn or a coast: " + ", ".join(names)
            fail(("programme", "until", "end_of"), until.end_of, expected)
        if last == len(mission.arc_names) - 1:
            expected = "an arc before the last; without until it flies all of them"
            fail(("programme", "until", "end_of"), until.end_of, expected)


def _named_arcs(mission: "Mission") -> list[tuple[str, int]]:
    """Return the names of stages and of their arcs, with the last arc of the kernels of each."""
    found, count = [], 0
    for stage in mission.stages:
        for k, arc in enumerate(stage.flight_arcs):
            count += 1
            if isinstance(arc, BurnArc):
                count += len(stage.parts_of(k, mission.environment.g0_m_s2)) - 1
                count += arc.engine_out is not None
            found.append((arc.name or stage.name, count - 1))
        found.append((stage.name, count - 1))
    return found


def last_arc_of(mission: "Mission", name: str) -> int | None:
    """Return the last arc of a stage, a burn or a coast, an index; None if there is none."""
    return dict(_named_arcs(mission)).get(name)


def write_programme(mission: "Mission", record: NDArray[np.void]) -> None:
    """Write a mission's programme into its environment.

    Args:
        mission: with the programme.
        record: shape (1,), dtype ENVIRONMENT, otherwise complete. Changed.
    """
    part = mission.programme
    assert part is not None
    boost = record["boost"][0]
    over: str | None = part.over
    table = part.table
    boost["follows"] = part.beyond == "velocity"
    if part.kick is not None:
        over, at = part.kick.by
        azimuth, kick = part.azimuth_deg or 0.0, part.kick_deg or 0.0
        table = ((at, 90.0, azimuth), (at, 90.0 - kick, azimuth))
        boost["follows"] = 1
    assert over is not None and table is not None
    boost["knots"] = len(table)
    boost["over"] = OVER[over]
    columns = np.array(table).T
    boost["at"][: len(table)] = columns[0]
    boost["pitch"][: len(table)] = np.radians(columns[1])
    boost["azimuth"][: len(table)] = np.radians(columns[2])
    boost["fixed"] = part.horizon == "launch"
    boost["axes"] = horizon(tuple(mission.start().position.tolist()), record[0])
    boost["last_arc"] = layout.MAX_ARCS
    boost["end"] = math.inf
    if part.until is not None:
        key, boost["end"] = part.until.by
        boost["end_over"] = OVER[key]
        if part.until.end_of is not None:
            boost["last_arc"] = last_arc_of(mission, part.until.end_of)
