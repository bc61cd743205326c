# SPDX-License-Identifier: Apache-2.0
"""Turn a mission that begins at its ignition into the one that begins at the release.

The engines burn while the pad holds the vehicle, or a rail guides it. The flight begins at the
release, with what is left of propellant, burn times and thrust tables.
"""

import copy
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ares_models.input_file import KeyPath
from ares_models.mission_arcs import BurnArc, curve_area, sides
from ares_models.mission_keys import fail
from ares_models.mission_rail import leave_rail
from ares_models.mission_start import StateOnPad

if TYPE_CHECKING:
    from ares_models.mission import Mission
    from ares_models.mission_boosters import Booster

Knots = list[tuple[float, float]]


class ReleaseKey(NamedTuple):
    """Name the key that sets the release, in errors.

    Attributes:
        path: of the key.
        value: of the key.
    """

    path: KeyPath
    value: float


class HoldDown(NamedTuple):
    """Hold what became of a vehicle between its ignition and the release.

    Attributes:
        time_s: from ignition to the release.
        burnt_kg: by all that was lit.
        boosters_s: how long each kind of boosters burnt.
        speed_m_s: over the ground at the release.
    """

    time_s: float
    burnt_kg: float
    boosters_s: tuple[float, ...]
    speed_m_s: float


def release(
    data: dict[str, Any], mission: "Mission", check: Callable[[dict[str, Any]], "Mission"]
) -> tuple["Mission", HoldDown | None]:
    """Return the mission that begins at the release, and what became of the vehicle before.

    Args:
        data: content of the file.
        mission: the same, checked.
        check: check of such a content.

    Raises:
        PydanticCustomError: the first arc cannot be held so long, or the rail is never left.
    """
    pad = mission.initial_state
    if not isinstance(pad, StateOnPad) or not pad.waits:
        return mission, None
    data = copy.deepcopy(data)
    hold_s, speed = pad.hold_down_s or 0.0, 0.0
    cause = ReleaseKey(("initial_state", "hold_down_s"), hold_s)
    if pad.rail is None:
        del data["initial_state"]["hold_down_s"]
    else:
        cause = ReleaseKey(("initial_state", "rail", "length_m"), pad.rail.length_m)
        hold_s, place, velocity = leave_rail(mission, pad, pad.rail)
        speed = float(np.linalg.norm(velocity))
        data["initial_state"] = {
            "time_s": pad.time_s,
            "earth_fixed_position_m": place.tolist(),
            "earth_fixed_velocity_m_s": velocity.tolist(),
        }
    flown = check(_released(data, mission, hold_s, cause))
    return flown, HoldDown(
        hold_s,
        mission.ignition_mass(0) - flown.ignition_mass(0),
        tuple(max(0.0, hold_s - one.ignition_s) for one in mission.stages[0].boosters),
        speed,
    )


def _released(
    data: dict[str, Any], mission: "Mission", hold_s: float, cause: ReleaseKey
) -> dict[str, Any]:
    """Return the content of a mission file with what is left at the release.

    Args:
        data: content of the file, with the initial state at the release. Changed.
        mission: before the release.
        hold_s: time from ignition to the release.
        cause: what sets this time.
    """
    stage, content = mission.stages[0], data["stages"][0]
    burn = stage.flight_arcs[0]
    if not isinstance(burn, BurnArc):
        fail(*cause, "a first arc that is a burn")
    _check(mission, burn, hold_s, cause)
    part = content if stage.arcs is None else content["arcs"][0]
    used = _shorten_burn(part, burn, mission.environment.g0_m_s2, hold_s)
    if stage.propellant_kg is not None:
        content["propellant_kg"] = stage.propellant_kg - used
    for booster, part in zip(stage.boosters, content.get("boosters") or (), strict=True):
        used += _shorten_booster(part, booster, mission.environment.g0_m_s2, hold_s)
    if stage.ignition_mass_kg is not None:
        content["ignition_mass_kg"] = stage.ignition_mass_kg - used
    for jettison in data.get("jettisons") or ():
        if jettison["stage"] == stage.name and jettison.get("time_after_ignition_s") is not None:
            left = jettison["time_after_ignition_s"] - hold_s
            jettison["time_after_ignition_s"] = max(0.0, left)
    return data


def _check(mission: "Mission", burn: BurnArc, hold_s: float, cause: ReleaseKey) -> None:
    g0 = mission.environment.g0_m_s2
    ends = {"the first burn": burn.max_s or burn.duration_s}
    if burn.engine_out is not None:
        ends["its engine_out"] = burn.engine_out.time_after_ignition_s
    ends |= {f"booster {one.name}": one.end_s(g0) for one in mission.stages[0].boosters}
    for what, end in ends.items():
        if hold_s >= end:
            fail(*cause, f"a release before {what} ends, at {end:g} s; it is at {hold_s:.4g} s")
    left_s = burn.duration_s - hold_s
    if burn.vertical_rise_s is not None and burn.vertical_rise_s >= left_s:
        part = mission.stages[0].arc_path(0, "vertical_rise_s")
        expected = f"less than the {left_s:g} s from the release to the end of the burn"
        fail(("stages", 0, *part), burn.vertical_rise_s, expected)
    if burn.start is not None and hold_s < burn.start[-1][0]:
        over = f"the start of the engine is over, at {burn.start[-1][0]:g} s"
        fail(*cause, f"a release after {over}; it is at {hold_s:.4g} s")


def _shorten_burn(part: dict[str, Any], burn: BurnArc, g0: float, hold_s: float) -> float:
    """Take the time that it is held off a burn; return the propellant that it took, kg."""
    if burn.thrust_table is not None:
        flow = burn.table(g0)
        before, _ = _cut(list(zip(flow.time_s, flow.flow_kg_s, strict=True)), hold_s)
        for key in ("thrust_table", "mass_flow_table"):
            if part.get(key) is not None:
                part[key] = _cut(getattr(burn, key), hold_s)[1]
        return curve_area(before)
    for key in ("burn_time_s", "min_s", "max_s"):
        if isinstance(part.get(key), float | int):
            part[key] = max(0.0, part[key] - hold_s)
    if burn.engine_out is not None:
        part["engine_out"]["time_after_ignition_s"] -= hold_s
    part.pop("start", None)
    return (hold_s - burn.start_loss_s) * burn.mass_flow(g0)


def _shorten_booster(part: dict[str, Any], booster: "Booster", g0: float, hold_s: float) -> float:
    """Take the time that they are held off boosters; return what they all burnt, kg."""
    lit_s = max(0.0, hold_s - booster.ignition_s)
    part["ignition_s"] = max(0.0, booster.ignition_s - hold_s)
    if lit_s == 0.0:
        return 0.0
    share = lit_s / booster.burn_s(g0)
    if booster.thrust_table is not None:
        before, part["thrust_table"] = _cut(booster.thrust_table, lit_s)
        share = curve_area(before) / curve_area(booster.thrust_table)
    elif booster.burn_time_s is not None:
        part["burn_time_s"] = booster.burn_time_s - lit_s
    part["propellant_kg"] = (1.0 - share) * booster.propellant_kg
    return booster.count * share * booster.propellant_kg


def _cut(knots: Sequence[tuple[float, float]], at_s: float) -> tuple[Knots, Knots]:
    """Return the knots of a curve before a time, and those after it with times from there on."""
    earlier, later = sides(knots, at_s)
    before = [(t, value) for t, value in knots if t < at_s]
    after = [(t - at_s, value) for t, value in knots if t > at_s]
    return [*before, (at_s, earlier)], [(0.0, later), *after]
