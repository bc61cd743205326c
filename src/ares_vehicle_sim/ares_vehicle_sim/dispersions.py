"""What a dispersions file says: how the truth of a flight may differ from the mission file.

The format is described key by key in ``docs/montecarlo.md``; ``draws`` draws from it.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import GetCoreSchemaHandler, ValidationError, model_validator
from pydantic_core import CoreSchema, core_schema

from ares_models.input_file import InputError, InputKind, KeyPath, explain, read_input
from ares_models.mission_parts import Latitude, Moment, Part, Turn, fail
from ares_models.ranges import Range

#: How far beyond the largest sigma a mean or a bound may be.
MAX_SIGMAS = 5.0

#: Share of flights in which a heating limit is to be kept without measuring it.
KEPT = 0.997


class DispersionsError(InputError):
    """A dispersions file is wrong, or does not fit the mission; the text is one line."""


DISPERSIONS = InputKind(
    "dispersions", DispersionsError, "ares_vehicle_sim", "data", may_be_empty=True
)

#: What a campaign flies when it is given no file.
STANDARD = "standard"


@dataclass(frozen=True)
class Spread:
    """How one number is distributed: ``centre + size x``.

    Attributes:
        centre: mean.
        size: x is standard normal and this is one sigma; or x is even within +-1.
        even: which of the two.
    """

    centre: float = 0.0
    size: float = 0.0
    even: bool = False

    @property
    def active(self) -> bool:
        """Anything but zero for certain."""
        return self.centre != 0.0 or self.size != 0.0

    @property
    def sigma(self) -> float:
        """Standard deviation."""
        return self.size / math.sqrt(3.0) if self.even else self.size


#: One for all components, or one for each.
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
    """One distribution, or a complaint."""
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
    """Bounds of a spread in a model: ``Annotated[Spreads, SpreadRange(0.2)]``.

    Attributes:
        limit: of one sigma; a mean, a low and a high reach MAX_SIGMAS times as far.
        least: of a mean, a low and a high.
        components: how many there are; None: as many as stages or jettisons.
    """

    limit: float
    least: float = -math.inf
    components: int | None = None

    @property
    def reach(self) -> float:
        """Greatest mean, sigma beside a mean, and high."""
        return MAX_SIGMAS * self.limit

    @property
    def low(self) -> float:
        """Least mean and low."""
        return max(self.least, -self.reach)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Parses before the tuple of spreads is looked at."""
        return core_schema.no_info_before_validator_function(self._parse, handler(source))

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
Fractions3 = Annotated[Spreads, SpreadRange(0.2, components=3)]
Fraction = Annotated[Spreads, SpreadRange(0.2, components=1)]
LogFactor = Annotated[Spreads, SpreadRange(3.0, components=1)]
Times = Annotated[Spreads, SpreadRange(10.0, least=0.0)]
Time = Annotated[Spreads, SpreadRange(10.0, least=0.0, components=1)]
SolarFlux = Annotated[Spreads, SpreadRange(100.0, components=1)]
GeomagneticIndex = Annotated[Spreads, SpreadRange(80.0, components=1)]
LengthNoise = Annotated[float, Range(0.0, 1e6)]
SpeedNoise = Annotated[float, Range(0.0, 1e4)]
SmallSigma = Annotated[float, Range(0.0, 0.2)]
Oblateness = Annotated[float, Range(0.0, 0.01)]
Number = Annotated[float, Range(-1e12, 1e12)]
Row = tuple[Number, Number, Number, Number, Number, Number]


class NavigationErrors(Part):
    """Errors of the navigation state, per axis where it is a vector.

    Biases and scales are drawn once a flight; noise is one sigma, new at every state.
    """

    position_bias_m: Lengths = NOTHING
    position_noise_m: LengthNoise = 0.0
    velocity_bias_m_s: Speeds = NOTHING
    velocity_noise_m_s: SpeedNoise = 0.0
    sensed_delta_v_scale: Fractions3 = NOTHING
    mass_scale: Fraction = NOTHING
    heating_scale: Fraction = NOTHING
    heating_noise: SmallSigma = 0.0


class Nrlmsis(Part):
    """The true atmosphere is NRLMSIS 2.1 over one place, at a date and an activity drawn."""

    first_date: Moment
    last_date: Moment
    f107a: SolarFlux
    f107_deviation: SolarFlux = NOTHING
    ap: GeomagneticIndex
    latitude_deg: Latitude
    longitude_deg: Turn

    @model_validator(mode="after")
    def _in_order(self) -> "Nrlmsis":
        if self.last_date < self.first_date:
            fail(("last_date",), str(self.last_date), f"not before first_date, {self.first_date}")
        return self


class Dispersions(Part):
    """How the truth differs from the mission file, and navigation from the truth.

    Attributes:
        draws: pseudo-random numbers, or the points of a Sobol sequence.
        initial_frame: axes of the initial state: ECI x, y, z; or local up, downrange and
            crossrange (along the angular momentum) of the nominal state.
        initial_position_m: per axis.
        initial_velocity_m_s: per axis.
        initial_covariance: of position and velocity, 6 by 6, in m and m/s; instead of the two.
        thrust: fraction, per stage.
        specific_impulse: fraction, per stage.
        stage_mass: fraction of a stage's own mass without what it jettisons, per stage.
        propellant: fraction of what is loaded, per stage.
        jettison_mass: fraction, per jettison.
        jettison_limit: fraction by which the true heating limit is above the mission's,
            which guidance holds; per jettison.
        log_density: of the natural logarithm of a factor on the density.
        nrlmsis: the true atmosphere instead of the mission's.
        start_delay_s: from ignition command to the begin of the thrust's rise, per stage.
        start_scale: fraction by which the start takes longer, per stage.
        latency_s: from a navigation state until the command that answers it is in force.
        j2: J2 of the true gravity field; no draw.
        navigation: errors of what navigation reports.
    """

    draws: Literal["random", "sobol"] = "random"
    initial_frame: Literal["eci", "local"] = "eci"
    initial_position_m: Lengths = NOTHING
    initial_velocity_m_s: Speeds = NOTHING
    initial_covariance: tuple[Row, Row, Row, Row, Row, Row] | None = None
    thrust: Fractions = NOTHING
    specific_impulse: Fractions = NOTHING
    stage_mass: Fractions = NOTHING
    propellant: Fractions = NOTHING
    jettison_mass: Fractions = NOTHING
    jettison_limit: Fractions = NOTHING
    log_density: LogFactor = NOTHING
    nrlmsis: Nrlmsis | None = None
    start_delay_s: Times = NOTHING
    start_scale: Fractions = NOTHING
    latency_s: Time = NOTHING
    j2: Oblateness | None = None
    navigation: NavigationErrors = NavigationErrors()

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
        """What guidance must stay below a heating limit when it measures nothing, a fraction.

        The jettison keeps the limit in this share of flights, if the density is right on board
        but for ``log_density`` and the limit but for ``jettison_limit``; an atmosphere of
        ``nrlmsis`` is not counted.
        """
        limit = max(self.jettison_limit, key=lambda spread: spread.sigma)
        (density,) = self.log_density
        spread = math.hypot(density.sigma, limit.sigma)
        worst = density.centre - limit.centre + NormalDist().inv_cdf(kept) * spread
        return max(0.0, -math.expm1(-worst))

    def initial_root(self) -> NDArray[np.float64] | None:
        """Lower triangle L with L L^T the covariance, shape (6, 6); None if none is given."""
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


def _siblings(location: KeyPath) -> list[str]:
    parts: dict[Any, type[Part]] = {"navigation": NavigationErrors, "nrlmsis": Nrlmsis}
    return list(parts.get(location[0] if len(location) > 1 else "", Dispersions).model_fields)


def load_dispersions(name_or_path: str | Path) -> Dispersions:
    """Read a dispersions file.

    Args:
        name_or_path: name of a shipped one, or path of a file.

    Raises:
        DispersionsError: one line with the file, the key, its value and what was expected.
    """
    path = DISPERSIONS.find(name_or_path)
    data, lines = read_input(path, DISPERSIONS)
    try:
        return Dispersions.model_validate(data)
    except ValidationError as error:
        problems = [explain(dict(item), lines, _siblings) for item in error.errors()]
        raise DispersionsError(str(path), problems) from None
