"""What differs between the mission file, the true vehicle and what navigation reports.

A dispersions file (YAML) gives one-sigma values; a quantity that it does not name is exact.
Every quantity draws from a stream of its own, seeded by the flight's seed and the
quantity's name: adding one to the file leaves the draws of the others as they were.
"""

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ares_models.arrays import BURN, MissionArrays

Sigma = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0.0, le=0.2, allow_inf_nan=False)]


class DispersionsError(ValueError):
    """A dispersions file is wrong; the text is one line."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class NavigationErrors(_Table):
    """One-sigma errors of the navigation state, per axis where it is a vector."""

    position_bias_m: Sigma = 0.0
    position_noise_m: Sigma = 0.0
    velocity_bias_m_s: Sigma = 0.0
    velocity_noise_m_s: Sigma = 0.0
    sensed_delta_v_scale: Fraction = 0.0
    mass_scale: Fraction = 0.0
    heating_scale: Fraction = 0.0
    heating_noise: Fraction = 0.0


NO_ERRORS = NavigationErrors()


class Dispersions(_Table):
    """One-sigma dispersions of the true vehicle and its navigation.

    Attributes:
        initial_position_m: per axis.
        initial_velocity_m_s: per axis.
        thrust: fraction, one draw per stage.
        specific_impulse: fraction, one draw per stage.
        stage_mass: fraction of a stage's own mass without what it jettisons, per stage.
        jettison_mass: fraction, one draw per jettison.
        log_density: of the natural logarithm of a factor on the density.
        j2: J2 of the true gravity field; no draw.
        navigation: errors of what navigation reports.
    """

    initial_position_m: Sigma = 0.0
    initial_velocity_m_s: Sigma = 0.0
    thrust: Fraction = 0.0
    specific_impulse: Fraction = 0.0
    stage_mass: Fraction = 0.0
    jettison_mass: Fraction = 0.0
    log_density: Annotated[float, Field(ge=0.0, le=3.0, allow_inf_nan=False)] = 0.0
    j2: Annotated[float, Field(ge=0.0, le=0.01, allow_inf_nan=False)] | None = None
    navigation: NavigationErrors = NO_ERRORS


def load_dispersions(path: str | Path) -> Dispersions:
    """Read a dispersions file.

    Raises:
        DispersionsError: one line with the file, the key, its value and what was expected.
    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise DispersionsError(f"{path}: {reason}") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" line {mark.line + 1}" if mark else ""
        raise DispersionsError(f"{path}{where}: not valid YAML") from error
    if content is None:
        content = {}
    if not isinstance(content, dict):
        raise DispersionsError(f"{path}: expected keys and values, found {content!r}")
    try:
        return Dispersions.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            known = NavigationErrors if len(first["loc"]) > 1 else Dispersions
            raise DispersionsError(
                f"{path}: {key}: unknown key; expected one of {', '.join(known.model_fields)}"
            ) from error
        raise DispersionsError(
            f"{path}: {key}: {first['input']!r}; {first['msg'].lower()}"
        ) from error


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream of one quantity of one flight."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


@dataclass(frozen=True)
class DispersedVehicle:
    """The true vehicle of one flight.

    Attributes:
        arrays: the mission as the plant flies it.
        position: shape (3,), m.
        velocity: shape (3,), m/s.
    """

    arrays: MissionArrays
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]


def disperse(
    arrays: MissionArrays,
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    dispersions: Dispersions,
    seed: int,
) -> DispersedVehicle:
    """Draw the true vehicle of one flight.

    Args:
        arrays: the mission; unchanged.
        position: nominal, shape (3,), m.
        velocity: nominal, shape (3,), m/s.
        dispersions: one-sigma values.
        seed: seed of the flight.
    """
    environment = arrays.environment.copy()
    arcs = arrays.arcs.copy()
    jettisons = arrays.jettisons.copy()
    stages = int(arcs["stage"][-1]) + 1

    thrust = 1.0 + dispersions.thrust * stream(seed, "thrust").standard_normal(stages)
    impulse = 1.0 + dispersions.specific_impulse * stream(seed, "specific_impulse").standard_normal(
        stages
    )
    burns = arcs["kind"] == BURN
    stage = arcs["stage"][burns]
    arcs["thrust"][burns] *= thrust[stage]
    arcs["exhaust_velocity"][burns] *= impulse[stage]
    arcs["mass_flow"][burns] *= (thrust / impulse)[stage]

    jettisons["mass"] *= 1.0 + dispersions.jettison_mass * stream(
        seed, "jettison_mass"
    ).standard_normal(len(jettisons))

    stacks = np.array([arcs["stack_mass"][arcs["stage"] == k][0] for k in range(stages)])
    own = stacks - np.append(stacks[1:], 0.0)
    for jettison in arrays.jettisons:
        own[jettison["stage"]] -= jettison["mass"]
    excess = dispersions.stage_mass * own * stream(seed, "stage_mass").standard_normal(stages)
    arcs["stack_mass"] += np.cumsum(excess[::-1])[::-1][arcs["stage"]]

    environment["density_factor"] *= np.exp(
        dispersions.log_density * stream(seed, "log_density").standard_normal()
    )
    if dispersions.j2 is not None:
        environment["j2"] = dispersions.j2
    return DispersedVehicle(
        arrays=MissionArrays(environment, arrays.atmosphere, arcs, jettisons, arrays.target),
        position=position
        + dispersions.initial_position_m * stream(seed, "initial_position_m").standard_normal(3),
        velocity=velocity
        + dispersions.initial_velocity_m_s
        * stream(seed, "initial_velocity_m_s").standard_normal(3),
    )


class NavigationErrorModel:
    """Biases drawn once, noise drawn at every navigation state."""

    def __init__(self, errors: NavigationErrors, seed: int) -> None:
        """Draw the biases of one flight."""
        self._errors = errors
        self._none = errors == NO_ERRORS

        def constant(name: str, sigma: float, shape: int) -> NDArray[np.float64]:
            return sigma * stream(seed, "navigation." + name).standard_normal(shape)

        self._position_bias = constant("position_bias_m", errors.position_bias_m, 3)
        self._velocity_bias = constant("velocity_bias_m_s", errors.velocity_bias_m_s, 3)
        self._sensed_scale = constant("sensed_delta_v_scale", errors.sensed_delta_v_scale, 3)
        self._mass_scale = float(constant("mass_scale", errors.mass_scale, 1)[0])
        self._heating_scale = float(constant("heating_scale", errors.heating_scale, 1)[0])
        self._position_noise = stream(seed, "navigation.position_noise_m")
        self._velocity_noise = stream(seed, "navigation.velocity_noise_m_s")
        self._heating_noise = stream(seed, "navigation.heating_noise")

    def corrupt(self, nav: NDArray[np.void]) -> None:
        """Turn the true state in ``nav``, shape (1,), dtype NAVIGATION, into the reported one."""
        errors = self._errors
        if self._none:
            return
        nav["position"] += self._position_bias
        nav["velocity"] += self._velocity_bias
        if errors.position_noise_m > 0.0:
            nav["position"] += errors.position_noise_m * self._position_noise.standard_normal(3)
        if errors.velocity_noise_m_s > 0.0:
            nav["velocity"] += errors.velocity_noise_m_s * self._velocity_noise.standard_normal(3)
        nav["sensed_delta_v"] *= 1.0 + self._sensed_scale
        nav["mass"] *= 1.0 + self._mass_scale
        heating = self._heating_scale
        if errors.heating_noise > 0.0:
            heating += errors.heating_noise * self._heating_noise.standard_normal()
        nav["heating_rate"] *= 1.0 + heating
