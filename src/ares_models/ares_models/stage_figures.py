# SPDX-License-Identifier: Apache-2.0
"""Compute what a launch engineer checks first: thrust to weight, burn time and delta-V by stage."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ares_models.arrays import BURN
from ares_models.mission_physics import lift_off

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ares_models.mission import Mission

#: Points between which impulse is added up.
_POINTS = 1001
#: Mass below which none is divided by.
_LEAST_KG = 1e-9


class StageFigures(NamedTuple):
    """Hold the figures of a stage, boosters included.

    Attributes:
        name: of the stage.
        ignition_mass_kg: of the stage and all above it.
        thrust_to_weight: at lift-off from a pad, in its air; else in vacuum at ignition, by g0.
            It is that of the burn that takes most propellant, and of a table the mean.
        burn_time_s: of all burns, at full thrust, until the usable propellant is gone or the
            burns of fixed length end.
        delta_v_m_s: in vacuum, without gravity. Jettisons that wait for heating are dropped at
            the first ignition.
        isp_s: of the stage's own engines, by kind of burn: impulse by weight of propellant.
        boosters: count, name, length of the burn, s, and specific impulse, s, of each kind.
    """

    name: str
    ignition_mass_kg: float
    thrust_to_weight: float
    burn_time_s: float
    delta_v_m_s: float
    isp_s: tuple[float, ...]
    boosters: tuple[tuple[int, str, float, float], ...]


class _BurnCurve(NamedTuple):
    """Hold thrust, N, and mass flow, kg/s, over time, s, and how long the burn is."""

    time: "NDArray[np.float64]"
    thrust: "NDArray[np.float64]"
    flow: "NDArray[np.float64]"

    @property
    def propellant_kg(self) -> float:
        """Return what it burns."""
        return float(np.trapezoid(self.flow, self.time))


def stage_figures(mission: "Mission") -> tuple[StageFigures, ...]:
    """Compute the figures of each stage in flight order."""
    arcs, g0 = mission.arrays().arcs, mission.environment.g0_m_s2
    found = []
    for k, stage in enumerate(mission.stages):
        rows = arcs[(arcs["stage"] == k) & (arcs["kind"] == BURN)]
        mass = mission.ignition_mass(k)
        timed = [
            (drop.time_after_ignition_s or 0.0, drop.mass_kg)
            for drop in mission.drops
            if drop.stage == stage.name
        ]
        burns = _burns(rows, mission.propellant(k))
        isp = (burn.exhaust_velocity(g0) / g0 for burn in stage.burns)
        boosters = tuple(
            (one.count, one.name, one.burn_s(g0), 1.0 / (g0 * one.flow_per_thrust(g0)))
            for one in stage.boosters
        )
        if k == 0 and mission.initial_state.AT_REST:
            ratio = lift_off(mission).ratio
        else:
            main = max(burns, key=lambda burn: burn.propellant_kg)
            ratio = float(np.mean(main.thrust)) / (mass * g0)
        found.append(
            StageFigures(
                name=stage.name,
                ignition_mass_kg=mass,
                thrust_to_weight=ratio,
                burn_time_s=float(sum(burn.time[-1] for burn in burns)),
                delta_v_m_s=_delta_v(burns, mass, sorted(timed)),
                isp_s=tuple(dict.fromkeys(isp)),
                boosters=boosters,
            )
        )
    return tuple(found)


def _burns(rows: "NDArray[np.void]", usable: float) -> list[_BurnCurve]:
    """Return the burns of a stage; a free one takes what those of fixed length leave."""
    fixed = [_burn(row, float(row["duration"])) for row in rows]
    left = usable - sum(burn.propellant_kg for burn in fixed)
    burns = []
    for row, burn in zip(rows, fixed, strict=True):
        if row["tabled"] or 0.0 < row["duration"] < math.inf:
            burns.append(burn)
        else:
            burns.append(_burn(row, max(0.0, left) / row["mass_flow"]))
            left = 0.0
    return burns


def _burn(row: np.void, length: float) -> _BurnCurve:
    """Return a burn by its table, or at full thrust for a length, s; none if that is free."""
    if row["tabled"]:
        knots = slice(0, int(row["start_knots"]))
        known = row["start_time"][knots]
        end = min(float(known[-1]), length)
        grid = np.union1d(np.linspace(0.0, end, _POINTS), known[known < end])
        thrust = row["thrust"] * np.interp(grid, known, row["start_fraction"][knots])
        return _BurnCurve(
            grid, thrust, row["mass_flow"] * np.interp(grid, known, row["start_flow"][knots])
        )
    grid = np.linspace(0.0, length if length < math.inf else 0.0, _POINTS)
    return _BurnCurve(grid, np.full(_POINTS, row["thrust"]), np.full(_POINTS, row["mass_flow"]))


def _delta_v(burns: list[_BurnCurve], mass: float, timed: list[tuple[float, float]]) -> float:
    """Add up impulse over mean mass; masses drop at times after the ignition of the stage, s."""
    total = began = 0.0
    for burn in burns:
        steps = np.diff(burn.time)
        impulse = 0.5 * (burn.thrust[1:] + burn.thrust[:-1]) * steps
        spent = 0.5 * (burn.flow[1:] + burn.flow[:-1]) * steps
        dropped = sum(np.where(began + burn.time[:-1] >= at, kg, 0.0) for at, kg in timed)
        before = np.maximum(mass - np.cumsum(spent) + spent - dropped, _LEAST_KG)
        after = np.maximum(before - spent, _LEAST_KG)
        with np.errstate(invalid="ignore"):
            mean = np.where(before > after, (before - after) / np.log(before / after), before)
        total += float(np.sum(impulse / mean))
        mass -= float(np.sum(spent))
        began += float(burn.time[-1])
    return total
