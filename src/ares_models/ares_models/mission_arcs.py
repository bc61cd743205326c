# SPDX-License-Identifier: Apache-2.0
"""Define the arcs of a stage as validated data: burns, solid motors, coasts."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator

from ares_models import mission_keys as allowed
from ares_models.arrays import MAX_KNOTS
from ares_models.input_file import unit_of
from ares_models.mission_keys import Part, added_later, by_keys, fail, one_of, optional
from ares_models.ranges import Range


def check_curve(
    key: str, curve: tuple[tuple[float, float], ...] | None, end: float | None = None
) -> None:
    """Report knots of a curve over time that are out of order, or a wrong end.

    Args:
        key: of the curve.
        curve: its knots; None: there is none.
        end: value of the last knot; None: any.
    """
    if curve is None:
        return
    if curve[0][0] != 0.0:
        fail((key, 0), list(curve[0]), "a first knot at 0 s")
    for k in range(1, len(curve)):
        before, now = curve[k - 1][0], curve[k][0]
        if now < before:
            fail((key, k), list(curve[k]), f"a time of {before} s or later, as the knot before")
        if before < now < before + allowed.MIN_TIME_S:
            expected = f"the time of the knot before, or at least {allowed.MIN_TIME_S} s later"
            fail((key, k), list(curve[k]), expected)
    if end is not None and curve[-1][1] != end:
        fail((key, len(curve) - 1), list(curve[-1]), f"a last thrust fraction of {end:g}")
    if not curve[-1][0] > 0.0:
        fail((key, len(curve) - 1), list(curve[-1]), "a last time greater than 0 s")


def curve_area(curve: Sequence[tuple[float, float]]) -> float:
    """Integrate a curve over its knots: a thrust fraction to s, a thrust to N s."""
    return sum(0.5 * (t1 - t0) * (f0 + f1) for (t0, f0), (t1, f1) in pairwise(curve))


class Table(NamedTuple):
    """Hold thrust and mass flow of a solid motor over its burn, linear between common knots.

    Attributes:
        time_s: since ignition, shape (n,).
        thrust_n, flow_kg_s: shape (n,).
    """

    time_s: tuple[float, ...]
    thrust_n: tuple[float, ...]
    flow_kg_s: tuple[float, ...]

    @property
    def impulse(self) -> float:
        """Integrate the thrust, N s."""
        return curve_area(tuple(zip(self.time_s, self.thrust_n, strict=True)))

    @property
    def propellant_kg(self) -> float:
        """Integrate the mass flow, kg."""
        return curve_area(tuple(zip(self.time_s, self.flow_kg_s, strict=True)))


def _common_knots(*curves: tuple[tuple[float, float], ...]) -> list[tuple[float, ...]]:
    """Resample curves on their common knots, as (time, value of each); a jump is two knots."""
    times = sorted({t for curve in curves for t, _ in curve})
    values = [[sides(curve, t) for curve in curves] for t in times]
    knots = []
    for t, both in zip(times, values, strict=True):
        knots.append((t, *(before for before, _ in both)))
        if any(before != after for before, after in both):
            knots.append((t, *(after for _, after in both)))
    return knots


def sides(curve: Sequence[tuple[float, float]], t: float) -> tuple[float, float]:
    """Return the values of a curve just before and just after a time."""
    at = [value for time, value in curve if time == t]
    if at:
        return at[0], at[-1]
    for (t0, f0), (t1, f1) in pairwise(curve):
        if t0 < t < t1:
            value = f0 + (f1 - f0) * (t - t0) / (t1 - t0)
            return value, value
    return curve[-1][1], curve[-1][1]


class EngineOut(Part):
    """Hold an engine loss during a burn; the others burn the remaining propellant."""

    time_after_ignition_s: allowed.Duration = Field(description="when engines are lost")
    engines: Annotated[int, Range(2, 100)] = Field(description="engines burning before the loss")
    lost: Annotated[int, Range(1, 99)] = Field(default=1, description="engines that are lost")

    @model_validator(mode="after")
    def _some_are_left(self) -> "EngineOut":
        if self.lost >= self.engines:
            fail(("lost",), self.lost, f"fewer than the {self.engines} engines")
        return self

    @property
    def left(self) -> float:
        """Return the remaining fraction of the thrust."""
        return (self.engines - self.lost) / self.engines


def check_bounds(key: str, arc: "BurnArc | CoastArc") -> None:
    """Report bounds of a time that is not free, or an upper bound below the lower."""
    if not arc.free:
        arc.refuse(("min_s", "max_s"), f"no such key without {key}: free")
    if arc.min_s is not None and arc.max_s is not None and arc.min_s > arc.max_s:
        fail(("min_s",), arc.min_s, f"at most max_s, {arc.max_s} s")


#: Keys of a burn that a thrust table excludes.
_NO_TABLE = (
    *("thrust_n", "burn_time_s", "min_s", "max_s", "max_acceleration_m_s2", "min_throttle"),
    *("start", "tail_off", "engine_out", "throttle_bucket"),
)
#: Keys that a burn with a throttle bucket excludes.
_NO_BUCKET = ("min_s", "max_s", "max_acceleration_m_s2", "start", "engine_out")
#: Required keys of a burn, in one of these forms.
BURN_FORMS = (
    ("thrust_n", "isp_s", "burn_time_s"),
    ("thrust_table", "isp_s"),
    ("thrust_table", "mass_flow_table"),
)


class BurnArc(Part):
    """Hold a burn: liquid, perhaps throttled or with an engine loss, or solid.

    A solid motor burns by its table.
    """

    model_config = ConfigDict(json_schema_extra=one_of(*BURN_FORMS))
    #: Key of the length.
    LENGTH: ClassVar[str] = "burn_time_s"

    name: allowed.Name | None = optional("shown in events; default: the stage's")
    thrust_n: allowed.Thrust | None = optional("full thrust of all engines, vacuum")
    isp_s: allowed.SpecificImpulse | None = optional("vacuum; mass flow is T / (g0 Isp)")
    engines: allowed.EngineCount = Field(default=1, description="that share the thrust")
    burn_time_s: allowed.BurnTime | None = optional(
        "from ignition command to cut-off command, free, or depletion: until the propellant_kg of "
        "its stage is gone"
    )
    thrust_table: allowed.ThrustTable | None = added_later(
        "of a solid motor, in place of thrust_n and burn_time_s: vacuum thrust after "
        "ignition, knots [seconds, newtons]; the burn ends with it"
    )
    mass_flow_table: allowed.FlowTable | None = added_later(
        "beside thrust_table, in place of isp_s: knots [seconds, kilograms per second]"
    )
    min_s: allowed.Delay | None = optional("least length, if it is free")
    max_s: allowed.Duration | None = optional("greatest length, if it is free")
    min_altitude_m: allowed.FloorAltitude | None = added_later("least altitude, all along it")
    exit_area_m2: allowed.Area | None = added_later(
        "of all nozzles together: thrust is that in vacuum less ambient pressure times this"
    )
    vertical_rise_s: allowed.Duration | None = added_later(
        "at ignition the thrust is along the vertical for so long"
    )
    attitude: Literal["guided", "held"] = Field(
        default="guided", description="held: the direction at ignition is kept; not for a free burn"
    )
    max_acceleration_m_s2: allowed.Acceleration | None = optional(
        "throttled to this thrust acceleration from where full thrust would pass it"
    )
    min_throttle: allowed.Fraction | None = optional(
        "fraction of full thrust below which it is not throttled"
    )
    throttle_bucket: allowed.BucketThrottle | None = added_later(
        "fraction of full thrust around the greatest dynamic pressure; from when to "
        "when, the optimizer plans"
    )
    start: allowed.Curve | None = optional(
        "thrust fraction after the ignition command, knots [seconds, fraction]"
    )
    tail_off: allowed.Curve | None = optional(
        "thrust fraction after the cut-off command, knots [seconds, fraction]"
    )
    engine_out: EngineOut | None = optional("the burn loses engines and goes on with the others")

    @model_validator(mode="after")
    def _whole(self) -> "BurnArc":
        self.check_whole()
        return self

    def check_whole(self, instead: str = "") -> None:
        """Report keys that contradict each other.

        Args:
            instead: alternative to a missing key, for the message.
        """
        if self.thrust_table is not None:
            self._check_table(self.thrust_table)
            self._check_vertical()
            return
        self.refuse(("mass_flow_table",), "no such key without thrust_table")
        self._check_vertical()
        for key in BURN_FORMS[0]:
            if getattr(self, key) is None:
                fail((key,), None, f"a number{unit_of(key)}{instead}")
        check_bounds("burn_time_s", self)
        self._check_throttle()
        self._check_bucket()
        self._check_curves()

    def _check_vertical(self) -> None:
        """Report a vertical rise that is not the first part of a burn of known, full thrust."""
        rise = self.vertical_rise_s
        if rise is None:
            return
        excluded = ("start", "engine_out", "max_acceleration_m_s2")
        self.refuse(excluded, "no such key beside vertical_rise_s")
        if self.attitude == "held":
            fail(("attitude",), "held", "guided, beside vertical_rise_s")
        if self.free and self.throttle_bucket is None:
            expected = "a burn of fixed length for it, before the one with burn_time_s: free"
            fail(("vertical_rise_s",), rise, expected)
        if rise >= self.duration_s:
            fail(("vertical_rise_s",), rise, f"less than the burn, {self.duration_s:g} s")

    def _check_table(self, thrust: tuple[tuple[float, float], ...]) -> None:
        """Report keys that contradict a thrust table, and errors in the tables."""
        self.refuse(_NO_TABLE, "no such key beside thrust_table")
        if self.engines != 1:
            expected = "1, because thrust_table is the thrust of all motors together"
            fail(("engines",), self.engines, expected)
        check_curve("thrust_table", thrust)
        check_curve("mass_flow_table", self.mass_flow_table)
        if self.mass_flow_table is None:
            if self.isp_s is None:
                fail(("isp_s",), None, "a number in s, or a mass_flow_table in its place")
        else:
            self.refuse(("isp_s",), "no such key beside mass_flow_table")
            self._check_flow(thrust, self.mass_flow_table)
        if thrust[-1][1] == 0.0 == thrust[-2][1]:
            fail(("thrust_table", len(thrust) - 1), list(thrust[-1]), "thrust until the last knot")

    def _check_flow(
        self, thrust: tuple[tuple[float, float], ...], flow: tuple[tuple[float, float], ...]
    ) -> None:
        """Report a mass flow table that does not match the thrust table."""
        path = ("mass_flow_table",)
        if flow[-1][0] != thrust[-1][0]:
            expected = f"a last time of {thrust[-1][0]:g} s, as of thrust_table"
            fail((*path, len(flow) - 1), list(flow[-1]), expected)
        knots = _common_knots(thrust, flow)
        if len(knots) > MAX_KNOTS:
            fail(path, len(knots), f"at most {MAX_KNOTS} knots in both tables together")
        for (t, f0, m0), (_, f1, m1) in pairwise(knots):
            if (f0 + f1 > 0.0) != (m0 + m1 > 0.0):
                expected = f"a mass flow where there is thrust, and only there; at {t:g} s"
                fail(path, list(flow), expected)

    def table(self, g0: float) -> Table:
        """Return thrust and mass flow of a solid motor on common knots.

        Args:
            g0: m/s2.
        """
        thrust = self.thrust_table or ()
        if self.mass_flow_table is not None:
            return Table(*zip(*_common_knots(thrust, self.mass_flow_table), strict=True))
        exhaust = g0 * (self.isp_s or math.nan)
        times, newtons = zip(*thrust, strict=True)
        return Table(times, newtons, tuple(force / exhaust for force in newtons))

    def _check_throttle(self) -> None:
        if self.max_acceleration_m_s2 is None:
            self.refuse(("min_throttle",), "no such key without max_acceleration_m_s2")
            return
        excluded = ("start", "tail_off", "engine_out")
        self.refuse(excluded, "no such key beside max_acceleration_m_s2")

    def _check_bucket(self) -> None:
        """Report keys that contradict a throttle bucket."""
        if self.throttle_bucket is None:
            return
        if not self.free:
            expected = "free, beside throttle_bucket: the optimizer plans the length"
            fail(("burn_time_s",), self.burn_time_s, expected)
        self.refuse(_NO_BUCKET, "no such key beside throttle_bucket")

    def _check_curves(self) -> None:
        check_curve("start", self.start, 1.0)
        check_curve("tail_off", self.tail_off, 0.0)
        if self.start and self.duration_s < self.start[-1][0]:
            expected = f"at least the {self.start[-1][0]} s that the start takes"
            fail(("burn_time_s",), self.duration_s, expected)
        if self.engine_out:
            self._check_engine_out(self.engine_out)

    def _check_engine_out(self, failure: EngineOut) -> None:
        path, at = ("engine_out", "time_after_ignition_s"), failure.time_after_ignition_s
        if self.free:
            fail(path, at, "no engine_out in a burn with burn_time_s: free")
        earliest = 0.0 if self.start is None else self.start[-1][0]
        if not earliest <= at < self.duration_s:
            end = f"the end of the burn at {self.duration_s:g} s"
            fail(path, at, f"a time from {earliest:g} s to {end}")

    @property
    def free(self) -> bool:
        """Return whether guidance decides the cut-off."""
        return self.burn_time_s == "free"

    @property
    def duration_s(self) -> float:
        """Return the time from ignition command to cut-off command; inf if free."""
        if self.thrust_table is not None:
            return self.thrust_table[-1][0]
        return self.burn_time_s if isinstance(self.burn_time_s, float) else math.inf

    @property
    def thrust_key(self) -> str:
        """Return the key that gives the thrust."""
        return "thrust_n" if self.thrust_table is None else "thrust_table"

    @property
    def flow_key(self) -> str:
        """Return the key that gives the mass flow."""
        return "isp_s" if self.mass_flow_table is None else "mass_flow_table"

    @property
    def full_thrust_n(self) -> float:
        """Return the full thrust; of a table the largest."""
        if self.thrust_table is not None:
            return max(force for _, force in self.thrust_table)
        return self.thrust_n or math.nan

    def exhaust_velocity(self, g0: float) -> float:
        """Return the exhaust velocity g0 Isp, m/s; with a mass flow table the mean of the burn."""
        if self.mass_flow_table is not None:
            table = self.table(g0)
            return table.impulse / table.propellant_kg
        return g0 * (self.isp_s or math.nan)

    @property
    def start_loss_s(self) -> float:
        """Return the impulse lost at the start, in s of full thrust."""
        return 0.0 if self.start is None else self.start[-1][0] - curve_area(self.start)

    @property
    def tail_gain_s(self) -> float:
        """Return the impulse after the cut-off command, in s of full thrust."""
        return 0.0 if self.tail_off is None else curve_area(self.tail_off)

    @property
    def tail_s(self) -> float:
        """Return the length of the tail-off after the cut-off command."""
        return 0.0 if self.tail_off is None else self.tail_off[-1][0]

    def mass_flow(self, g0: float) -> float:
        """Return the mass flow at full thrust, T / (g0 Isp), kg/s; Eq. 2.1."""
        return self.full_thrust_n / self.exhaust_velocity(g0)

    def propellant(
        self, g0: float, mass_kg: float, drops: Sequence[tuple[float, float]] = ()
    ) -> float:
        """Compute the propellant of a burn with start and tail-off, kg; inf if free.

        Args:
            g0: m/s2.
            mass_kg: at ignition; needed for a throttled burn only, as are the drops.
            drops: what is dropped meanwhile, in order: s after ignition, kg.
        """
        if self.thrust_table is not None:
            return self.table(g0).propellant_kg
        flow = self.mass_flow(g0)
        time = self.duration_s - self.start_loss_s + self.tail_gain_s
        if self.max_acceleration_m_s2 is None or math.isinf(time):
            return flow * time
        used = begin = 0.0
        for end, dropped in (*drops, (time, 0.0)):
            used += self._throttled(g0, mass_kg - used, min(end, time) - begin)
            mass_kg -= dropped
            begin = min(end, time)
        return used

    def _throttled(self, g0: float, mass_kg: float, time: float) -> float:
        """Compute the propellant of a part of a throttled burn, kg; its mass, kg, and length, s."""
        flow, limit = self.mass_flow(g0), self.max_acceleration_m_s2 or math.inf
        # full thrust until the acceleration limit, constant acceleration until the least
        # thrust, then least thrust
        least = self.least_throttle
        upper = min(mass_kg, self.full_thrust_n / limit)
        full = min(time, (mass_kg - upper) / flow)
        throttled = time - full
        if throttled <= 0.0:
            return flow * full
        lower = min(upper, least * self.full_thrust_n / limit)
        fade = self.exhaust_velocity(g0) / limit
        if lower <= 0.0 or throttled <= fade * math.log(upper / lower):
            return flow * full + upper * -math.expm1(-throttled / fade)
        rest = throttled - fade * math.log(upper / lower)
        return flow * full + upper - lower + least * flow * rest

    @property
    def least_throttle(self) -> float:
        """Return the least throttle setting, a fraction of full thrust."""
        return 0.0 if self.min_throttle is None else self.min_throttle


#: Keys of a coast that prescribe its orbit.
ORBIT_KEYS = ("perigee_altitude_m", "apogee_altitude_m", "inclination_deg")


class CoastArc(Part):
    """Hold an arc without thrust."""

    #: Key of the length.
    LENGTH: ClassVar[str] = "coast_s"

    name: allowed.Name | None = optional("shown in events; default: the stage's")
    coast_s: allowed.FreeTime = Field(description="how long, or free")
    min_s: allowed.Delay | None = optional("least length, if it is free")
    max_s: allowed.Duration | None = optional("greatest length, if it is free")
    min_altitude_m: allowed.FloorAltitude | None = added_later(
        "least altitude, all along it; of a free coast after a burn by default the "
        "edge of the air, 100 km on Earth, unless it begins below that in the ascent"
    )
    min_perigee_altitude_m: allowed.FloorAltitude | None = added_later(
        "least perigee of the orbit it is flown on, above the equatorial radius"
    )
    perigee_altitude_m: allowed.Altitude | None = added_later(
        "perigee of the orbit it is flown on, above the equatorial radius"
    )
    apogee_altitude_m: allowed.Altitude | None = added_later(
        "its apogee; both are named, or neither"
    )
    inclination_deg: allowed.Inclination | None = added_later("of that orbit, to the equator")

    @model_validator(mode="after")
    def _bounds(self) -> "CoastArc":
        check_bounds("coast_s", self)
        given = self.given(ORBIT_KEYS)
        if not self.free:
            bounds = ("min_perigee_altitude_m", *given)
            self.refuse(bounds, "no such key where coast_s is not free")
        if not given:
            return self
        perigee, apogee = self.perigee_altitude_m, self.apogee_altitude_m
        if perigee is None or apogee is None:
            missing = "perigee_altitude_m" if perigee is None else "apogee_altitude_m"
            fail((missing,), None, f"a number in m, beside {given[0]}")
        if apogee < perigee:
            fail(("apogee_altitude_m",), apogee, f"at least perigee_altitude_m, {perigee} m")
        self.refuse(("min_perigee_altitude_m",), "no such key beside perigee_altitude_m")
        return self

    @property
    def free(self) -> bool:
        """Return whether guidance decides its end."""
        return self.coast_s == "free"

    @property
    def duration_s(self) -> float:
        """Return the length; inf if free."""
        return math.inf if self.coast_s == "free" else self.coast_s


def shortest(arc: BurnArc | CoastArc) -> float:
    """Return the least length of an arc, s."""
    return (arc.min_s or 0.0) if arc.free else arc.duration_s


Arc = Annotated[
    Annotated[BurnArc, Tag("<burn>")] | Annotated[CoastArc, Tag("<coast>")],
    Discriminator(by_keys({"<coast>": CoastArc, "<burn>": BurnArc}, "<burn>")),
]
