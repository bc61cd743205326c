# SPDX-License-Identifier: Apache-2.0
"""Missions: read from a file, checked, and converted to the kernels' arrays.

``docs/missions.md`` describes the file format key by key.
"""

import math
import re
from dataclasses import dataclass
from hashlib import sha256
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, ModelWrapValidatorHandler, PrivateAttr, model_validator

from ares_models.arrays import NAVIGATION, MissionArrays
from ares_models.atmosphere import FIXED_MODELS, Atmosphere, AtmosphereError, exponential, nrlmsis
from ares_models.earth import Earth
from ares_models.input_file import InputError, InputKind, format_kilograms, read_text
from ares_models.input_model import parse_model
from ares_models.kernels.sequence import SAME_TIME
from ares_models.mission_arcs import BurnArc, CoastArc, shortest
from ares_models.mission_arrays import arc_array, environment_array, jettison_array
from ares_models.mission_checks import MAX_STAGES, check_mission
from ares_models.mission_depletion import end_at_depletion
from ares_models.mission_keys import Load, Moment, Part, Text, added_later, optional
from ares_models.mission_masses import PROPELLANT_ROUNDING, ignition_mass
from ares_models.mission_parts import (
    AbortPart,
    AerodynamicsPart,
    EnvironmentPart,
    HeatingLimitHolds,
    Jettison,
    PlacedArc,
    Stage,
)
from ares_models.mission_pieces import DroppedPiece, dropped_pieces
from ares_models.mission_programme import ProgrammePart
from ares_models.mission_release import HoldDown, release
from ares_models.mission_shorthand import on_earth, with_inclination
from ares_models.mission_start import EXPECTED_START, InitialState
from ares_models.mission_start import FORMS as START_FORMS
from ares_models.mission_target import (
    EXPECTED_TARGET,
    Target,
    TargetOrbit,
    TargetState,
    target_record,
)
from ares_models.plans import needs_plan
from ares_models.sidereal import greenwich_sidereal_time_deg, turns_as_earth

__all__ = [
    "MISSION",
    "TEMPLATE",
    "Mission",
    "MissionError",
    "Start",
    "list_missions",
    "load_mission",
]

#: Default propellant of a stage with a free burn, as a fraction of its ignition mass without its
#: own jettisons; large, so that no invented limit ends a flight.
DEFAULT_PROPELLANT_SHARE = 0.95

Array = NDArray[np.float64]


class MissionError(InputError):
    """Report an unusable mission; the text is one line."""


#: Key of the mission file's text in the settings that a simulator announces.
MISSION_TEXT = "mission_text"

MISSION = InputKind("mission", MissionError, "ares_models", "missions")

#: Template of a new mission: a small launcher that reaches its target.
TEMPLATE = Path(str(resources.files("ares_models").joinpath("data/template.yaml")))


@dataclass(frozen=True)
class Start:
    """Hold the initial state of a mission.

    Attributes:
        time_s: mission elapsed time, s.
        position: frame ares_eci, m, shape (3,).
        velocity: frame ares_eci, m/s, shape (3,).
        mass_kg: of the whole stack.
    """

    time_s: float
    position: Array
    velocity: Array
    mass_kg: float

    def navigation(self) -> NDArray[np.void]:
        """Return the navigation state, shape (1,), dtype NAVIGATION; its heating is unknown."""
        record = np.zeros(1, NAVIGATION)
        record["time"] = record["arc_start_time"] = self.time_s
        record["position"] = self.position
        record["velocity"] = self.velocity
        record["mass"] = self.mass_kg
        record["heating_rate"] = math.nan
        return record


#: Block that a file may leave out: :func:`on_earth` writes it.
_BODY = "environment"


class Mission(Part):
    """Hold the checked content of a mission file."""

    model_config = ConfigDict(json_schema_extra=lambda schema: schema["required"].remove(_BODY))

    name: Annotated[str, Field(strict=True, pattern=r"^[a-z0-9][a-z0-9_]*$", max_length=64)] = (
        Field(description="at most 64 small letters, digits, underscores")
    )
    title: Text = Field(description="what it is")
    source: Text = Field(description="where the numbers come from")
    payload_kg: Load | None = added_later("what is carried, where masses are by item")
    adapter_kg: Load | None = added_later("what it stands on, which stays with the last stage")
    epoch: Moment | None = optional(
        "date and time of mission time 0, ISO 8601; UTC if no zone is given"
    )
    environment: EnvironmentPart = Field(
        description="body, gravity, atmosphere; the Earth where it names no body"
    )
    initial_state: InitialState = Field(description="where the flight begins, in one of six forms")
    aerodynamics: AerodynamicsPart | None = added_later(
        "forces of the air on all stages without their own"
    )
    stages: Annotated[tuple[Stage, ...], Field(min_length=1, max_length=MAX_STAGES)] = Field(
        description="in flight order"
    )
    programme: ProgrammePart | None = added_later(
        "attitude from the start on, in place of a planned one"
    )
    jettisons: tuple[Jettison, ...] = Field(default=(), description="what is dropped in flight")
    target: Target = Field(description="where to: a point of an orbit, or an orbit by its elements")

    abort: AbortPart | None = added_later("what is flown to where the target is out of reach")

    _held: HoldDown | None = PrivateAttr(default=None)

    @property
    def held(self) -> HoldDown | None:
        """Return what became of the vehicle before its release; None: it begins at ignition."""
        return self._held

    @property
    def held_s(self) -> float:
        """Return the time from the first ignition to the release, s."""
        return self._held.time_s if self._held else 0.0

    @model_validator(mode="after")
    def _whole(self) -> "Mission":
        check_mission(self)
        return self

    # after `_whole`, so that the file is checked as it stands too
    @model_validator(mode="wrap")
    @classmethod
    def _at_release(cls, data: Any, check: ModelWrapValidatorHandler["Mission"]) -> "Mission":
        """Check the mission as its file has it; begin it at its release from pad or rail."""
        data = with_inclination(end_at_depletion(on_earth(data)), check)
        mission, held = release(data, check(data), check)
        mission._held = held
        return mission

    @property
    def stage_names(self) -> tuple[str, ...]:
        """Return the names of the stages in flight order; ``ARC.stage`` is the index."""
        return tuple(stage.name for stage in self.stages)

    @property
    def walk(self) -> tuple[PlacedArc, ...]:
        """Return the arcs of the file in flight order, each with its place."""
        return tuple(
            PlacedArc(i, stage, k, arc)
            for i, stage in enumerate(self.stages)
            for k, arc in enumerate(stage.flight_arcs)
        )

    @property
    def arc_names(self) -> tuple[str, ...]:
        """Return one name per arc in flight order: its own, or the stage's.

        A burn that rises vertically, has boosters or loses engines is several arcs.
        """
        names = []
        for _, stage, k, arc in self.walk:
            if isinstance(arc, CoastArc):
                names.append(arc.name or stage.name)
                continue
            names += [part.name for part in stage.parts_of(k, self.environment.g0_m_s2)]
            if arc.engine_out:
                names.append(f"{names[-1]}, engine out")
        return tuple(names)

    @property
    def vertical_rises(self) -> tuple[int, ...]:
        """Return the arcs at whose end the vehicle leaves the vertical, by index."""
        rising = [*arc_array(self, foreseen=True)["vertical"].tolist(), 0]
        return tuple(k for k, rises in enumerate(rising[:-1]) if rises and not rising[k + 1])

    @property
    def area_names(self) -> tuple[str, ...]:
        """Return the names of the protected areas, in the order of the kernels' arrays."""
        return tuple(area.name for area in self.abort.avoid) if self.abort else ()

    @property
    def plans_arcs(self) -> bool:
        """Return whether arcs before the last are free."""
        return any(placed.arc.free for placed in self.walk[:-1])

    @property
    def needs_plan(self) -> bool:
        """Return whether guidance needs a plan of the optimizer; see :mod:`ares_models.plans`."""
        environment = self.environment_array()[0]
        return needs_plan(arc_array(self, foreseen=True), target_record(self)[0], environment)

    @property
    def drops(self) -> tuple[Jettison, ...]:
        """Return what is dropped: the jettisons of the file, then the boosters."""
        g0 = self.environment.g0_m_s2
        boosters = [
            Jettison(
                name=booster.name,
                mass_kg=booster.count * booster.dry_mass_kg,
                stage=stage.name,
                time_after_ignition_s=booster.drop_s(g0),
                ballistic_coefficient_kg_m2=booster.ballistic_coefficient_kg_m2,
            )
            for stage in self.stages
            for booster in stage.boosters
        ]
        return (*self.jettisons, *boosters)

    @property
    def jettison_names(self) -> tuple[str, ...]:
        """Return the names of all drops in the order of ``jettisoned``."""
        return tuple(jettison.name for jettison in self.drops)

    def with_names(self, text: str) -> str:
        """Put names behind numbers of arcs, jettisons and stages: "arc 1", "of stage 0"."""
        known = {
            "arc": self.arc_names,
            "jettison": self.jettison_names,
            "of stage": self.stage_names,
        }

        def named(found: re.Match[str]) -> str:
            names, k = known[found[1]], int(found[2])
            return f"{found[0]} ({names[k]})" if k < len(names) else found[0]

        return re.sub(r"\b(arc|jettison|of stage) (\d+)\b(?! \()", named, text)

    @property
    def heating_limit_holds(self) -> HeatingLimitHolds:
        """Return when the heating limits hold: at the jettison, or from then until cut-off."""
        held = any(part.heating_limit_holds == "from_jettison" for part in self.jettisons)
        return "from_jettison" if held else "at_jettison"

    def jettison_mass(self, stage: int) -> float:
        """Return the mass of the jettisons of a stage, kg."""
        name = self.stages[stage].name
        return sum(jettison.mass_kg for jettison in self.drops if jettison.stage == name)

    def ignition_mass(self, stage: int) -> float:
        """Return the mass of a stage and all above it at its start, kg: as given, or by item."""
        return ignition_mass(self, stage)

    def fixed_propellant(self, stage: int) -> float:
        """Return the propellant of a stage's burns of fixed length and of its boosters, kg."""
        part = self.stages[stage]
        timed = (
            (jettison.time_after_ignition_s, jettison.mass_kg)
            for jettison in self.drops
            if jettison.stage == part.name and jettison.time_after_ignition_s is not None
        )
        whole = self.ignition_mass(stage)
        core = part.fixed_propellant(self.environment.g0_m_s2, whole, sorted(timed))
        return core + part.booster_propellant_kg

    def ignition_times(self) -> tuple[float, ...]:
        """Return the earliest mission elapsed time of each stage's first ignition command, s."""
        times = []
        now = self.initial_state.time_s
        for stage in self.stages:
            first = math.nan
            for arc in stage.flight_arcs:
                if isinstance(arc, BurnArc) and math.isnan(first):
                    first = now
                now += shortest(arc)
            times.append(first)
        return tuple(times)

    def propellant(self, stage: int) -> float:
        """Return the usable propellant of a stage and its boosters, kg: as given, or by default.

        The default is the propellant of the burns of fixed length; with a free burn, 95 % of the
        stage's ignition mass without its own jettisons.
        """
        part = self.stages[stage]
        if part.propellant_kg is not None:
            given = part.propellant_kg + part.booster_propellant_kg
            used = self.fixed_propellant(stage)
            tabled = any(burn.thrust_table is not None for burn in part.burns)
            if part.boosters or tabled or used <= (1.0 + PROPELLANT_ROUNDING) * given:
                # a rounded value must not end the burn before its time, or its table
                return max(given, used)
            return given
        if any(arc.free for arc in part.burns):
            own = self.ignition_mass(stage) - self.jettison_mass(stage)
            return DEFAULT_PROPELLANT_SHARE * own
        return self.fixed_propellant(stage)

    @property
    def zero_longitude_deg(self) -> float | None:
        """Return the right ascension of longitude zero at mission time 0, deg; None: not known.

        It comes from the file, or from the epoch for a body with the Earth's rotation rate; the
        inertial x axis then points to the mean equinox of date.
        """
        given = self.environment.earth.zero_longitude_deg
        if given is not None or self.epoch is None:
            return given
        if not turns_as_earth(self.environment.earth.rotation_rate_rad_s):
            return None
        return greenwich_sidereal_time_deg(self.epoch)

    def earth(self) -> Earth:
        """Return figure and rotation of the body; an unknown right ascension is taken as 0."""
        part = self.environment.earth
        return Earth(
            part.equatorial_radius_m,
            part.polar_radius_m,
            part.rotation_rate_rad_s,
            math.radians(self.zero_longitude_deg or 0.0),
        )

    def start(self) -> Start:
        """Return time, position, velocity and mass at the start of the flight."""
        position, velocity = self.initial_state.state(self.environment.mu_m3_s2, self.earth())
        return Start(self.initial_state.time_s, position, velocity, self.ignition_mass(0))

    def start_of_plan(self, navigated: NDArray[np.void]) -> NDArray[np.void]:
        """Return the state from which to plan: at rest on the ground the surveyed one.

        There an error of the navigation could begin the flight below the ground.

        Args:
            navigated: navigation state, shape (1,), dtype NAVIGATION.
        """
        start = self.start()
        if self.initial_state.AT_REST and navigated["time"][0] <= start.time_s + SAME_TIME:
            return start.navigation()
        return navigated

    def atmosphere(self) -> Atmosphere:
        """Build the atmosphere, without the density factor.

        Raises:
            MissionError: a package that the model needs is missing.
        """
        part = self.environment.atmosphere
        if part.surface_density_kg_m3 is not None and part.scale_height_m is not None:
            surface = self.environment.mu_m3_s2 / self.environment.earth.equatorial_radius_m**2
            return exponential(part.surface_density_kg_m3, part.scale_height_m, surface)
        if part.model != "nrlmsis":
            return FIXED_MODELS[part.model]()
        indices = (part.latitude_deg, part.longitude_deg, part.f107, part.f107a, part.ap)
        latitude, longitude, f107, f107a, ap = (float(x) for x in indices if x is not None)
        if self.epoch is None:
            raise MissionError(f"mission {self.name}", ["epoch is missing; nrlmsis needs it"])
        try:
            return nrlmsis(self.epoch, latitude, longitude, f107, f107a, ap)
        except AtmosphereError as error:
            raise MissionError(f"mission {self.name}", [str(error)]) from error

    def arrays(self, *, foreseen: bool = False) -> MissionArrays:
        """Compile the mission for the kernels, into new arrays that the caller may change.

        Args:
            foreseen: as guidance expects the flight: no engine fails, and the burn after a
                failure has length 0.

        Raises:
            MissionError: a package that the atmosphere needs is missing.
        """
        return MissionArrays(
            environment=self.environment_array(),
            atmosphere=self.atmosphere().table.copy(),
            arcs=arc_array(self, foreseen),
            jettisons=jettison_array(self),
            target=target_record(self),
        )

    def environment_array(self) -> NDArray[np.void]:
        """Compile gravity, figure, rotation and areas, shape (1,), dtype ENVIRONMENT."""
        return environment_array(self)

    @property
    def pieces(self) -> tuple[DroppedPiece, ...]:
        """Return what falls: the stages but the last, then the drops; see `dropped_pieces`."""
        return dropped_pieces(self)

    @property
    def digest(self) -> str:
        """Return a digest of the file's content without comments and layout, 16 characters."""
        return sha256(self.model_dump_json().encode()).hexdigest()[:16]

    def describe(self) -> dict[str, str]:
        """Return short texts for a list: name, title, stages, jettisons, target, source.

        Stages have their ignition masses, which a file with masses by item does not name.
        """
        separator = "; " if any("," in name for name in self.jettison_names) else ", "
        return {
            "name": self.name,
            "title": self.title,
            "stages": ", ".join(
                f"{name} {format_kilograms(self.ignition_mass(i))} kg"
                for i, name in enumerate(self.stage_names)
            ),
            "jettisons": separator.join(self.jettison_names) or "none",
            "target": self.target.describe(),
            "source": " ".join(self.source.split()),
        }


def list_missions() -> tuple[str, ...]:
    """Return the names of the shipped missions, sorted."""
    return MISSION.shipped()


def load_mission(name_or_path: str | Path) -> Mission:
    """Read and check a mission.

    Args:
        name_or_path: name of a shipped mission, or path of a mission file. A text with a
            path separator or with the ending .yaml or .yml is a path.

    Raises:
        MissionError: one line that names the file, the key path, the value found and the
            expected one.
    """
    return read_mission(name_or_path)[0]


def read_mission(name_or_path: str | Path) -> tuple[Mission, str]:
    """Read and check a mission; return it with the text of its file.

    Args: as in :func:`load_mission`.

    Raises:
        MissionError: as in :func:`load_mission`.
    """
    path = MISSION.find(name_or_path)
    text = read_text(path, MISSION)
    return parse_mission(text, str(path)), text


def parse_mission(text: str, source: str) -> Mission:
    """Parse and check a mission from the text of its file.

    Args:
        text: of the file.
        source: name of the file in errors.

    Raises:
        MissionError: as in :func:`load_mission`.
    """
    return parse_model(text, source, MISSION, Mission, _FORMS, _BLOCKS)


_FORMS: dict[str, type[Part]] = {
    **START_FORMS,
    "<burn>": BurnArc,
    "<coast>": CoastArc,
    "<state>": TargetState,
    "<orbit>": TargetOrbit,
}

_ON_PAD_ALONE = (
    "no such key here: it belongs to a start at rest on the ground, which is by "
    "geodetic_latitude_deg, longitude_deg and altitude_m alone"
)
#: What an error message names where a whole block is missing or a key is of another form, by path.
_BLOCKS = {
    "environment": "a mapping with mu_m3_s2, earth and atmosphere",
    "environment.earth": (
        "a mapping with equatorial_radius_m, polar_radius_m and rotation_rate_rad_s"
    ),
    "environment.atmosphere": "a mapping with model, such as us76 or none",
    "initial_state": EXPECTED_START,
    "initial_state.hold_down_s": _ON_PAD_ALONE,
    "initial_state.rail": _ON_PAD_ALONE,
    "stages": (
        "a list, each with name, dry_mass_kg, propellant_kg, thrust_n, isp_s and burn_time_s, or "
        "arcs in place of the last three"
    ),
    "target": EXPECTED_TARGET,
}
