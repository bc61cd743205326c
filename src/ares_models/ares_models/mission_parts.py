# SPDX-License-Identifier: Apache-2.0
"""Parts of a mission as validated data: description and range of each key.

The key of a number ends in its unit; ``_deg`` keys are in degrees, everything else is SI. Checks
across several parts are in ``mission_checks``.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import ConfigDict, Field, model_validator

from ares_models import mission_keys as allowed
from ares_models.arrays import MAX_ARCS, MAX_AREAS
from ares_models.input_file import KeyPath
from ares_models.mission_arcs import BURN_FORMS, Arc, BurnArc, CoastArc, EngineOut, shortest
from ares_models.mission_boosters import Booster, BurnPart, burn_parts
from ares_models.mission_keys import Part, added_later, check_rising, fail, one_of, optional


class EarthPart(Part):
    """Hold figure and rotation of the body."""

    equatorial_radius_m: allowed.BodyRadius = Field(description="of the ellipsoid, Eq. 2.16")
    polar_radius_m: allowed.BodyRadius = Field(description="of the ellipsoid, Eq. 2.16")
    rotation_rate_rad_s: allowed.RotationRate = Field(description="about z")
    zero_longitude_deg: allowed.Turn | None = added_later(
        "right ascension of longitude zero at mission time 0, from the inertial x axis"
    )

    @model_validator(mode="after")
    def _oblate(self) -> "EarthPart":
        if self.polar_radius_m > self.equatorial_radius_m:
            most = f"at most equatorial_radius_m, {self.equatorial_radius_m} m"
            fail(("polar_radius_m",), self.polar_radius_m, most)
        return self


#: Least difference of the altitudes of two knots of a wind table, m.
MIN_WIND_STEP_M = 1.0
#: Keys that one model needs and the others exclude.
_OWN_KEYS = {
    "nrlmsis": ("f107", "f107a", "ap", "latitude_deg", "longitude_deg"),
    "exponential": ("surface_density_kg_m3", "scale_height_m"),
}


class AtmospherePart(Part):
    """Select the atmosphere model; only nrlmsis and exponential have keys of their own."""

    model: Literal[
        "pra63", "pra63_exponential", "pra63_data", "us76", "nrlmsis", "exponential", "none"
    ] = Field(
        description="which atmosphere; nrlmsis takes place, day and activity from the keys below, "
        "exponential density and scale height"
    )
    density_factor: allowed.DensityFactor = Field(
        default=1.0, description="multiplies every density"
    )
    f107: allowed.SolarFlux | None = optional(
        "solar flux of the day, 1e-22 W/m2/Hz; for nrlmsis and only there"
    )
    f107a: allowed.SolarFlux | None = optional("its 81-day mean; for nrlmsis")
    ap: allowed.GeomagneticIndex | None = optional("geomagnetic index, for nrlmsis")
    latitude_deg: allowed.Latitude | None = optional("place, for nrlmsis")
    longitude_deg: allowed.Turn | None = optional("place, for nrlmsis")
    surface_density_kg_m3: allowed.SurfaceDensity | None = added_later(
        "at altitude 0, for exponential"
    )
    scale_height_m: allowed.ScaleHeight | None = added_later(
        "climb over which density falls by a factor of e, for exponential"
    )
    wind_table: allowed.WindTable | None = added_later(
        "knots [metres of altitude, metres per second to the east, to the north]; "
        "monotone between them, constant below the first, fading to none over 20 km above the last"
    )

    @model_validator(mode="after")
    def _own_keys(self) -> "AtmospherePart":
        for model, keys in _OWN_KEYS.items():
            if self.model != model:
                self.refuse(keys, f"no such key, because model is {self.model}")
                continue
            missing = [key for key in keys if getattr(self, key) is None]
            if missing:
                others = f" for it, and for {', '.join(missing[1:])}" if missing[1:] else ""
                fail((missing[0],), None, f"a number{others}, because model is {model}")
        if self.model == "none" and "density_factor" in self.model_fields_set:
            fail(("density_factor",), self.density_factor, "no such key, because model is none")
        if self.wind_table is not None:
            if self.model == "none":
                fail(("wind_table",), "a table", "no such key, because model is none")
            check_rising("wind_table", self.wind_table, MIN_WIND_STEP_M, "an altitude")
        return self


class EnvironmentPart(Part):
    """Hold gravity, body, altitude model and atmosphere; the Earth where no body is named."""

    model_config = ConfigDict(
        json_schema_extra={
            "required": [],
            "dependentRequired": {
                "mu_m3_s2": ["earth", "atmosphere"],
                "earth": ["mu_m3_s2", "atmosphere"],
            },
        }
    )

    mu_m3_s2: allowed.GravitationalParameter = Field(description="gravitational parameter")
    g0_m_s2: allowed.StandardGravity = Field(
        default=9.80665, description="turns specific impulse into exhaust velocity"
    )
    j2: allowed.Oblateness = Field(
        default=0.0, description="oblateness term of gravity; 0 is Eq. 2.13"
    )
    earth: EarthPart = Field(description="figure and rotation of the body")
    altitude: Literal["ellipsoid", "spherical"] = Field(
        default="ellipsoid", description="above the ellipsoid, or r minus equatorial radius"
    )
    atmosphere: AtmospherePart = Field(
        description="for the heating that a fairing waits for, and the forces of the air"
    )


#: Least difference of the Mach numbers of two knots.
MIN_MACH_STEP = 1e-3


class AerodynamicsPart(Part):
    """Hold the forces of the air on a vehicle: drag and lift, or axial and normal force."""

    model_config = ConfigDict(json_schema_extra=one_of(("drag_table",), ("axial_table",)))

    reference_area_m2: allowed.Area = Field(description="of all coefficients")
    drag_table: allowed.CoefficientTable | None = added_later(
        "drag coefficient, knots [Mach number, coefficient]; monotone between them, "
        "constant beyond both ends"
    )
    lift_table: allowed.CoefficientTable | None = added_later(
        "beside drag_table: lift coefficient per unit of the sine of the angle of attack, likewise"
    )
    axial_table: allowed.CoefficientTable | None = added_later(
        "in place of drag_table: coefficient of the force against the thrust axis"
    )
    normal_table: allowed.CoefficientTable | None = added_later(
        "beside axial_table: coefficient of the force across that axis per unit of "
        "the sine of the angle of attack"
    )
    power_off_table: allowed.CoefficientTable | None = added_later(
        "drag or axial coefficient in coasts, with the drag of the base"
    )

    @model_validator(mode="after")
    def _one_form(self) -> "AerodynamicsPart":
        along = "drag_table" if self.axial_table is None else "axial_table"
        if getattr(self, along) is None:
            fail(("drag_table",), None, "a table, or an axial_table")
        owners = {
            "drag_table": "drag_table",
            "lift_table": "drag_table",
            "axial_table": "axial_table",
            "normal_table": "axial_table",
            "power_off_table": along,
        }
        for key, owner in owners.items():
            table = getattr(self, key)
            if table is None:
                continue
            if owner != along:
                fail((key,), table, f"no such key beside {along}")
            check_rising(key, table, MIN_MACH_STEP, "a Mach number")
        return self

    def along(self, burns: bool) -> allowed.CoefficientTable:
        """Return the coefficients of drag or axial force, in a burn or in a coast."""
        if not burns and self.power_off_table is not None:
            return self.power_off_table
        table = self.axial_table if self.drag_table is None else self.drag_table
        assert table is not None
        return table


_CIRCLE = ("latitude_deg", "longitude_deg", "radius_m")


class AreaPart(Part):
    """Hold a protected area of the ground: a circle or a polygon."""

    model_config = ConfigDict(json_schema_extra=one_of(_CIRCLE, ("vertices_deg",)))

    name: allowed.Name = Field(description="unique; at most 80 characters")
    latitude_deg: allowed.Latitude | None = optional("of the centre of a circle, geodetic")
    longitude_deg: allowed.Turn | None = optional("of the centre of a circle, positive to the east")
    radius_m: allowed.AreaRadius | None = optional("of a circle, over the ground")
    vertices_deg: allowed.Vertices | None = optional(
        "corners of a polygon in turn, [latitude, longitude] each"
    )

    @model_validator(mode="after")
    def _one_form(self) -> "AreaPart":
        if self.vertices_deg is not None:
            self.refuse(_CIRCLE, "no such key beside vertices_deg")
            return self
        given = self.given(_CIRCLE)
        for key in _CIRCLE:
            if key not in given:
                others = "the centre and radius of a circle, or a list of vertices_deg"
                fail((key,), None, others if not given else "a number, for a circle")
        return self


class AbortPart(Part):
    """Hold the aims for a target out of reach: a safe orbit, and areas to avoid."""

    safe_perigee_altitude_m: allowed.SafeAltitude = Field(
        description="least perigee of an orbit that is safe, above the equatorial radius"
    )
    avoid: Annotated[tuple[AreaPart, ...], Field(max_length=MAX_AREAS)] = Field(
        default=(),
        exclude_if=lambda areas: not areas,
        description="areas that the impact point is kept out of where no orbit is in reach",
    )


#: Largest number of kinds of boosters of a stage.
MAX_BOOSTERS = 4

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

    name: allowed.Name = Field(description="unique; at most 80 characters")
    ignition_mass_kg: allowed.Mass | None = optional(
        "this stage and everything above it, at the moment the stage begins"
    )
    dry_mass_kg: allowed.Mass | None = added_later(
        "in place of ignition_mass_kg: of the empty stage alone"
    )
    propellant_kg: allowed.Mass | None = optional("usable by the whole stage, shared by its burns")
    residuals_kg: allowed.Load | None = added_later(
        "beside dry_mass_kg: propellant that cannot be used"
    )
    arcs: Annotated[tuple[Arc, ...], Field(min_length=1)] | None = Field(
        default=None,
        description="burns and coasts in order",
        json_schema_extra={"maxItems": MAX_ARCS},
    )
    boosters: Annotated[tuple[Booster, ...], Field(max_length=MAX_BOOSTERS)] = Field(
        default=(),
        exclude_if=lambda boosters: not boosters,
        description="what burns beside the first burn of the stage, and drops when empty or later",
    )
    aerodynamics: AerodynamicsPart | None = added_later(
        "of the vehicle while this stage is the lowest; default: that of the mission"
    )
    ballistic_coefficient_kg_m2: allowed.BallisticCoefficient | None = added_later(
        "of the stage as it falls: mass over drag coefficient times area"
    )
    max_dynamic_pressure_pa: allowed.Pressure | None = added_later(
        "greatest 0.5 rho V^2 of the stage"
    )
    max_q_alpha_pa_rad: allowed.Pressure | None = added_later(
        "greatest dynamic pressure times sine of the angle of attack of the stage"
    )
    thrust_n: allowed.Thrust | None = _of_burn("thrust_n", None)
    isp_s: allowed.SpecificImpulse | None = _of_burn("isp_s", None)
    engines: allowed.EngineCount = _of_burn("engines", 1)
    burn_time_s: allowed.BurnTime | None = _of_burn("burn_time_s", None)
    thrust_table: allowed.ThrustTable | None = _of_burn("thrust_table", None)
    mass_flow_table: allowed.FlowTable | None = _of_burn("mass_flow_table", None)
    min_s: allowed.Delay | None = _of_burn("min_s", None)
    max_s: allowed.Duration | None = _of_burn("max_s", None)
    min_altitude_m: allowed.FloorAltitude | None = _of_burn("min_altitude_m", None)
    exit_area_m2: allowed.Area | None = _of_burn("exit_area_m2", None)
    vertical_rise_s: allowed.Duration | None = _of_burn("vertical_rise_s", None)
    attitude: Literal["guided", "held"] = _of_burn("attitude", "guided")
    max_acceleration_m_s2: allowed.Acceleration | None = _of_burn("max_acceleration_m_s2", None)
    min_throttle: allowed.Fraction | None = _of_burn("min_throttle", None)
    throttle_bucket: allowed.BucketThrottle | None = _of_burn("throttle_bucket", None)
    start: allowed.Curve | None = _of_burn("start", None)
    tail_off: allowed.Curve | None = _of_burn("tail_off", None)
    engine_out: EngineOut | None = _of_burn("engine_out", None)

    @model_validator(mode="after")
    def _one_form(self) -> "Stage":
        if self.arcs is None:
            self._single_arc().check_whole(", or a list of arcs in its place")
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

    @property
    def first_free_arc(self) -> tuple[float, int | None]:
        """Return the first free arc from the first ignition on; None: none is free.

        The other value is the time from that ignition to its begin, s.
        """
        before = 0.0
        lit = False
        for k, arc in enumerate(self.flight_arcs):
            lit = lit or isinstance(arc, BurnArc)
            if lit and arc.free:
                return before, k
            before += arc.duration_s if lit else 0.0
        return before, None

    @property
    def booster_propellant_kg(self) -> float:
        """Return the propellant of all boosters."""
        return sum(booster.count * booster.propellant_kg for booster in self.boosters)

    def parts_of(self, k: int, g0: float) -> tuple[BurnPart, ...]:
        """Return the parts of burn ``k`` that are arcs for the kernels; g0 in m/s2."""
        arc = self.flight_arcs[k]
        if not isinstance(arc, BurnArc):
            raise TypeError(f"arc {k} is a coast")
        first = not any(isinstance(before, BurnArc) for before in self.flight_arcs[:k])
        return burn_parts(arc.name or self.name, arc, self.boosters if first else (), g0)

    def fixed_propellant(
        self, g0: float, mass_kg: float, drops: Sequence[tuple[float, float]] = ()
    ) -> float:
        """Compute the propellant of all burns of fixed length without boosters, kg.

        Args:
            g0: m/s2.
            mass_kg: of the stage and all above it at its start.
            drops: jettisons at known times, in order: s after the first ignition, kg.
        """
        used, begin = 0.0, 0.0
        # boosters burn out, and drop, before the end of the first burn
        left_alone = max((booster.drop_s(g0) for booster in self.boosters), default=0.0)
        lit = False
        for arc in self.flight_arcs:
            lit = lit or isinstance(arc, BurnArc)
            if not lit:
                continue
            if isinstance(arc, BurnArc) and not arc.free:
                gone = sum(mass for at, mass in drops if at <= begin)
                later = [(at - begin, mass) for at, mass in drops if at > begin]
                if begin > 0.0:
                    gone += self.booster_propellant_kg
                used += arc.propellant(g0, mass_kg - gone - used, later)
            begin = max(begin + shortest(arc), left_alone)
        return used


class PlacedArc(NamedTuple):
    """Hold an arc with its place in a mission.

    Attributes:
        i: index of its stage.
        stage: its stage.
        k: its index in the stage.
        arc: itself.
    """

    i: int
    stage: Stage
    k: int
    arc: BurnArc | CoastArc

    def path(self, *keys: str | int) -> KeyPath:
        """Return the key path of the arc in the mission, or of a key of it."""
        return ("stages", self.i, *self.stage.arc_path(self.k, *keys))


HeatingLimitHolds = Literal["at_jettison", "from_jettison"]


class Jettison(Part):
    """Hold a jettison: its mass and its criterion."""

    model_config = ConfigDict(
        json_schema_extra=one_of(("heating_limit_w_m2",), ("time_s",), ("time_after_ignition_s",))
    )

    name: allowed.Name = Field(description="unique; at most 80 characters")
    mass_kg: allowed.Mass = Field(description="what is dropped")
    stage: allowed.Name = Field(
        description="name of the stage before whose first ignition it is not dropped"
    )
    heating_limit_w_m2: allowed.HeatingRate | None = optional(
        "when free molecular heating, 0.5 rho V_rel^3, has fallen below this"
    )
    heating_limit_holds: HeatingLimitHolds = Field(
        default="at_jettison", description="at the jettison, or from then until cut-off"
    )
    time_s: allowed.MissionTime | None = optional("at this mission elapsed time")
    time_after_ignition_s: allowed.Delay | None = optional(
        "so long after the stage's first ignition command"
    )
    ballistic_coefficient_kg_m2: allowed.BallisticCoefficient | None = added_later(
        "of the part as it falls: mass over drag coefficient times area"
    )

    @model_validator(mode="after")
    def _one_criterion(self) -> "Jettison":
        keys = ("heating_limit_w_m2", "time_s", "time_after_ignition_s")
        if not self.take_one(keys):
            fail((keys[0],), None, f"one of {', '.join(keys)}")
        if self.heating_limit_w_m2 is None and "heating_limit_holds" in self.model_fields_set:
            self.refuse(("heating_limit_holds",), "no such key without heating_limit_w_m2")
        return self
