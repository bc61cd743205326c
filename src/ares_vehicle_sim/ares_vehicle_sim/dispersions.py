# SPDX-License-Identifier: Apache-2.0
"""Dispersions file: distributions of the truth about the mission file.

``docs/montecarlo.md`` describes the format key by key; ``draws`` samples it.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from ares_models.input_file import InputError, InputKind, KeyPath, format_number, read_text
from ares_models.input_model import parse_model
from ares_models.mission_keys import (
    Latitude,
    Moment,
    Part,
    Turn,
    WindTable,
    check_rising,
    fail,
    optional,
)
from ares_models.mission_parts import MIN_WIND_STEP_M
from ares_models.ranges import Range

if TYPE_CHECKING:
    from ares_models.mission import Mission

#: Largest mean or bound of a spread, as a multiple of the largest sigma.
MAX_SIGMAS = 5.0

#: Fraction of flights that keep a heating limit without measuring the heating.
KEPT = 0.997


class DispersionsError(InputError):
    """Report a wrong dispersions file, or one that does not fit the mission; one line."""


DISPERSIONS = InputKind(
    "dispersions", DispersionsError, "ares_vehicle_sim", "data", may_be_empty=True
)

#: Default dispersions of a campaign, and what this name means for a start at rest on the pad.
STANDARD = "standard"
STANDARD_PAD = "standard_pad"


@dataclass(frozen=True)
class Spread:
    """Hold the distribution ``centre + size x`` of a number.

    Attributes:
        centre: mean.
        size: one sigma of a normal distribution, or half the width of a uniform one.
        even: the distribution is uniform.
    """

    centre: float = 0.0
    size: float = 0.0
    even: bool = False

    def __str__(self) -> str:
        """Format the distribution as in a file."""
        if self.even:
            return f"{{low: {self.centre - self.size}, high: {self.centre + self.size}}}"
        return f"{{mean: {self.centre}, sigma: {self.size}}}" if self.centre else str(self.size)

    @property
    def active(self) -> bool:
        """Return whether the value can differ from 0."""
        return self.centre != 0.0 or self.size != 0.0

    @property
    def sigma(self) -> float:
        """Return the standard deviation."""
        return self.size / math.sqrt(3.0) if self.even else self.size


#: One spread for all components, or one for each.
Spreads = tuple[Spread, ...]

NOTHING: Spreads = (Spread(),)

_FORMS = ({"mean", "sigma"}, {"sigma"}, {"mean"}, {"low", "high"})
_EXPECTED = "one sigma, or a mapping with mean and sigma or low and high"


def _number(path: KeyPath, value: object, low: float, high: float) -> float:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not low <= value <= high:  # type: ignore[operator]
        fail(path, value, f"a number of {Range(low, high)}")
    return float(value)  # type: ignore[arg-type]


def _spread(path: KeyPath, value: object, limits: "SpreadRange") -> Spread:
    """Parse a spread; raise a validation error if it is wrong."""
    if isinstance(value, Spread):
        return value
    if not isinstance(value, dict):
        if isinstance(value, (str, bool)) or value is None:
            fail(path, value, _EXPECTED)
        return Spread(size=_number(path, value, 0.0, limits.limit))
    if set(value) not in _FORMS:
        fail(path, ", ".join(map(str, value)), "mean and sigma, or low and high")
    bounds = {
        key: _number((*path, key), number, 0.0 if key == "sigma" else limits.low, limits.reach)
        for key, number in value.items()
    }
    if "low" not in bounds:
        return Spread(bounds.get("mean", 0.0), bounds.get("sigma", 0.0))
    low, high = bounds["low"], bounds["high"]
    if high < low:
        fail((*path, "high"), high, f"at least low, {low:g}")
    return Spread(0.5 * (low + high), 0.5 * (high - low), even=True)


@dataclass(frozen=True)
class SpreadRange:
    """Bound a spread in a model: ``Annotated[Spreads, SpreadRange(0.2)]``.

    Attributes:
        limit: largest sigma; a mean, a low and a high may be MAX_SIGMAS times as large.
        least: least mean, low and high.
        components: their number; None: the number of stages or jettisons.
    """

    limit: float
    least: float = -math.inf
    components: int | None = None

    def __str__(self) -> str:
        return f"one sigma, at most {format_number(self.limit)}"

    @property
    def reach(self) -> float:
        """Return the largest mean, high, and sigma beside a mean."""
        return MAX_SIGMAS * self.limit

    @property
    def low(self) -> float:
        """Return the least mean and low."""
        return max(self.least, -self.reach)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Build the schema that parses spreads before pydantic checks the tuple."""
        return core_schema.no_info_before_validator_function(self._parse, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Build the JSON schema of the input of :meth:`_parse`, for editors."""
        sigma = {"type": "number", "minimum": 0.0, "maximum": self.limit}
        bound = {"type": "number", "minimum": self.low, "maximum": self.reach}
        bounds = dict.fromkeys(("mean", "low", "high"), bound)
        bounds["sigma"] = {**bound, "minimum": 0.0}
        forms = [
            {
                "type": "object",
                "properties": {key: bounds[key] for key in sorted(form)},
                "required": sorted(form),
                "additionalProperties": False,
            }
            for form in _FORMS
        ]
        one = {"anyOf": [sigma, *forms]}
        if self.components == 1:
            return one
        some: dict[str, Any] = {"type": "array", "items": one, "minItems": 1}
        if self.components is not None:
            some["maxItems"] = self.components
        return {"anyOf": [one, some]}

    def _parse(self, value: Any) -> Spreads:
        if not isinstance(value, (list, tuple)):
            return (_spread((), value, self),)
        if self.components == 1 or not value:
            fail((), value, _EXPECTED)
        if self.components not in (None, len(value)) and len(value) != 1:
            fail((), value, f"a list of {self.components}, or {_EXPECTED}")
        return tuple(_spread((k,), item, self) for k, item in enumerate(value))


Lengths = Annotated[Spreads, SpreadRange(1e6, components=3)]
Speeds = Annotated[Spreads, SpreadRange(1e4, components=3)]
Fractions = Annotated[Spreads, SpreadRange(0.2)]
Uncertain = Annotated[Spreads, SpreadRange(1.0)]
Fractions3 = Annotated[Spreads, SpreadRange(0.2, components=3)]
Fraction = Annotated[Spreads, SpreadRange(0.2, components=1)]
LogFactor = Annotated[Spreads, SpreadRange(3.0, components=1)]
Times = Annotated[Spreads, SpreadRange(10.0, least=0.0)]
Time = Annotated[Spreads, SpreadRange(10.0, least=0.0, components=1)]
SolarFlux = Annotated[Spreads, SpreadRange(100.0, components=1)]
GeomagneticIndex = Annotated[Spreads, SpreadRange(80.0, components=1)]
Factors2 = Annotated[Spreads, SpreadRange(10.0, components=2)]
GustSpeed = Annotated[Spreads, SpreadRange(50.0, components=1)]
GustAltitude = Annotated[Spreads, SpreadRange(1e4, least=0.0, components=1)]
GustLength = Annotated[Spreads, SpreadRange(1e3, least=0.0, components=1)]
Azimuth = Annotated[Spreads, SpreadRange(72.0, components=1)]
TurbulenceScale = Annotated[float, Range(10.0, 1e4)]
LengthNoise = Annotated[float, Range(0.0, 1e6)]
SpeedNoise = Annotated[float, Range(0.0, 1e4)]
SmallSigma = Annotated[float, Range(0.0, 0.2)]
Oblateness = Annotated[float, Range(0.0, 0.01)]
Number = Annotated[float, Range(-1e12, 1e12)]
Row = tuple[Number, Number, Number, Number, Number, Number]


def spread_key(description: str) -> Any:
    """Describe the key of a spread, which may be left out."""
    return Field(default=NOTHING, description=description)


class NavigationErrors(Part):
    """Hold the errors of the navigation state, per axis for a vector.

    Biases and scales are drawn once per flight; noise is one sigma, drawn at every state.
    """

    position_bias_m: Lengths = spread_key("drawn once a flight")
    position_noise_m: LengthNoise = Field(default=0.0, description="one sigma, new at every state")
    velocity_bias_m_s: Speeds = spread_key("drawn once a flight")
    velocity_noise_m_s: SpeedNoise = Field(default=0.0, description="one sigma, new at every state")
    sensed_delta_v_scale: Fractions3 = spread_key("spread of a fraction")
    mass_scale: Fraction = spread_key("spread of a fraction")
    heating_scale: Fraction = spread_key("spread of a fraction")
    heating_noise: SmallSigma = Field(
        default=0.0, description="one sigma of a fraction, new at every state"
    )


class Nrlmsis(Part):
    """Hold a true atmosphere by NRLMSIS 2.1 over one place, at a drawn date and activity."""

    first_date: Moment = Field(description="the date is even between them")
    last_date: Moment = Field(description="the date is even between them")
    f107a: SolarFlux = Field(description="spread of the 81-day mean of the solar flux")
    f107_deviation: SolarFlux = spread_key("spread of the day's flux from it")
    ap: GeomagneticIndex = Field(description="spread of the geomagnetic index")
    latitude_deg: Latitude = Field(description="of the place")
    longitude_deg: Turn = Field(description="of the place")

    @model_validator(mode="after")
    def _in_order(self) -> "Nrlmsis":
        if self.last_date < self.first_date:
            fail(("last_date",), str(self.last_date), f"not before first_date, {self.first_date}")
        return self


class _WindKnots(Part):
    """Hold a wind by altitude."""

    table: WindTable = Field(
        description="knots [metres of altitude, metres per second to the east, to the north]"
    )

    @model_validator(mode="after")
    def _rising(self) -> "_WindKnots":
        check_rising("table", self.table, MIN_WIND_STEP_M, "an altitude")
        return self


class Winds(_WindKnots):
    """Hold winds that are added to the mission's, normal in each component."""

    factor: Factors2 = Field(
        default=(Spread(size=1.0),), description="by which the east and the north column are taken"
    )


class Gust(Part):
    """Hold one gust a flight, a full wave of 1 - cosine over the altitude."""

    amplitude_m_s: GustSpeed = Field(description="spread of its greatest speed")
    altitude_m: GustAltitude = Field(description="spread of the altitude of its middle")
    length_m: GustLength = Field(description="spread of the climb from its begin to its end")
    azimuth_deg: Azimuth = spread_key("spread of where it blows to, north to east")


class Turbulence(_WindKnots):
    """Hold Dryden turbulence of the horizontal wind, drawn anew for each flight."""

    scale_m: TurbulenceScale = Field(default=533.4, description="scale of length of the turbulence")


class Dispersions(Part):
    """Hold the distributions of the truth about the mission file, and of navigation errors.

    Where a key has a value per stage, jettison or axis, one value may stand for all.
    """

    draws: Literal["random", "sobol"] = Field(
        default="random", description="pseudo-random numbers, or the points of a Sobol sequence"
    )
    initial_frame: Literal["eci", "local"] = Field(
        default="eci", description="x, y, z; or up, downrange, crossrange of the nominal state"
    )
    initial_position_m: Lengths = spread_key("what is added to the initial state")
    initial_velocity_m_s: Speeds = spread_key("what is added to the initial state")
    initial_covariance: tuple[Row, Row, Row, Row, Row, Row] | None = optional(
        "instead of the two: 6 rows of 6 numbers, m and m/s"
    )
    thrust: Fractions = spread_key("fraction; mass flow follows")
    specific_impulse: Fractions = spread_key("fraction; mass flow follows")
    stage_mass: Fractions = spread_key("fraction of a stage's own mass, without what it jettisons")
    propellant: Fractions = spread_key("fraction of the usable propellant; the stack weighs it")
    jettison_mass: Fractions = spread_key("fraction; the stack weighs it")
    jettison_limit: Fractions = spread_key(
        "fraction by which the true heating limit lies above the mission's"
    )
    log_density: LogFactor = spread_key("logarithm of a factor on the density")
    nrlmsis: Nrlmsis | None = optional(
        "the true atmosphere is NRLMSIS 2.1 instead of the mission's"
    )
    wind: Winds | None = optional("winds that are added to the mission's")
    gust: Gust | None = optional("one gust a flight")
    turbulence: Turbulence | None = optional("turbulence of the horizontal wind")
    start_delay_s: Times = spread_key("from ignition command to the first knot of the start")
    start_scale: Fractions = spread_key("fraction by which the start takes longer")
    latency_s: Time = spread_key(
        "from a navigation state until the command that answers it is in force"
    )
    ballistic_coefficient: Uncertain = spread_key("fraction, of what is dropped as it falls")
    j2: Oblateness | None = optional("J2 of the true gravity; guidance keeps the mission's")
    navigation: NavigationErrors = Field(
        default=NavigationErrors(), description="errors of what navigation reports"
    )

    @model_validator(mode="after")
    def _covariance(self) -> "Dispersions":
        if self.initial_covariance is None:
            return self
        for key in ("initial_position_m", "initial_velocity_m_s"):
            if getattr(self, key) != NOTHING:
                fail((key,), "a value", "no such key beside initial_covariance")
        self.initial_root()
        return self

    def heating_margin(self, kept: float = KEPT) -> float:
        """Compute the margin to a heating limit for guidance without measurement, a fraction.

        With it the jettison keeps the limit in the fraction ``kept`` of flights. It covers
        ``log_density`` and ``jettison_limit``, but not the atmosphere of ``nrlmsis``.
        """
        limit = max(self.jettison_limit, key=lambda spread: spread.sigma)
        (density,) = self.log_density
        spread = math.hypot(density.sigma, limit.sigma)
        worst = density.centre - limit.centre + NormalDist().inv_cdf(kept) * spread
        return max(0.0, -math.expm1(-worst))

    def initial_root(self) -> NDArray[np.float64] | None:
        """Factor the covariance as L L^T, L lower triangular, shape (6, 6); None without one."""
        if self.initial_covariance is None:
            return None
        covariance = np.array(self.initial_covariance)
        path = ("initial_covariance",)
        if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0):
            fail(path, "not symmetric", "a symmetric matrix")
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        used = np.flatnonzero(sigma > 0.0)
        rest = np.setdiff1d(np.arange(6), used)
        root = np.zeros((6, 6))
        correlation = covariance[np.ix_(used, used)] / np.outer(sigma[used], sigma[used])
        try:
            root[np.ix_(used, used)] = np.linalg.cholesky(correlation) * sigma[used, None]
        except np.linalg.LinAlgError:
            fail(path, "not positive definite", "variances and correlations that can be")
        if np.any(covariance[rest] != 0.0):
            fail(path, "not positive definite", "no covariance where the variance is 0")
        return root


def load_dispersions(name_or_path: str | Path, mission: "Mission | None" = None) -> Dispersions:
    """Read a dispersions file.

    Args:
        name_or_path: name of shipped dispersions, or path of a file.
        mission: to disperse; STANDARD means STANDARD_PAD if it starts at rest on the pad.

    Raises:
        DispersionsError: one line with the file, the key, its value and the expected one.
    """
    return read_dispersions(name_or_path, mission)[0]


def read_dispersions(
    name_or_path: str | Path, mission: "Mission | None" = None
) -> tuple[Dispersions, str]:
    """Read a dispersions file; return its content and its text.

    Args: as in `load_dispersions`.

    Raises:
        DispersionsError: as in `load_dispersions`.
    """
    if name_or_path == STANDARD and mission is not None and mission.initial_state.is_launch:
        name_or_path = STANDARD_PAD
    path = DISPERSIONS.find(name_or_path)
    text = read_text(path, DISPERSIONS)
    return parse_model(text, str(path), DISPERSIONS, Dispersions), text
