# SPDX-License-Identifier: Apache-2.0
"""Define the keys of a mission: ranges of numbers, texts and times, and the base of all parts."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, NoReturn

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from ares_models import arrays as layout
from ares_models.input_file import KeyPath
from ares_models.ranges import Range


def fail(path: KeyPath, value: object, expected: str) -> NoReturn:
    """Raise a validation error that concerns more than a single field.

    Args:
        path: key path from the model under validation.
        value: found value.
        expected: expected value.
    """
    if isinstance(value, BaseModel):
        value = value.model_dump()
    raise PydanticCustomError(
        "expected", "{expected}", {"path": path, "value": value, "expected": expected}
    )


def check_rising(key: str, knots: Sequence[Sequence[float]], step: float, what: str) -> None:
    """Check that the first numbers of a table's knots rise by a step at least.

    Args:
        key: of the table.
        knots: of the table.
        step: least difference.
        what: the first number is.

    Raises:
        PydanticCustomError: they do not.
    """
    for k in range(1, len(knots)):
        least = knots[k - 1][0] + step
        if not knots[k][0] >= least:
            fail((key, k, 0), knots[k][0], f"{what} of at least {least:g}")


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
#: Greatest altitude of a knot of a wind table, m.
MAX_WIND_ALTITUDE_M = 6e4
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
HEAVIEST_KG = 1e9
Mass = Annotated[float, Range(1e-3, HEAVIEST_KG)]
Load = Annotated[float, Range(0.0, HEAVIEST_KG)]
Thrust = Annotated[float, Range(1e-3, 1e10)]
SpecificImpulse = Annotated[float, Range(1.0, 1e6)]
Duration = Annotated[float, Range(MIN_TIME_S, MAX_FLIGHT_S)]
Delay = Annotated[float, Range(0.0, MAX_FLIGHT_S)]
KnotTime = Annotated[float, Range(0.0, 3600.0)]
Acceleration = Annotated[float, Range(1e-3, 1e4)]
Fraction = Annotated[float, Range(0.0, 1.0)]
BucketThrottle = Annotated[float, Range(0.05, 0.99)]
Kick = Annotated[float, Range(0.0, 45.0)]
FloorAltitude = Annotated[float, Range(-1e6, 1e9)]
Altitude = Annotated[float, Range(0.0, 1e9)]
SafeAltitude = Annotated[float, Range(0.0, 1e8)]
AreaRadius = Annotated[float, Range(1e3, 1e7)]
EngineCount = Annotated[int, Range(1, 100)]
HeatingRate = Annotated[float, Range(1e-6, 1e12)]
Area = Annotated[float, Range(1e-6, 1e6)]
BallisticCoefficient = Annotated[float, Range(1.0, 1e6)]
Pressure = Annotated[float, Range(1.0, 1e9)]
SurfaceDensity = Annotated[float, Range(1e-12, 1e3)]
ScaleHeight = Annotated[float, Range(100.0, 1e6)]

Name = Annotated[str, Field(strict=True, min_length=1, max_length=80), AfterValidator(_printable)]
Text = Annotated[str, Field(strict=True, min_length=1)]
Knot = tuple[KnotTime, Fraction]
ThrustKnot = tuple[KnotTime, Annotated[float, Range(0.0, 1e10)]]
FlowKnot = tuple[KnotTime, Annotated[float, Range(0.0, 1e9)]]
CoefficientKnot = tuple[Annotated[float, Range(0.0, 1e3)], Annotated[float, Range(0.0, 100.0)]]
AttitudeKnot = tuple[Annotated[float, Range(-1e6, 1e9)], FlightPathAngle, Turn]
Vertex = tuple[Latitude, Turn]
Vertices = Annotated[tuple[Vertex, ...], Field(min_length=3, max_length=layout.MAX_VERTICES)]
Curve = Annotated[tuple[Knot, ...], Field(min_length=2, max_length=layout.MAX_KNOTS)]
ThrustTable = Annotated[tuple[ThrustKnot, ...], Field(min_length=2, max_length=layout.MAX_KNOTS)]
#: Altitude, and components of the wind to the east and to the north.
WindAltitude = Annotated[float, Range(-1e3, MAX_WIND_ALTITUDE_M)]
WindSpeed = Annotated[float, Range(-200.0, 200.0)]
WindTable = Annotated[
    tuple[tuple[WindAltitude, WindSpeed, WindSpeed], ...],
    Field(min_length=1, max_length=layout.MAX_WIND_KNOTS),
]
CoefficientTable = Annotated[
    tuple[CoefficientKnot, ...], Field(min_length=1, max_length=layout.MAX_DRAG_KNOTS)
]
AttitudeTable = Annotated[
    tuple[AttitudeKnot, ...], Field(min_length=1, max_length=layout.MAX_PROGRAMME)
]
FlowTable = Annotated[tuple[FlowKnot, ...], Field(min_length=2, max_length=layout.MAX_KNOTS)]


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


def _is_word(value: object) -> str:
    return "<word>" if isinstance(value, str) else "<time>"


def _one_of_words(*words: str) -> BeforeValidator:
    def check(value: object) -> object:
        if value not in words:
            fail((), value, f"a time in s, or the word {' or '.join(words)}")
        return value

    return BeforeValidator(check)


FreeTime = Annotated[
    Annotated[Duration, Tag("<time>")]
    | Annotated[Literal["free"], _one_of_words("free"), Tag("<word>")],
    Discriminator(_is_word),
]
#: Length of a burn that takes what propellant is left in its stage.
DEPLETION = "depletion"
#: Length of a burn. Before a mission is checked a number takes the place of `depletion`.
BurnTime = Annotated[
    Annotated[Duration, Tag("<time>")]
    | Annotated[Literal["free", "depletion"], _one_of_words("free", DEPLETION), Tag("<word>")],
    Discriminator(_is_word),
]
#: Inclination at which J2 turns the node as fast as the sun moves.
SUN_SYNCHRONOUS = "sun_synchronous"


def _degrees(value: object) -> object:
    if isinstance(value, str):
        fail((), value, f"a number from 0 to 180 in deg, or the word {SUN_SYNCHRONOUS}")
    return value


#: Inclination of a target orbit. Before a mission is checked a number takes the place of the word.
OrbitInclination = Annotated[
    Inclination,
    BeforeValidator(_degrees),
    WithJsonSchema(
        {"anyOf": [{"type": "number", "minimum": 0, "maximum": 180}, {"const": SUN_SYNCHRONOUS}]}
    ),
]
Moment = Annotated[
    datetime,
    BeforeValidator(_moment),
    WithJsonSchema({"type": "string", "examples": ["2010-06-21T12:00:00Z"]}),
]


class Part(BaseModel):
    """Refuse unknown keys, nan and infinity; base of all parts."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def given(self, keys: Iterable[str]) -> list[str]:
        """Return those of some keys that have a value."""
        return [key for key in keys if getattr(self, key) is not None]

    def refuse(self, keys: Iterable[str], expected: str, path: KeyPath = ()) -> None:
        """Report the first of some keys that has a value, though none may have one.

        Args:
            keys: that must be absent.
            expected: in their place.
            path: key path from the model under validation to this part.
        """
        for key in self.given(keys):
            fail((*path, key), getattr(self, key), expected)

    def take_one(self, keys: Iterable[str]) -> list[str]:
        """Return those of some keys that have a value; report a second one beside the first."""
        given = self.given(keys)
        if len(given) > 1:
            self.refuse(given[1:], f"no such key beside {given[0]}")
        return given


def optional(description: str) -> Any:
    """Describe a key that may be left out."""
    return Field(default=None, description=description)


def added_later(description: str) -> Any:
    """Describe a key that may be left out, and that the digest of a file without it ignores."""
    return Field(default=None, exclude_if=lambda value: value is None, description=description)


def one_of(*forms: tuple[str, ...]) -> dict[str, Any]:
    """Build the JSON schema of a mapping with the keys of exactly one form."""
    return {"oneOf": [{"required": list(form)} for form in forms]}


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
