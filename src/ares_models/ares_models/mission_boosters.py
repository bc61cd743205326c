# SPDX-License-Identifier: Apache-2.0
"""Boosters that burn beside the first burn of a stage, and the arcs that they make of it.

For the kernels a burn with boosters is several arcs, each with the thrust, the mass flow and the
exit area of all that burns then. An empty booster drops as it burns out. A burn with a vertical
rise or a throttle bucket is several arcs too.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from ares_models import mission_keys as allowed
from ares_models.arrays import MAX_KNOTS
from ares_models.mission_arcs import BurnArc, check_curve
from ares_models.mission_keys import Part, added_later, fail, one_of, optional

if TYPE_CHECKING:
    from ares_models.mission_parts import Stage

Array = NDArray[np.float64]
Row = NDArray[np.void]

#: Difference of two event times that is rounding, s.
SAME_EVENT = 1e-6


class Booster(Part):
    """Hold boosters of one kind: liquid or solid, lit with the stage or later."""

    model_config = ConfigDict(
        json_schema_extra=one_of(
            ("thrust_n", "burn_time_s"), ("thrust_n", "isp_s"), ("thrust_table",)
        )
    )

    name: allowed.Name = Field(description="unique; shown in events")
    count: allowed.EngineCount = Field(
        default=1, description="how many; the masses and thrust are of one"
    )
    dry_mass_kg: allowed.Mass = Field(description="what drops")
    propellant_kg: allowed.Mass = Field(description="all of it burns")
    thrust_n: allowed.Thrust | None = optional("vacuum")
    burn_time_s: allowed.Duration | None = optional("its mass flow follows")
    isp_s: allowed.SpecificImpulse | None = optional("vacuum, in place of burn_time_s")
    thrust_table: allowed.ThrustTable | None = optional(
        "in place of thrust_n: vacuum thrust after its own ignition, knots [seconds, newtons]; "
        "the mass flow is in proportion"
    )
    exit_area_m2: allowed.Area | None = optional("of its nozzle")
    ignition_s: allowed.Delay = Field(default=0.0, description="after the ignition of the stage")
    drop_delay_s: allowed.Delay | None = added_later("from its burnout until it drops")
    ballistic_coefficient_kg_m2: allowed.BallisticCoefficient | None = added_later(
        "of one as it falls: mass over drag coefficient times area"
    )

    @model_validator(mode="after")
    def _one_form(self) -> "Booster":
        most = allowed.HEAVIEST_KG / self.count
        if self.dry_mass_kg > most:
            expected = f"at most {most:g} kg, because {self.count} of them drop at once"
            fail(("dry_mass_kg",), self.dry_mass_kg, expected)
        if self.thrust_table is not None:
            check_curve("thrust_table", self.thrust_table)
            self.refuse(("thrust_n", "burn_time_s", "isp_s"), "no such key beside thrust_table")
            return self
        if self.thrust_n is None:
            fail(("thrust_n",), None, "a number in N, or a thrust_table in its place")
        if not self.take_one(("burn_time_s", "isp_s")):
            fail(("burn_time_s",), None, "a number in s, or isp_s in its place")
        return self

    def burn_s(self, g0: float) -> float:
        """Return the length of the burn, s; g0 in m/s2."""
        if self.thrust_table is not None:
            return self.thrust_table[-1][0]
        if self.burn_time_s is not None:
            return self.burn_time_s
        return self.propellant_kg * g0 * (self.isp_s or math.nan) / (self.thrust_n or math.nan)

    def end_s(self, g0: float) -> float:
        """Return the burnout, s after the ignition of the stage; g0 in m/s2."""
        return self.ignition_s + self.burn_s(g0)

    def drop_s(self, g0: float) -> float:
        """Return the drop, s after the ignition of the stage; g0 in m/s2."""
        return self.end_s(g0) + (self.drop_delay_s or 0.0)

    def thrust(self, g0: float) -> tuple[Array, Array]:
        """Return knots of the thrust of all: times after the ignition of the stage, s; N."""
        knots = self.thrust_table or ((0.0, self.thrust_n or 0.0), (self.burn_s(g0), self.thrust_n))
        times, newtons = np.array(knots, np.float64).T
        return self.ignition_s + times, self.count * newtons

    def flow_per_thrust(self, g0: float) -> float:
        """Return the mass flow per thrust, kg/(N s); g0 in m/s2."""
        times, newtons = self.thrust(g0)
        return self.count * self.propellant_kg / float(np.trapezoid(newtons, times))


class BurnPart(NamedTuple):
    """Hold a part of a burn that is an arc of its own.

    Attributes:
        name: of the arc.
        begin, end: s after ignition; the end of a free burn is inf.
        vertical: the thrust is along the vertical.
        continues: no engine is lit at its begin.
        lit: the boosters that burn.
        throttle: fraction of full thrust.
    """

    name: str
    begin: float
    end: float
    vertical: bool
    continues: bool
    lit: tuple[Booster, ...]
    throttle: float = 1.0


def burn_parts(
    name: str, burn: BurnArc, boosters: Sequence[Booster], g0: float
) -> tuple[BurnPart, ...]:
    """Cut a burn where boosters light, burn out and drop, after a vertical rise, and at a bucket.

    Args:
        name: of the burn.
        burn: the burn.
        boosters: beside it.
        g0: m/s2.
    """
    length, rise = burn.duration_s, burn.vertical_rise_s or 0.0
    ignitions = [booster.ignition_s for booster in boosters]
    ends = [time for booster in boosters for time in (booster.end_s(g0), booster.drop_s(g0))]
    times = {0.0, rise, *ignitions, *ends}
    cuts: list[float] = []
    for t in sorted(times):
        if t < length - SAME_EVENT and (not cuts or t > cuts[-1] + SAME_EVENT):
            cuts.append(t)
    parts = []
    for begin, end in pairwise((*cuts, length)):
        lit = tuple(
            booster
            for booster in boosters
            if booster.ignition_s < begin + SAME_EVENT < booster.end_s(g0) - SAME_EVENT
        )
        lights = any(abs(t - begin) <= SAME_EVENT for t in (0.0, *ignitions))
        vertical = begin < rise - SAME_EVENT
        whole = name + "".join(f" with {booster.name}" for booster in lit)
        whole += "".join(
            f", {booster.name} empty"
            for booster in boosters
            if booster.end_s(g0) - SAME_EVENT < begin < booster.drop_s(g0) - SAME_EVENT
        )
        whole += ", vertical rise" * vertical
        parts.append(BurnPart(whole, begin, end, vertical, not lights, lit))
    if burn.throttle_bucket is not None:
        before = parts[-1]
        after = before._replace(name=f"{name}, full thrust again", continues=True)
        parts += [after._replace(name=f"{name}, throttled", throttle=burn.throttle_bucket), after]
    return tuple(parts)


def part_row(core: Row, part: BurnPart, last: bool, g0: float) -> Row:
    """Return the arc of a part of a burn, shape (1,), dtype ARC.

    Args:
        core: the whole burn without boosters.
        part: the part.
        last: it is the last one.
        g0: m/s2.
    """
    row = core.copy()
    row["begins_stage"] = 0 if part.continues or part.begin > 0.0 else core["begins_stage"]
    row["continues"] = part.continues
    row["vertical"] = part.vertical
    for name in ("thrust", "mass_flow"):
        row[name] *= part.throttle
    row["duration"] = part.end - part.begin
    for name in ("shortest", "longest"):
        row[name] = row["duration"] if math.isfinite(part.end) else core[name] - part.begin
    row["shortest"] = max(0.0, float(row["shortest"][0]))
    if not last:
        row["tail_knots"] = row["tail_gain"] = 0
    if part.lit or (core["tabled"] and row["duration"] < core["duration"]):
        _add_up(row, core, part, g0)
    return row


class _Curve(NamedTuple):
    """Hold thrust and mass flow of what burns, straight between knots, perhaps with jumps.

    Attributes:
        time: of the knots, s after the ignition of the stage; two at one time are a jump.
        thrust: N.
        flow: kg/s.
    """

    time: Array
    thrust: Array
    flow: Array

    def just_after(self, times: Array) -> tuple[Array, Array]:
        """Return thrust and mass flow just after some times, N and kg/s."""
        return self._between(np.searchsorted(self.time, times, side="right"), times)

    def just_before(self, times: Array) -> tuple[Array, Array]:
        """Return thrust and mass flow just before some times, N and kg/s."""
        return self._between(np.searchsorted(self.time, times, side="left"), times)

    def _between(self, upper: NDArray[np.intp], times: Array) -> tuple[Array, Array]:
        j = np.clip(upper, 1, self.time.size - 1)
        i = j - 1
        part = np.clip((times - self.time[i]) / (self.time[j] - self.time[i]), 0.0, 1.0)
        return (
            self.thrust[i] + part * (self.thrust[j] - self.thrust[i]),
            self.flow[i] + part * (self.flow[j] - self.flow[i]),
        )


def _core_curve(core: Row, part: BurnPart) -> _Curve:
    """Return thrust and mass flow of a burn without boosters, over one of its parts."""
    thrust, flow = float(core["thrust"][0]), float(core["mass_flow"][0])
    if not core["tabled"]:
        return _Curve(np.array([part.begin, part.end]), np.full(2, thrust), np.full(2, flow))
    knots = int(core["start_knots"][0])
    return _Curve(
        core["start_time"][0, :knots],
        thrust * core["start_fraction"][0, :knots],
        flow * core["start_flow"][0, :knots],
    )


def _add_up(row: Row, core: Row, part: BurnPart, g0: float) -> None:
    """Write the thrust, mass flow and exit area of all that burns in a part to its arc."""
    curves = [_core_curve(core, part)]
    if part.lit and not core["tabled"]:
        row["core_thrust"], row["core_flow"] = core["thrust"], core["mass_flow"]
    for booster in part.lit:
        times, newtons = booster.thrust(g0)
        curves.append(_Curve(times, newtons, newtons * booster.flow_per_thrust(g0)))
        row["exit_area"] += booster.count * (booster.exit_area_m2 or 0.0)
    inner = np.unique(np.concatenate([curve.time for curve in curves]))
    inner = inner[(inner > part.begin + SAME_EVENT) & (inner < part.end - SAME_EVENT)]
    begins, ends = np.append(part.begin, inner), np.append(inner, part.end)
    after = np.sum([curve.just_after(begins) for curve in curves], axis=0)
    before = np.sum([curve.just_before(ends) for curve in curves], axis=0)
    # both sides of each interval; a knot that is no jump stands there twice
    times = np.ravel(np.column_stack((begins, ends)))
    force, flow = (np.ravel(np.column_stack(sides)) for sides in zip(after, before, strict=True))
    once = np.ones(times.size, bool)
    once[2::2] = (force[2::2] != force[1:-1:2]) | (flow[2::2] != flow[1:-1:2])
    times, force, flow = times[once], force[once], flow[once]
    impulse, mass = np.trapezoid(force, times), np.trapezoid(flow, times)
    row["thrust"] = force.max()
    row["exhaust_velocity"] = impulse / mass
    row["mass_flow"] = row["thrust"] / row["exhaust_velocity"]
    row["tabled"] = np.ptp(force) > 0.0
    if not row["tabled"]:
        # the thrust is constant, whatever the curve of the whole burn
        row["start_knots"] = row["start_loss"] = 0
        return
    row["start_knots"] = times.size
    row["start_time"][0, : times.size] = times - part.begin
    row["start_fraction"][0, : times.size] = force / row["thrust"]
    row["start_flow"][0, : times.size] = flow / row["mass_flow"]
    row["start_loss"] = times[-1] - times[0] - impulse / row["thrust"]


def check_boosters(stage_path: tuple[str | int, ...], stage: "Stage", g0: float) -> None:
    """Check boosters against the burn beside which they burn.

    Args:
        stage_path: key path of the stage.
        stage: the stage.
        g0: m/s2.

    Raises:
        PydanticCustomError: a booster does not fit.
    """
    boosters = stage.boosters
    if not boosters:
        return
    burn = stage.burns[0]
    alone = ("start", "tail_off", "engine_out", "max_acceleration_m_s2", "throttle_bucket")
    burn.refuse(alone, "no such key in a burn beside boosters", stage_path)
    knots = 2 + len(burn.thrust_table or ()) + len(burn.mass_flow_table or ())
    knots += sum(len(booster.thrust_table or ()) for booster in boosters)
    if knots > MAX_KNOTS:
        fail((*stage_path, "boosters"), knots, f"at most {MAX_KNOTS} knots in all thrust tables")
    for i, booster in enumerate(boosters):
        end = booster.end_s(g0)
        if end > burn.duration_s + SAME_EVENT:
            key = booster.given(("thrust_table", "burn_time_s", "isp_s"))[0]
            fail(
                (*stage_path, "boosters", i, key),
                getattr(booster, key),
                f"a burnout before the burn beside it ends, at {burn.duration_s:g} s: the booster "
                f"burns out at {end:.6g} s",
            )
        if booster.drop_s(g0) > burn.duration_s + SAME_EVENT:
            fail(
                (*stage_path, "boosters", i, "drop_delay_s"),
                booster.drop_delay_s,
                f"a drop before the burn beside it ends, at {burn.duration_s:g} s: the booster "
                f"burns out at {end:.6g} s",
            )
