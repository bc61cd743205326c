# SPDX-License-Identifier: Apache-2.0
"""Parts of a mission as validated data: description and range of each key.

The key of a number ends in its unit; ``_deg`` keys are in degrees, everything else is SI. Checks
across several parts are in ``mission_checks``.
"""

import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple, NoReturn

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from ares_models.arrays import MAX_ARCS, MAX_AREAS, MAX_KNOTS, MAX_VERTICES
from ares_models.ranges import Range


def fail(path: tuple[str | int, ...], value: object, expected: str) -> NoReturn:
    """Raise a validation error that concerns more than a single field.

    Args:
        path: key path from the model under validation.
        value: found value.
        expected: expected value.
    """
    raise PydanticCustomError(
        "expected", "{expected}", {"path": path, "value": value, "expected": expected}
    )


def _printable(text: str) -> str:
    if not text.isprintable():
        fail((), text, "text on one line, of characters that can be printed")
    return text


# ---- ranges of all numbers of a file, SI: from an apogee kick motor to the largest launcher ever
# designed, and from a small moon to Jupiter

#: Longest flight from the initial state to the depletion of the free burn, s: ten days.
MAX_FLIGHT_S = 864_000.0
#: Shortest burn, coast or step of a thrust curve, s.
MIN_TIME_S = 1e-3
#: Indices of NRLMSIS: solar flux, 1e-22 W/m2/Hz, and daily geomagnetic index.
SOLAR_FLUX = Range(30.0, 500.0)
GEOMAGNETIC_INDEX = Range(0.0, 400.0)
#: Range of years of an epoch.
FIRST_YEAR, LAST_YEAR = 1900, 2200

GravitationalParameter = Annotated[float, Range(1e9, 1e18)]
StandardGravity = Annotated[float, Range(0.1, 100.0)]
Oblateness = Annotated[float, Range(0.0, 0.1)]
BodyRadius = Annotated[float, Range(1e5, 1e8)]
RotationRate = Annotated[float, Range(0.0, 1e-2)]
DensityFactor = Annotated[float, Range(1e-30, 1e6)]
SolarFlux = Annotated[float, SOLAR_FLUX]
GeomagneticIndex = Annotated[float, GEOMAGNETIC_INDEX]
MissionTime = Annotated[float, Range(-1e6, 1e7)]
Coordinate = Annotated[float, Range(-1e9, 1e9)]
VelocityComponent = Annotated[float, Range(-1e7, 1e7)]
Radius = Annotated[float, Range(1e5, 1e9)]
Speed = Annotated[float, Range(1e-3, 1e6)]
Latitude = Annotated[float, Range(-90.0, 90.0)]
Turn = Annotated[float, Range(-360.0, 360.0)]
LocalTime = Annotated[float, Range(0.0, 24.0)]
FlightPathAngle = Annotated[float, Range(-90.0, 90.0)]
Inclination = Annotated[float, Range(0.0, 180.0)]
AnySemiMajorAxis = Annotated[float, Range(-1e12, 1e12)]
AnyEccentricity = Annotated[float, Range(0.0, 100.0)]
Mass = Annotated[float, Range(1e-3, 1e9)]
Load = Annotated[float, Range(0.0, 1e9)]
Thrust = Annotated[float, Range(1e-3, 1e10)]
SpecificImpulse = Annotated[float, Range(1.0, 1e6)]
Duration = Annotated[float, Range(MIN_TIME_S, MAX_FLIGHT_S)]
Delay = Annotated[float, Range(0.0, MAX_FLIGHT_S)]
KnotTime = Annotated[float, Range(0.0, 3600.0)]
Acceleration = Annotated[float, Range(1e-3, 1e4)]
Fraction = Annotated[float, Range(0.0, 1.0)]
FloorAltitude = Annotated[float, Range(-1e6, 1e9)]
Altitude = Annotated[float, Range(0.0, 1e9)]
SafeAltitude = Annotated[float, Range(0.0, 1e8)]
AreaRadius = Annotated[float, Range(1e3, 1e7)]
EngineCount = Annotated[int, Range(1, 100)]
HeatingRate = Annotated[float, Range(1e-6, 1e12)]

Name = Annotated[str, Field(strict=True, min_length=1, max_length=80), AfterValidator(_printable)]
Text = Annotated[str, Field(strict=True, min_length=1)]
Knot = tuple[KnotTime, Fraction]
ThrustKnot = tuple[KnotTime, Annotated[float, Range(0.0, 1e10)]]
FlowKnot = tuple[KnotTime, Annotated[float, Range(0.0, 1e9)]]
Vertex = tuple[Latitude, Turn]
Vertices = Annotated[tuple[Vertex, ...], Field(min_length=3, max_length=MAX_VERTICES)]
Curve = Annotated[tuple[Knot, ...], Field(min_length=2, max_length=MAX_KNOTS)]
ThrustTable = Annotated[tuple[ThrustKnot, ...], Field(min_length=2, max_length=MAX_KNOTS)]
FlowTable = Annotated[tuple[FlowKnot, ...], Field(min_length=2, max_length=MAX_KNOTS)]


def _moment(value: object) -> object:
    if isinstance(value, datetime):
        return value
    try:
        moment = datetime.fromisoformat(value) if isinstance(value, str) else None
    except ValueError:
        moment = None
    if moment is None:
        fail((), value, "a date and time such as 2010-06-21T12:00:00Z")
    if not FIRST_YEAR <= moment.year <= LAST_YEAR:
        fail((), value, f"a date and time of the years {FIRST_YEAR} to {LAST_YEAR}")
    return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)


def _is_free(value: object) -> str:
    return "<word>" if isinstance(value, str) else "<time>"


def _free(value: object) -> object:
    if value != "free":
        fail((), value, "a time in s, or the word free")
    return value


FreeTime = Annotated[
    Annotated[Duration, Tag("<time>")]
    | Annotated[Literal["free"], BeforeValidator(_free), Tag("<word>")],
    Discriminator(_is_free),
]
Moment = Annotated[
    datetime,
    BeforeValidator(_moment),
    WithJsonSchema({"type": "string", "examples": ["2010-06-21T12:00:00Z"]}),
]


class Part(BaseModel):
    """Refuse unknown keys, nan and infinity; base of all parts."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def not_there(value: object) -> bool:
    """Return whether an optional key is absent, so that digests ignore keys added later."""
    return value is None


def one_of(*forms: tuple[str, ...]) -> dict[str, Any]:
    """Build the JSON schema of a mapping with the non-empty keys of exactly one form."""
    filled = {"not": {"type": "null"}}
    return {
        "oneOf": [
            {"required": list(form), "properties": dict.fromkeys(form, filled)} for form in forms
        ]
    }


def by_keys(forms: Mapping[str, type[Part]], default: str | None) -> Callable[[Any], str | None]:
    """Build a function that chooses the form of a mapping by its keys."""

    def choose(value: Any) -> str | None:
        for tag, form in forms.items():
            if isinstance(value, form):
                return tag
        if not isinstance(value, dict):
            return default
        everywhere = set.intersection(*(set(form.model_fields) for form in forms.values()))
        score = {
            tag: len((set(form.model_fields) - everywhere) & set(value))
            for tag, form in forms.items()
        }
        best = max(score, key=lambda tag: score[tag])
        return best if score[best] > 0 else default

    return choose


class EarthPart(Part):
    """Hold figure and rotation of the body."""

    equatorial_radius_m: BodyRadius = Field(description="of the ellipsoid, Eq. 2.16")
    polar_radius_m: BodyRadius = Field(description="of the ellipsoid, Eq. 2.16")
    rotation_rate_rad_s: RotationRate = Field(description="about z")
    zero_longitude_deg: Turn | None = Field(
        default=None,
        exclude_if=not_there,
        description="right ascension of longitude zero at mission time 0, from the inertial x axis",
    )

    @model_validator(mode="after")
    def _oblate(self) -> "EarthPart":
        if self.polar_radius_m > self.equatorial_radius_m:
            fail(
                ("polar_radius_m",),
                self.polar_radius_m,
                f"at most equatorial_radius_m, {self.equatorial_radius_m} m",
            )
        return self


_INDICES = ("f107", "f107a", "ap", "latitude_deg", "longitude_deg")


class AtmospherePart(Part):
    """Select the atmosphere model; only nrlmsis has indices."""

    model: Literal["pra63", "pra63_exponential", "pra63_data", "us76", "nrlmsis", "none"] = Field(
        description="which atmosphere; nrlmsis takes place, day and activity from the keys below"
    )
    density_factor: DensityFactor = Field(default=1.0, description="multiplies every density")
    f107: SolarFlux | None = Field(
        default=None, description="solar flux of the day, 1e-22 W/m2/Hz; for nrlmsis and only there"
    )
    f107a: SolarFlux | None = Field(default=None, description="its 81-day mean; for nrlmsis")
    ap: GeomagneticIndex | None = Field(default=None, description="geomagnetic index, for nrlmsis")
    latitude_deg: Latitude | None = Field(default=None, description="place, for nrlmsis")
    longitude_deg: Turn | None = Field(default=None, description="place, for nrlmsis")

    @model_validator(mode="after")
    def _indices(self) -> "AtmospherePart":
        for key in _INDICES:
            value = getattr(self, key)
            if self.model == "nrlmsis" and value is None:
                fail((key,), None, "a number, because model is nrlmsis")
            if self.model != "nrlmsis" and value is not None:
                fail((key,), value, f"no such key, because model is {self.model}")
        if self.model == "none" and "density_factor" in self.model_fields_set:
            fail(("density_factor",), self.density_factor, "no such key, because model is none")
        return self


class EnvironmentPart(Part):
    """Hold gravity, body, altitude model and atmosphere."""

    mu_m3_s2: GravitationalParameter = Field(description="gravitational parameter")
    g0_m_s2: StandardGravity = Field(
        default=9.80665, description="turns specific impulse into exhaust velocity"
    )
    j2: Oblateness = Field(default=0.0, description="oblateness term of gravity; 0 is Eq. 2.13")
    earth: EarthPart = Field(description="figure and rotation of the body")
    altitude: Literal["ellipsoid", "spherical"] = Field(
        default="ellipsoid", description="above the ellipsoid, or r minus equatorial radius"
    )
    atmosphere: AtmospherePart = Field(
        description="for the heating that a fairing waits for; no drag"
    )


def _check_curve(
    key: str, curve: tuple[tuple[float, float], ...] | None, end: float | None = None
) -> None:
    if curve is None:
        return
    if curve[0][0] != 0.0:
        fail((key, 0), list(curve[0]), "a first knot at 0 s")
    for k in range(1, len(curve)):
        before, now = curve[k - 1][0], curve[k][0]
        if now < before:
            fail((key, k), list(curve[k]), f"a time of at least {before} s, as before it")
        if before < now < before + MIN_TIME_S:
            fail((key, k), list(curve[k]), f"the time of the knot before it, or {MIN_TIME_S} s on")
    if end is not None and curve[-1][1] != end:
        fail((key, len(curve) - 1), list(curve[-1]), f"a last thrust fraction of {end:g}")
    if not curve[-1][0] > 0.0:
        fail((key, len(curve) - 1), list(curve[-1]), "a last time greater than 0 s")


def curve_area(curve: tuple[tuple[float, float], ...]) -> float:
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
    sides = [[_sides(curve, t) for curve in curves] for t in times]
    knots = []
    for t, values in zip(times, sides, strict=True):
        knots.append((t, *(before for before, _ in values)))
        if any(before != after for before, after in values):
            knots.append((t, *(after for _, after in values)))
    return knots


def _sides(curve: tuple[tuple[float, float], ...], t: float) -> tuple[float, float]:
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

    time_after_ignition_s: Duration = Field(description="engines are lost on the way, then")
    engines: Annotated[int, Range(2, 100)] = Field(description="of so many")
    lost: Annotated[int, Range(1, 99)] = Field(default=1, description="so many")

    @model_validator(mode="after")
    def _some_are_left(self) -> "EngineOut":
        if self.lost >= self.engines:
            fail(("lost",), self.lost, f"fewer than the {self.engines} engines")
        return self

    @property
    def left(self) -> float:
        """Return the remaining fraction of the thrust."""
        return (self.engines - self.lost) / self.engines


_CIRCLE = ("latitude_deg", "longitude_deg", "radius_m")


class AreaPart(Part):
    """Hold a protected area of the ground: a circle or a polygon."""

    model_config = ConfigDict(json_schema_extra=one_of(_CIRCLE, ("vertices_deg",)))

    name: Name = Field(description="unique; at most 80 characters")
    latitude_deg: Latitude | None = Field(
        default=None, description="of the centre of a circle, geodetic"
    )
    longitude_deg: Turn | None = Field(
        default=None, description="of the centre of a circle, positive to the east"
    )
    radius_m: AreaRadius | None = Field(default=None, description="of a circle, over the ground")
    vertices_deg: Vertices | None = Field(
        default=None, description="corners of a polygon in turn, [latitude, longitude] each"
    )

    @model_validator(mode="after")
    def _one_form(self) -> "AreaPart":
        given = [key for key in _CIRCLE if getattr(self, key) is not None]
        if self.vertices_deg is not None and given:
            fail((given[0],), getattr(self, given[0]), "no such key beside vertices_deg")
        if self.vertices_deg is None:
            for key in _CIRCLE:
                if key not in given:
                    others = "the centre and radius of a circle, or a list of vertices_deg"
                    fail((key,), None, others if not given else "a number, for a circle")
        return self


class AbortPart(Part):
    """Hold the aims for a target out of reach: a safe orbit, and areas to avoid."""

    safe_perigee_altitude_m: SafeAltitude = Field(
        description="least perigee of an orbit that is safe, above the equatorial radius"
    )
    avoid: Annotated[tuple[AreaPart, ...], Field(max_length=MAX_AREAS)] = Field(
        default=(),
        exclude_if=lambda areas: not areas,
        description="areas that the impact point is kept out of where no orbit is in reach",
    )


def check_bounds(key: str, time_s: object, min_s: float | None, max_s: float | None) -> None:
    """Report bounds of a time that is not free, or an upper bound below the lower."""
    for name, bound in (("min_s", min_s), ("max_s", max_s)):
        if bound is not None and time_s != "free":
            fail((name,), bound, f"no such key without {key}: free")
    if min_s is not None and max_s is not None and min_s > max_s:
        fail(("min_s",), min_s, f"at most max_s, {max_s} s")


#: Keys of a burn that a thrust table excludes.
_NO_TABLE = (
    *("thrust_n", "burn_time_s", "min_s", "max_s", "max_acceleration_m_s2", "min_throttle"),
    *("start", "tail_off", "engine_out"),
)
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

    name: Name | None = Field(default=None, description="shown in events; default: the stage's")
    thrust_n: Thrust | None = Field(default=None, description="full thrust, vacuum")
    isp_s: SpecificImpulse | None = Field(default=None, description="mass flow is T / (g0 Isp)")
    engines: EngineCount = Field(default=1, description="that share the thrust")
    burn_time_s: FreeTime | None = Field(
        default=None, description="from ignition command to cut-off command, or free"
    )
    thrust_table: ThrustTable | None = Field(
        default=None,
        exclude_if=not_there,
        description="of a solid motor, in place of thrust_n and burn_time_s: vacuum thrust after "
        "ignition, knots [seconds, newtons]; the burn ends with it",
    )
    mass_flow_table: FlowTable | None = Field(
        default=None,
        exclude_if=not_there,
        description="beside thrust_table, in place of isp_s: knots [seconds, kilograms per second]",
    )
    min_s: Delay | None = Field(default=None, description="least length, if it is free")
    max_s: Duration | None = Field(default=None, description="greatest length, if it is free")
    min_altitude_m: FloorAltitude | None = Field(
        default=None, exclude_if=not_there, description="least altitude, all along it"
    )
    attitude: Literal["guided", "held"] = Field(
        default="guided", description="held: the direction at ignition is kept; not for a free burn"
    )
    max_acceleration_m_s2: Acceleration | None = Field(
        default=None,
        description="throttled to this thrust acceleration from where full thrust would pass it",
    )
    min_throttle: Fraction | None = Field(
        default=None, description="fraction of full thrust below which it is not throttled"
    )
    start: Curve | None = Field(
        default=None,
        description="thrust fraction after the ignition command, knots [seconds, fraction]",
    )
    tail_off: Curve | None = Field(
        default=None,
        description="thrust fraction after the cut-off command, knots [seconds, fraction]",
    )
    engine_out: EngineOut | None = Field(
        default=None, description="the burn loses engines and goes on with the others"
    )

    @model_validator(mode="after")
    def _whole(self) -> "BurnArc":
        self.check_whole()
        return self

    def check_whole(self, beside: str = "a value") -> None:
        """Report keys that contradict each other.

        Args:
            beside: expected value of a missing key, for the message.
        """
        if self.thrust_table is not None:
            self._check_table(self.thrust_table)
            return
        if self.mass_flow_table is not None:
            flow = list(self.mass_flow_table)
            fail(("mass_flow_table",), flow, "no such key without thrust_table")
        for key in BURN_FORMS[0]:
            if getattr(self, key) is None:
                fail((key,), None, beside)
        check_bounds("burn_time_s", self.burn_time_s, self.min_s, self.max_s)
        self._check_throttle()
        self._check_curves()

    def _check_table(self, thrust: tuple[tuple[float, float], ...]) -> None:
        """Report keys that contradict a thrust table, and errors in the tables."""
        for key in _NO_TABLE:
            if getattr(self, key) is not None:
                fail((key,), getattr(self, key), "no such key beside thrust_table")
        if self.engines != 1:
            fail(
                ("engines",), self.engines, "1, the table being of all motors, beside thrust_table"
            )
        _check_curve("thrust_table", thrust)
        _check_curve("mass_flow_table", self.mass_flow_table)
        if self.mass_flow_table is None:
            if self.isp_s is None:
                fail(("isp_s",), None, "a number in s, or a mass_flow_table in its place")
        else:
            if self.isp_s is not None:
                fail(("isp_s",), self.isp_s, "no such key beside mass_flow_table")
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
                fail(
                    path,
                    list(flow),
                    f"a mass flow where there is thrust, and only there; at {t:g} s",
                )

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
            if self.min_throttle is not None:
                fail(
                    ("min_throttle",),
                    self.min_throttle,
                    "no such key without max_acceleration_m_s2",
                )
            return
        for key in ("start", "tail_off", "engine_out"):
            if getattr(self, key) is not None:
                fail((key,), getattr(self, key), "no such key beside max_acceleration_m_s2")

    def _check_curves(self) -> None:
        _check_curve("start", self.start, 1.0)
        _check_curve("tail_off", self.tail_off, 0.0)
        if self.start and self.duration_s < self.start[-1][0]:
            fail(
                ("burn_time_s",),
                self.duration_s,
                f"at least the {self.start[-1][0]} s that the start takes",
            )
        if self.engine_out:
            self._check_engine_out(self.engine_out)

    def _check_engine_out(self, failure: EngineOut) -> None:
        if self.free:
            fail(
                ("engine_out", "time_after_ignition_s"),
                failure.time_after_ignition_s,
                "no engine_out in a burn with burn_time_s: free",
            )
        earliest = 0.0 if self.start is None else self.start[-1][0]
        if not earliest <= failure.time_after_ignition_s < self.duration_s:
            fail(
                ("engine_out", "time_after_ignition_s"),
                failure.time_after_ignition_s,
                f"a time from {earliest:g} s to the end of the burn at {self.duration_s:g} s",
            )

    @property
    def free(self) -> bool:
        """Return whether guidance decides the cut-off."""
        return self.burn_time_s == "free"

    @property
    def duration_s(self) -> float:
        """Return the time from ignition command to cut-off command; inf if free."""
        if self.thrust_table is not None:
            return self.thrust_table[-1][0]
        if self.burn_time_s is None or self.burn_time_s == "free":
            return math.inf
        return self.burn_time_s

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

    def propellant(self, g0: float, mass_kg: float) -> float:
        """Compute the propellant of a burn with start and tail-off, kg; inf if free.

        Args:
            g0: m/s2.
            mass_kg: at ignition; needed for a throttled burn only.
        """
        if self.thrust_table is not None:
            return self.table(g0).propellant_kg
        flow = self.mass_flow(g0)
        time = self.duration_s - self.start_loss_s + self.tail_gain_s
        limit = self.max_acceleration_m_s2
        if limit is None or math.isinf(time):
            return flow * time
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

    name: Name | None = Field(default=None, description="shown in events; default: the stage's")
    coast_s: FreeTime = Field(description="how long, or free")
    min_s: Delay | None = Field(default=None, description="least length, if it is free")
    max_s: Duration | None = Field(default=None, description="greatest length, if it is free")
    min_altitude_m: FloorAltitude | None = Field(
        default=None,
        exclude_if=not_there,
        description="least altitude, all along it; of a free coast after a burn by default the "
        "edge of the air, 100 km on Earth",
    )
    min_perigee_altitude_m: FloorAltitude | None = Field(
        default=None,
        exclude_if=not_there,
        description="least perigee of the orbit it is flown on, above the equatorial radius",
    )
    perigee_altitude_m: Altitude | None = Field(
        default=None,
        exclude_if=not_there,
        description="perigee of the orbit it is flown on, above the equatorial radius",
    )
    apogee_altitude_m: Altitude | None = Field(
        default=None, exclude_if=not_there, description="its apogee; both are named, or neither"
    )
    inclination_deg: Inclination | None = Field(
        default=None, exclude_if=not_there, description="of that orbit, to the equator"
    )

    @model_validator(mode="after")
    def _bounds(self) -> "CoastArc":
        check_bounds("coast_s", self.coast_s, self.min_s, self.max_s)
        given = [key for key in ORBIT_KEYS if getattr(self, key) is not None]
        for key in ("min_perigee_altitude_m", *given):
            if getattr(self, key) is not None and not self.free:
                fail((key,), getattr(self, key), "no such key where coast_s is not free")
        if not given:
            return self
        perigee, apogee = self.perigee_altitude_m, self.apogee_altitude_m
        if perigee is None or apogee is None:
            missing = "perigee_altitude_m" if perigee is None else "apogee_altitude_m"
            fail((missing,), None, f"a number in m, beside {given[0]}")
        if apogee < perigee:
            fail(("apogee_altitude_m",), apogee, f"at least perigee_altitude_m, {perigee} m")
        if self.min_perigee_altitude_m is not None:
            least = self.min_perigee_altitude_m
            fail(("min_perigee_altitude_m",), least, "no such key beside perigee_altitude_m")
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

_SHORTHAND = tuple(key for key in BurnArc.model_fields if key != "name")


def _of_burn(key: str, default: Any) -> Any:
    """Copy the field of a burn for a stage of one burn."""
    of = BurnArc.model_fields[key]
    return Field(default=default, exclude_if=of.exclude_if, description=of.description)


class Stage(Part):
    """Hold a stage: its mass at its start, and its arcs in order.

    A stage of one burn may have the keys of that burn itself, without ``arcs``.
    """

    model_config = ConfigDict(json_schema_extra=one_of(("arcs",), *BURN_FORMS))

    name: Name = Field(description="unique; at most 80 characters")
    ignition_mass_kg: Mass | None = Field(
        default=None,
        description="this stage and everything above it, at the moment the stage begins",
    )
    dry_mass_kg: Mass | None = Field(
        default=None,
        exclude_if=not_there,
        description="in place of ignition_mass_kg: of the empty stage alone",
    )
    propellant_kg: Mass | None = Field(
        default=None, description="usable by the whole stage, shared by its burns"
    )
    residuals_kg: Load | None = Field(
        default=None,
        exclude_if=not_there,
        description="beside dry_mass_kg: propellant that cannot be used",
    )
    arcs: Annotated[tuple[Arc, ...], Field(min_length=1)] | None = Field(
        default=None,
        description="burns and coasts in order",
        json_schema_extra={"maxItems": MAX_ARCS},
    )
    thrust_n: Thrust | None = _of_burn("thrust_n", None)
    isp_s: SpecificImpulse | None = _of_burn("isp_s", None)
    engines: EngineCount = _of_burn("engines", 1)
    burn_time_s: FreeTime | None = _of_burn("burn_time_s", None)
    thrust_table: ThrustTable | None = _of_burn("thrust_table", None)
    mass_flow_table: FlowTable | None = _of_burn("mass_flow_table", None)
    min_s: Delay | None = _of_burn("min_s", None)
    max_s: Duration | None = _of_burn("max_s", None)
    min_altitude_m: FloorAltitude | None = _of_burn("min_altitude_m", None)
    attitude: Literal["guided", "held"] = _of_burn("attitude", "guided")
    max_acceleration_m_s2: Acceleration | None = _of_burn("max_acceleration_m_s2", None)
    min_throttle: Fraction | None = _of_burn("min_throttle", None)
    start: Curve | None = _of_burn("start", None)
    tail_off: Curve | None = _of_burn("tail_off", None)
    engine_out: EngineOut | None = _of_burn("engine_out", None)

    @model_validator(mode="after")
    def _one_form(self) -> "Stage":
        if self.arcs is None:
            self._single_arc().check_whole("a value, or a list of arcs in its place")
        else:
            for key in _SHORTHAND:
                if key in self.model_fields_set:
                    fail((key,), getattr(self, key), "no such key beside arcs")
        return self

    def _single_arc(self) -> BurnArc:
        # the fields are checked already; validated again, an error would name the wrong path
        return BurnArc.model_construct(**{key: getattr(self, key) for key in _SHORTHAND})

    @property
    def flight_arcs(self) -> tuple[BurnArc | CoastArc, ...]:
        """Return the arcs in flight order, for both forms of a stage."""
        return self.arcs if self.arcs is not None else (self._single_arc(),)

    def arc_path(self, k: int, *keys: str | int) -> tuple[str | int, ...]:
        """Return the key path of arc ``k`` within the stage."""
        return ("arcs", k, *keys) if self.arcs is not None else keys

    @property
    def burns(self) -> tuple[BurnArc, ...]:
        """Return the arcs with thrust."""
        return tuple(arc for arc in self.flight_arcs if isinstance(arc, BurnArc))

    def fixed_propellant(self, g0: float, mass_kg: float) -> float:
        """Compute the propellant of all burns of fixed length, kg.

        Args:
            g0: m/s2.
            mass_kg: of the stage and all above it at its start.
        """
        used = 0.0
        for burn in self.burns:
            if not burn.free:
                used += burn.propellant(g0, mass_kg - used)
        return used


HeatingLimitHolds = Literal["at_jettison", "from_jettison"]


class Jettison(Part):
    """Hold a jettison: its mass and its criterion."""

    model_config = ConfigDict(
        json_schema_extra=one_of(("heating_limit_w_m2",), ("time_s",), ("time_after_ignition_s",))
    )

    name: Name = Field(description="unique; at most 80 characters")
    mass_kg: Mass = Field(description="what is dropped")
    stage: Name = Field(description="name of a stage: not before its first ignition")
    heating_limit_w_m2: HeatingRate | None = Field(
        default=None,
        description="when free molecular heating, 0.5 rho V_rel^3, has fallen below this",
    )
    heating_limit_holds: HeatingLimitHolds = Field(
        default="at_jettison", description="at the jettison, or from then until cut-off"
    )
    time_s: MissionTime | None = Field(default=None, description="at this mission elapsed time")
    time_after_ignition_s: Delay | None = Field(
        default=None, description="so long after the stage's first ignition command"
    )

    @model_validator(mode="after")
    def _one_criterion(self) -> "Jettison":
        keys = ("heating_limit_w_m2", "time_s", "time_after_ignition_s")
        given = [key for key in keys if getattr(self, key) is not None]
        if not given:
            fail((keys[0],), None, "one of heating_limit_w_m2, time_s, time_after_ignition_s")
        if len(given) > 1:
            fail((given[1],), getattr(self, given[1]), f"no such key beside {given[0]}")
        if self.heating_limit_w_m2 is None and "heating_limit_holds" in self.model_fields_set:
            fail(
                ("heating_limit_holds",),
                self.heating_limit_holds,
                "no such key without heating_limit_w_m2",
            )
        return self
