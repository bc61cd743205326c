# SPDX-License-Identifier: Apache-2.0
"""Draws of a flight's dispersions, from the seed and the flight's number alone.

Every quantity has its own stream, keyed by seed and name, and a flight has a fixed place in it: a
new quantity in the file does not change the draws of the others, and flight k is drawn equally
alone or among a million. A uniform number becomes a value through the inverse of its distribution,
both for pseudo-random numbers (Philox) and for a Sobol sequence, which the same streams shift at
random.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MAX_KNOTS, MAX_STIRRED_LAYERS
from ares_models.atmosphere import nrlmsis_tables
from ares_models.mission import Mission
from ares_models.mission_keys import GEOMAGNETIC_INDEX, SOLAR_FLUX
from ares_models.splines import hermite_table, monotone_slopes
from ares_models.wind import WindProfile, together, wind_profile
from ares_vehicle_sim.arrays import VARIATION
from ares_vehicle_sim.dispersions import (
    Dispersions,
    DispersionsError,
    NavigationErrors,
    Spread,
    Spreads,
)
from ares_vehicle_sim.kernels.navigation import SPARE_BITS, STEP, stream_number

Array = NDArray[np.float64]
Words = NDArray[np.uint64]

POSITION = "initial_position_m"
VELOCITY = "initial_velocity_m_s"

#: Field of VARIATION by quantity. The order fixes the dimension of the Sobol sequence: append new
#: quantities at the end.
FIELDS = {
    POSITION: "position",
    VELOCITY: "velocity",
    "log_density": "log_density",
    "thrust": "thrust",
    "specific_impulse": "specific_impulse",
    "jettison_limit": "jettison_limit",
    "stage_mass": "stage_mass",
    "propellant": "propellant",
    "jettison_mass": "jettison_mass",
    "latency_s": "latency",
    "start_delay_s": "start_delay",
    "start_scale": "start_scale",
    "nrlmsis.date_days": "",
    "nrlmsis.f107a": "",
    "nrlmsis.f107_deviation": "",
    "nrlmsis.ap": "",
    "navigation.position_bias_m": "errors.position_bias",
    "navigation.velocity_bias_m_s": "errors.velocity_bias",
    "navigation.sensed_delta_v_scale": "errors.sensed_delta_v_scale",
    "navigation.mass_scale": "errors.mass_scale",
    "navigation.heating_scale": "errors.heating_scale",
    "wind.factor": "",
    "gust.amplitude_m_s": "",
    "gust.altitude_m": "",
    "gust.length_m": "",
    "gust.azimuth_deg": "",
    "ballistic_coefficient": "ballistic_coefficient",
}
PER_STAGE = (
    "thrust",
    "specific_impulse",
    "stage_mass",
    "propellant",
    "start_delay_s",
    "start_scale",
)
PER_JETTISON = ("jettison_mass", "jettison_limit")

#: Largest number of quantities in the Sobol sequence: dimension = component x this + place.
RESERVED = 32
SOBOL_BITS = 32
#: Words per block of Philox; a flight uses whole blocks.
BLOCK = 4

#: Altitudes of a drawn atmosphere, km: within 0.12 % of the fine table from 70 to 200 km.
ALTITUDE_KM = np.concatenate(
    (
        np.arange(0.0, 60.0, 20.0),
        np.arange(60.0, 130.0, 2.0),
        np.arange(130.0, 200.0, 5.0),
        np.arange(200.0, 400.0, 20.0),
        np.arange(400.0, 1001.0, 200.0),
    )
)
LEAST_F107 = 50.0
#: Least length of a gust, m.
LEAST_GUST_M = 10.0
#: Least altitude up to which turbulence has layers, m.
LEAST_STIRRED_M = 1000.0
#: What is added to the correlation of knots with themselves, for knots close together.
ROOT_SHIFT = 1e-9
DAY_S = 86_400.0

AXES = {"eci": ("x", "y", "z"), "local": ("up", "downrange", "crossrange")}


@dataclass(frozen=True)
class Draws:
    """Hold the draws of consecutive flights.

    Attributes:
        inputs: shape (n, columns), values of the quantities of the dispersions file.
        variations: shape (n,), dtype VARIATION.
        atmospheres: shape (n, m, 9), tables as in MissionArrays; shape (1, m, 9) if all flights
            share one.
    """

    inputs: Array
    variations: NDArray[np.void]
    atmospheres: Array


@dataclass(frozen=True)
class _Quantity:
    """Describe a drawn quantity with one number per component."""

    name: str
    spreads: Spreads
    components: Sequence[str] = ("",)

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(
            f"{self.name}.{component}" if component else self.name for component in self.components
        )

    @property
    def size(self) -> int:
        return len(self.components)

    def values(self, words: Words) -> Array:
        """Convert random words to values, both of shape (n, components)."""
        spreads = self.spreads * (self.size if len(self.spreads) == 1 else 1)
        values = np.empty(words.shape)
        for k, spread in enumerate(spreads):
            x = 2.0 * _uniform(words[:, k]) - 1.0 if spread.even else _normal(words[:, k])
            values[:, k] = spread.centre + spread.size * x
        return values


class Sampler:
    """Draw the flights of one seed.

    Attributes:
        columns: names of the columns of `Draws.inputs`.
    """

    def __init__(self, mission: Mission, dispersions: Dispersions, seed: int) -> None:
        """Prepare.

        Args:
            mission: the mission.
            dispersions: of the truth.
            seed: master seed, not negative.

        Raises:
            DispersionsError: the dispersions do not fit the mission, or SciPy is not installed;
                one line.
            AtmosphereError: NRLMSIS is needed and not installed.
        """
        self._dispersions = dispersions
        self._seed = seed
        self._atmosphere = mission.atmosphere().table[None]
        self._axes = _axes(mission, dispersions.initial_frame)
        self._root = dispersions.initial_root()
        self._winds = _Winds.of(mission, dispersions)
        self._quantities = _quantities(mission, dispersions)
        if self._quantities and find_spec("scipy") is None:
            problem = "they need the Python package scipy, which is not installed"
            raise DispersionsError("dispersions", [problem])
        _check_starts(mission, dispersions)
        _check_pad(mission, dispersions)
        self._sobol = _Sobol(self._quantities, seed) if dispersions.draws == "sobol" else None
        self.columns = tuple(column for q in self._quantities for column in q.columns)
        # a trial draw reports a missing NRLMSIS now instead of in a flight
        self.draw(0, 1)

    def draw(self, first: int, count: int) -> Draws:
        """Draw the flights numbered ``first`` to ``first + count - 1``."""
        source = self._sobol or self
        drawn = {q.name: q.values(source.words(q, first, count)) for q in self._quantities}
        if self._root is not None:
            self._correlate(drawn, self._root)
        return Draws(
            np.concatenate([np.empty((count, 0)), *drawn.values()], axis=1),
            self._variations(drawn, first, count),
            self._atmospheres(drawn),
        )

    def words(self, quantity: _Quantity, first: int, count: int) -> Words:
        """Generate the random words of a quantity, shape (count, components)."""
        return _philox_words(self._seed, quantity.name, quantity.size, first, count)

    def _correlate(self, drawn: dict[str, Array], root: Array) -> None:
        """Transform the standard normal draws of the initial state to its covariance."""
        independent = np.concatenate([drawn[POSITION], drawn[VELOCITY]], axis=1)
        state = np.zeros_like(independent)
        # term by term: a matrix product may round a single flight differently from a thousand
        for k in range(6):
            state += independent[:, k : k + 1] * root[:, k]
        drawn[POSITION], drawn[VELOCITY] = state[:, :3], state[:, 3:]

    def _variations(self, drawn: dict[str, Array], first: int, count: int) -> NDArray[np.void]:
        variations = np.zeros(count, VARIATION)
        for name, values in drawn.items():
            if not FIELDS[name]:
                continue
            field: Any = variations
            for key in FIELDS[name].split("."):
                field = field[key]
            if name in (POSITION, VELOCITY):
                for k in range(3):
                    field += values[:, k : k + 1] * self._axes[k]
            elif field.ndim == 1:
                field[:] = values[:, 0]
            else:
                field[:, : values.shape[1]] = values
        if self._winds is not None:
            self._winds.write(drawn, variations, self._seed, first)
        navigation = self._dispersions.navigation
        errors = variations["errors"]
        errors["active"] = navigation != NavigationErrors()
        errors["position_noise"] = navigation.position_noise_m
        errors["velocity_noise"] = navigation.velocity_noise_m_s
        errors["heating_noise"] = navigation.heating_noise
        errors["seed"] = self._seed
        errors["flight"] = np.arange(first, first + count)
        return variations

    def _atmospheres(self, drawn: dict[str, Array]) -> Array:
        part = self._dispersions.nrlmsis
        if part is None:
            return self._atmosphere
        days, f107a, deviation, ap = (drawn[name][:, 0] for name in drawn if name[:8] == "nrlmsis.")
        f107a = np.clip(f107a, LEAST_F107, SOLAR_FLUX.high)
        begin = np.datetime64(part.first_date.replace(tzinfo=None), "s")
        return nrlmsis_tables(
            begin + (days * DAY_S).astype("timedelta64[s]"),
            part.latitude_deg,
            part.longitude_deg,
            np.clip(f107a + deviation, LEAST_F107, SOLAR_FLUX.high),
            f107a,
            np.clip(ap, GEOMAGNETIC_INDEX.low, GEOMAGNETIC_INDEX.high),
            ALTITUDE_KM,
        )


def _philox_words(seed: int, name: str, size: int, first: int, count: int) -> Words:
    """Generate the words of a stream for ``count`` flights from ``first`` on, (count, size)."""
    blocks = -(-size // BLOCK)
    key = np.array([seed, stream_number(name)], dtype=np.uint64)
    generator = np.random.Philox(key=key, counter=first * blocks)
    words = generator.random_raw(count * blocks * BLOCK).reshape(count, blocks * BLOCK)
    return np.asarray(words[:, :size])


class _Sobol:
    """Generate the words of a randomly shifted Sobol sequence.

    The shift is digital (exclusive or), which preserves the net property.
    """

    def __init__(self, quantities: Sequence[_Quantity], seed: int) -> None:
        places = list(FIELDS)
        self._dimensions = {
            q.name: places.index(q.name) + RESERVED * np.arange(q.size) for q in quantities
        }
        self._shifts = {
            q.name: _philox_words(seed, f"{q.name}/shift", q.size, 0, 1) for q in quantities
        }
        self._total = 1 + max((int(d[-1]) for d in self._dimensions.values()), default=0)
        self._next = 0
        self._engine: Any = None
        self._chunk: tuple[int, int] | None = None

    def words(self, quantity: _Quantity, first: int, count: int) -> Words:
        """Generate the words of a quantity, shape (count, components)."""
        points = self._points(first, count)[:, self._dimensions[quantity.name]]
        shift = self._shifts[quantity.name]
        return (points << np.uint64(64 - SOBOL_BITS)) ^ shift

    def _points(self, first: int, count: int) -> Words:
        """Generate consecutive points in all dimensions, as integers of SOBOL_BITS bits."""
        if self._chunk != (first, count):
            # slow to import, and rarely needed
            from scipy.stats.qmc import Sobol

            if self._engine is None or self._next > first:
                self._engine = Sobol(self._total, scramble=False, bits=SOBOL_BITS)
                self._next = 0
            if first > self._next:
                self._engine.fast_forward(first - self._next)
            # one point first: SciPy warns if the first number is not a power of two
            points = [self._engine.random(1), self._engine.random(count - 1)]
            self._latest = np.ldexp(np.concatenate(points), SOBOL_BITS).astype(np.uint64)
            self._next = first + count
            self._chunk = (first, count)
        return self._latest


def _axes(mission: Mission, frame: str) -> Array:
    """Return the unit vectors of the initial state's axes in ares_eci, in rows, shape (3, 3)."""
    if frame == "eci":
        return np.eye(3)
    start = mission.start()
    up = start.position / np.linalg.norm(start.position)
    momentum = np.cross(start.position, start.velocity)
    crossrange = momentum / np.linalg.norm(momentum)
    return np.array([up, np.cross(crossrange, up), crossrange])


@dataclass(frozen=True)
class _Winds:
    """Hold what blows, by the same knots.

    Attributes:
        mean: wind of the mission.
        added: what is added to it, times drawn factors.
        sigma: one sigma of the turbulence, m/s.
        root: shape (n, n), lower triangular: its square is the correlation of the turbulence at
            the knots; None: there is none.
        layers: altitudes of the layers of the turbulence, m.
    """

    mean: WindProfile
    added: WindProfile
    sigma: WindProfile
    root: Array | None = None
    layers: Array | None = None

    @classmethod
    def of(cls, mission: Mission, dispersions: Dispersions) -> "_Winds | None":
        """Put together the wind of a mission and the dispersed one; None: nothing is dispersed."""
        wind, turbulence = dispersions.wind, dispersions.turbulence
        if wind is None and turbulence is None and dispersions.gust is None:
            return None
        calm = ((0.0, 0.0, 0.0),)
        parts = [
            wind_profile(mission.environment.atmosphere.wind_table or calm),
            wind_profile(calm if wind is None else wind.table),
            wind_profile(calm if turbulence is None else turbulence.table),
        ]
        if turbulence is None:
            mean, added, sigma = together(parts)
            return cls(mean, added, sigma)
        ends = turbulence.table[0][0], turbulence.table[-1][0]
        layers = np.linspace(min(0.0, ends[0]), max(ends[1], LEAST_STIRRED_M), MAX_STIRRED_LAYERS)
        mean, added, sigma = together(parts, layers)
        apart = np.abs(np.subtract.outer(sigma.altitude, sigma.altitude)) / turbulence.scale_m
        correlation = np.exp(-apart) * (1.0 - 0.5 * apart)
        root = np.linalg.cholesky(correlation + ROOT_SHIFT * np.eye(len(correlation)))
        return cls(mean, added, sigma, np.asarray(root, dtype=np.float64), layers)

    def write(
        self, drawn: dict[str, Array], variations: NDArray[np.void], seed: int, first: int
    ) -> None:
        """Write the winds of flights from ``first`` on, with gust and turbulence."""
        variations["windy"] = 1
        wind = variations["wind"]
        knots = len(self.mean.altitude)
        wind["knots"] = knots
        wind["altitude"][:, :knots] = self.mean.altitude
        cubic = wind["cubic"][:, :, :knots]
        cubic[:] = self.mean.cubic
        if "wind.factor" in drawn:
            cubic += drawn["wind.factor"][:, :, None, None] * self.added.cubic
        if self.root is not None and self.layers is not None:
            cubic += self._stirred(self.root, seed, first, len(variations))
            wind["stirred_below"] = self.layers[-1]
            wind["stirred_step"] = 0.5 * (self.layers[1] - self.layers[0])
        if "gust.amplitude_m_s" not in drawn:
            return
        nothing = np.zeros((len(variations), 1))
        amplitude, altitude, length, azimuth = (
            drawn.get(f"gust.{key}", nothing)[:, 0]
            for key in ("amplitude_m_s", "altitude_m", "length_m", "azimuth_deg")
        )
        towards = np.radians(azimuth)
        wind["gust"] = amplitude[:, None] * np.stack((np.sin(towards), np.cos(towards)), axis=1)
        wind["gust_altitude"] = altitude
        wind["gust_length"] = np.maximum(length, LEAST_GUST_M)

    def _stirred(self, root: Array, seed: int, first: int, count: int) -> Array:
        """Draw the cubics of the turbulence, shape (count, 2, n, 4)."""
        altitude = self.sigma.altitude
        words = _philox_words(seed, "turbulence", 2 * len(altitude), first, count)
        normal = _normal(words).reshape(count, 2, -1)
        value = np.zeros_like(normal)
        # term by term, as in `Sampler._correlate`
        for k in range(len(altitude)):
            value += normal[:, :, k : k + 1] * root[:, k]
        value *= self.sigma.value
        slope = monotone_slopes(altitude, value)
        slope[..., [0, -1]] = 0.0
        return hermite_table(altitude, value, slope)[..., 1:]


def _uniform(words: Words) -> Array:
    """Convert random words to numbers between 0 and 1."""
    return ((words >> SPARE_BITS).astype(np.float64) + 0.5) * STEP


def _normal(words: Words) -> Array:
    """Convert random words to standard normal numbers."""
    from scipy.special import ndtri  # slow to import

    return np.asarray(ndtri(_uniform(words)))


def _slugs(names: Sequence[str]) -> tuple[str, ...]:
    """Convert names to parts of a column's name."""
    return tuple(re.sub(r"\W+", "_", name) for name in names)


def piece_slugs(mission: Mission) -> tuple[str, ...]:
    """Return the parts of columns' names for what a mission drops, each once."""
    slugs = _slugs([piece.name for piece in mission.pieces])
    return tuple(
        slug if slug not in slugs[:k] else f"{slug}_{k + 1}" for k, slug in enumerate(slugs)
    )


def _quantities(mission: Mission, dispersions: Dispersions) -> list[_Quantity]:
    """List the dispersed quantities in the order of FIELDS.

    Raises:
        DispersionsError: the length of a list is not the number of stages, jettisons or pieces.
    """
    axes = AXES[dispersions.initial_frame]
    components: dict[str, Sequence[str]] = {POSITION: axes, VELOCITY: axes}
    components |= dict.fromkeys(PER_STAGE, _slugs(mission.stage_names))
    components |= dict.fromkeys(PER_JETTISON, _slugs(mission.jettison_names))
    components |= {
        f"navigation.{key}": AXES["eci"]
        for key in ("position_bias_m", "velocity_bias_m_s", "sensed_delta_v_scale")
    }
    components["wind.factor"] = ("east", "north")
    components["ballistic_coefficient"] = piece_slugs(mission)
    given = _given(dispersions)
    quantities = []
    for name in FIELDS:
        quantity = _Quantity(name, given[name], components.get(name, ("",)))
        if len(quantity.spreads) not in (1, quantity.size):
            names = ", ".join(quantity.components)
            problem = (
                f"{name} is a list of {len(quantity.spreads)}; expected {quantity.size}: {names}"
            )
            raise DispersionsError("dispersions", [problem])
        active = any(spread.active for spread in quantity.spreads)
        if quantity.size and (active or (name[:8] == "nrlmsis." and dispersions.nrlmsis)):
            quantities.append(quantity)
    return quantities


def _given(dispersions: Dispersions) -> dict[str, Spreads]:
    """Return the distribution of every quantity; that of an absent part is always 0."""
    given: dict[str, Spreads] = {}
    for name in FIELDS:
        group, _, key = name.rpartition(".")
        part: Any = getattr(dispersions, group) if group else dispersions
        given[name] = getattr(part, key, (Spread(),))
    if dispersions.nrlmsis is not None:
        period = dispersions.nrlmsis.last_date - dispersions.nrlmsis.first_date
        half = 0.5 * period.total_seconds() / DAY_S
        given["nrlmsis.date_days"] = (Spread(half, half, even=True),)
    if dispersions.initial_covariance is not None:
        given[POSITION] = given[VELOCITY] = (Spread(size=1.0),)
    return given


def _check_starts(mission: Mission, dispersions: Dispersions) -> None:
    """Check that each start curve has room for the knot that a start delay may add.

    Raises:
        DispersionsError: a start curve is full.
    """
    if not any(spread.active for spread in dispersions.start_delay_s):
        return
    for arc in mission.arrays().arcs:
        if arc["start_knots"] == MAX_KNOTS and arc["start_fraction"][0] > 0.0:
            stage = mission.stage_names[arc["stage"]]
            problem = f"start_delay_s needs room for a knot in the start of {stage}, which is full"
            raise DispersionsError("dispersions", [problem])


def _check_pad(mission: Mission, dispersions: Dispersions) -> None:
    """Check that nothing moves, pushes or holds a vehicle at rest on the pad.

    Raises:
        DispersionsError: something does.
    """
    if not mission.initial_state.AT_REST:
        return
    for key in (POSITION, VELOCITY, "initial_covariance"):
        value = getattr(dispersions, key)
        if value is not None and (key == "initial_covariance" or any(s.active for s in value)):
            problem = f"{key} is given; expected none, the mission starts at rest on the pad"
            raise DispersionsError("dispersions", [problem])
    if dispersions.start_delay_s[0].active and mission.arrays().arcs["start_knots"][0] > 0:
        problem = (
            f"start_delay_s is {dispersions.start_delay_s[0]} for {mission.stage_names[0]}; "
            "expected 0, the mission begins as it lifts off the pad"
        )
        raise DispersionsError("dispersions", [problem])
