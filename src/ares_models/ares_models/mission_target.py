# SPDX-License-Identifier: Apache-2.0
"""Target of a mission: its forms, their checks, and the kernels' record."""

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from ares_models import arrays as layout
from ares_models import mission_keys as allowed
from ares_models.conic import Conic, complete
from ares_models.mission_arcs import ORBIT_KEYS, CoastArc
from ares_models.mission_keys import Part, added_later, by_keys, fail, optional
from ares_models.ranges import Range
from ares_models.sidereal import greenwich_sidereal_time_deg, node_of_local_time_deg, turns_as_earth

if TYPE_CHECKING:
    from ares_models.mission import Mission

#: Largest difference of apogee and perigee of a circular orbit, m.
CIRCLE_M = 1.0

# eccentricity of a hyperbola with twice the escape speed at perigee
_FASTEST = 7.0

# sine of the inclination below which an orbit has no node
_FLAT = 1e-6

CharacteristicEnergy = Annotated[float, Range(-1e10, 1e10)]


_HEADINGS = {"north": layout.HEADS_NORTH, "south": layout.HEADS_SOUTH}
_NODES = ("ascending_node_deg", "raan_deg", "local_time_of_node_h")


class _TargetPlane(Part):
    """Hold the ascending node of a target in one of three forms, or free."""

    raan_deg: allowed.Turn | None = added_later(
        "in place of ascending_node_deg: from the mean equinox of the epoch"
    )
    local_time_of_node_h: allowed.LocalTime | None = added_later(
        "in place of ascending_node_deg: mean solar time there at the epoch"
    )
    launch_heading: Literal["north", "south"] | None = added_later(
        "from a pad, where the node is free: which of the two planes over it is flown"
    )

    @model_validator(mode="after")
    def _one_node(self) -> "_TargetPlane":
        self.take_one(_NODES)
        return self

    @property
    def node_key(self) -> str | None:
        """Return the key of the file that gives the node."""
        return next(iter(self.given(_NODES)), None)

    def node_deg(self, mission: "Mission") -> float | None:
        """Return the ascending node from the inertial x axis, deg; None if free."""
        key = self.node_key
        if key is None:
            return None
        value: float = getattr(self, key)
        if key == "ascending_node_deg":
            return value
        equinox = _equinox_deg(mission, key, value)
        if key == "raan_deg":
            return equinox + value
        assert mission.epoch is not None
        return equinox + node_of_local_time_deg(mission.epoch, value)

    def describe_node(self) -> str | None:
        """Describe the node in a few words; None if free."""
        if self.launch_heading is not None:
            return f"launch to the {self.launch_heading}"
        texts = {
            "ascending_node_deg": "node {:g} deg",
            "raan_deg": "RAAN {:g} deg",
            "local_time_of_node_h": "node at {:g} h local time",
        }
        key = self.node_key
        return None if key is None else texts[key].format(getattr(self, key))


def _equinox_deg(mission: "Mission", key: str, value: float) -> float:
    """Return the angle of the epoch's mean equinox from the inertial x axis, deg.

    Args:
        mission: the mission.
        key: key of the target that counts from the equinox.
        value: of the key.

    Raises:
        PydanticCustomError: the mission has no epoch, or its body is not the Earth.
    """
    if mission.epoch is None:
        fail(("epoch",), None, f"a date and time, because target.{key} is there")
    if not turns_as_earth(mission.environment.earth.rotation_rate_rad_s):
        fail(("target", key), value, "no such key, because the body does not turn as the Earth")
    assert mission.zero_longitude_deg is not None
    return mission.zero_longitude_deg - greenwich_sidereal_time_deg(mission.epoch)


class TargetState(_TargetPlane):
    """Hold a target by radius, speed, flight-path angle, inclination and, optionally, node."""

    radius_m: allowed.Radius = Field(description="from the centre")
    speed_m_s: allowed.Speed = Field(description="inertial")
    flight_path_angle_deg: allowed.FlightPathAngle = Field(description="of the inertial velocity")
    inclination_deg: allowed.Inclination = Field(description="to the equator")
    ascending_node_deg: allowed.Turn | None = optional("if the plane is fixed")

    def check(self, mission: "Mission") -> None:
        """Report a radius below the surface, or a speed far from an orbital one."""
        surface = mission.environment.earth.equatorial_radius_m
        if self.radius_m <= surface:
            expected = f"more than the Earth's radius, {surface:,.0f} m"
            fail(("target", "radius_m"), self.radius_m, expected)
        escape = math.sqrt(2.0 * mission.environment.mu_m3_s2 / self.radius_m)
        if not 0.1 * escape <= self.speed_m_s < escape:
            expected = f"between {0.1 * escape:,.0f} and {escape:,.0f} m/s (escape) at this radius"
            fail(("target", "speed_m_s"), self.speed_m_s, expected)

    def write(self, record: NDArray[np.void], mission: "Mission") -> None:
        """Write a record TARGET, except its plane."""
        record["kind"] = (
            layout.TARGET_RADIUS_SPEED_ANGLE_INCLINATION
            if self.node_key is None
            else layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
        )
        record["radius"] = self.radius_m
        record["speed"] = self.speed_m_s
        record["flight_path_angle"] = math.radians(self.flight_path_angle_deg)

    def describe(self) -> str:
        """Describe the target in one line."""
        aim = (
            f"r {self.radius_m:,.0f} m, V {self.speed_m_s:,.3f} m/s, "
            f"gamma {self.flight_path_angle_deg:g} deg, i {self.inclination_deg:g} deg"
        )
        node = self.describe_node()
        return aim if node is None else f"{aim}, {node}"


_SIZES = ("perigee", "apogee", "semi_major_axis_m", "eccentricity", "c3_m2_s2")
_KEPLERIAN = {
    "semi_major_axis_m",
    "eccentricity",
    "inclination_deg",
    "ascending_node_deg",
    "argument_of_perigee_deg",
}
_NAMES = {
    "perigee": layout.NAMES_PERIGEE,
    "apogee": layout.NAMES_APOGEE,
    "semi_major_axis_m": layout.NAMES_SEMI_MAJOR_AXIS,
    "eccentricity": layout.NAMES_ECCENTRICITY,
    "c3_m2_s2": layout.NAMES_C3,
    "inclination_deg": layout.NAMES_INCLINATION,
    "ascending_node_deg": layout.NAMES_ASCENDING_NODE,
    "argument_of_perigee_deg": layout.NAMES_ARGUMENT_OF_PERIGEE,
    "at": layout.NAMES_TRUE_ANOMALY,
    "true_anomaly_deg": layout.NAMES_TRUE_ANOMALY,
}
_NAMES_STATE = layout.NAMES_RADIUS | layout.NAMES_SPEED | layout.NAMES_FLIGHT_PATH_ANGLE


class TargetOrbit(_TargetPlane):
    """Hold a target by orbital elements, each given or free."""

    perigee_radius_m: allowed.Radius | None = optional("from the centre")
    perigee_altitude_m: allowed.Altitude | None = optional("above the equatorial radius")
    apogee_radius_m: allowed.Radius | None = optional("from the centre")
    apogee_altitude_m: allowed.Altitude | None = optional("above the equatorial radius")
    semi_major_axis_m: allowed.AnySemiMajorAxis | None = optional("negative for a hyperbola")
    eccentricity: allowed.AnyEccentricity | None = optional("beside another of size and shape")
    c3_m2_s2: CharacteristicEnergy | None = optional("twice the energy: 0 or more escapes")
    inclination_deg: allowed.OrbitInclination | None = optional(
        "to the equator, or sun_synchronous, by J2"
    )
    ascending_node_deg: allowed.Turn | None = optional("from the inertial x axis")
    argument_of_perigee_deg: allowed.Turn | None = optional("from the node")
    argument_of_latitude_deg: allowed.Turn | None = added_later(
        "from the node to the cut-off; the argument of perigee or the anomaly follows"
    )
    dla_deg: allowed.Latitude | None = added_later("declination of the outgoing asymptote")
    rla_deg: allowed.Turn | None = added_later(
        "its right ascension, from the mean equinox of the epoch"
    )
    at: Literal["perigee", "apogee"] | None = optional("where on it")
    true_anomaly_deg: allowed.Turn | None = optional("the same as an angle from perigee")

    def key_of(self, element: str) -> str:
        """Return the key of the file that gives an element."""
        if element == "ascending_node_deg":
            return self.node_key or element
        if element not in ("perigee", "apogee"):
            return element
        radius = f"{element}_radius_m"
        return radius if getattr(self, radius) is not None else f"{element}_altitude_m"

    def _given(self, elements: Iterable[str]) -> list[str]:
        return [name for name in elements if getattr(self, self.key_of(name)) is not None]

    @property
    def keplerian(self) -> bool:
        """Return whether an ellipse is given in full with the place on it free."""
        e = self.eccentricity
        whole = set(self._given(_NAMES)) == _KEPLERIAN and self.argument_of_latitude_deg is None
        return whole and e is not None and e < 1.0

    @model_validator(mode="after")
    def _sense(self) -> "TargetOrbit":
        for one, other in (
            ("perigee_radius_m", "perigee_altitude_m"),
            ("apogee_radius_m", "apogee_altitude_m"),
            ("semi_major_axis_m", "c3_m2_s2"),
            ("at", "true_anomaly_deg"),
        ):
            self.take_one((one, other))
        sizes = [self.key_of(size) for size in self._given(_SIZES)]
        if not set(sizes) - {"eccentricity"}:
            fail(
                ("perigee_radius_m",),
                None,
                "a size of the orbit: perigee or apogee (radius or altitude), semi_major_axis_m "
                "or c3_m2_s2",
            )
        if len(sizes) > 2:
            beside = f"{sizes[0]} and {sizes[1]}"
            fail((sizes[2],), getattr(self, sizes[2]), f"no such key beside {beside}")
        self._check_escape()
        self._check_asymptote()
        self._check_latitude()
        self._check_equatorial()
        return self

    def _check_escape(self) -> None:
        """Report contradictions between energy, eccentricity and apogee."""
        e, axis, energy = self.eccentricity, self.semi_major_axis_m, self.c3_m2_s2
        if axis is not None:
            energy = -axis
            if axis == 0.0:
                fail(("semi_major_axis_m",), axis, "more than 0, or less for a hyperbola")
        if e is not None and energy is not None and not (e - 1.0) * energy > 0.0:
            expected = "less than 1, of an ellipse" if energy < 0.0 else "more than 1, of an escape"
            fail(("eccentricity",), e, expected if energy else "no such key beside c3_m2_s2 0")
        escape = None
        if energy is not None and energy >= 0.0:
            escape = "c3_m2_s2" if axis is None else "semi_major_axis_m"
        elif e is not None and e >= 1.0:
            escape = "eccentricity"
        if escape is None:
            return
        apogee = ("apogee_radius_m", "apogee_altitude_m", *(("at",) if self.at == "apogee" else ()))
        self.refuse(apogee, f"no apogee, because {escape} is that of an escape")

    def _check_asymptote(self) -> None:
        """Report an incomplete asymptote, or one that contradicts the other elements."""
        given = self.given(("dla_deg", "rla_deg"))
        if not given:
            return
        because = "because dla_deg and rla_deg give the node and the argument of perigee"
        if len(given) == 1:
            missing = "rla_deg" if given == ["dla_deg"] else "dla_deg"
            fail((missing,), None, f"a number in deg beside {given[0]}")
        if self.c3_m2_s2 is None or self.c3_m2_s2 <= 0.0:
            fail(("c3_m2_s2",), self.c3_m2_s2, "a number above 0 m2/s2, of an asymptote")
        if not self._given(("perigee",)):
            fail(("perigee_altitude_m",), None, f"a number in m, {because}")
        if self.inclination_deg is None:
            fail(("inclination_deg",), None, f"a number in deg, {because}")
        angles = (self.key_of("ascending_node_deg"), "argument_of_perigee_deg")
        self.refuse(angles, "no such key beside dla_deg and rla_deg")
        assert self.dla_deg is not None
        tilt = min(self.inclination_deg, 180.0 - self.inclination_deg)
        if tilt <= abs(self.dla_deg):
            least = f"more than dla_deg, {abs(self.dla_deg):g} deg"
            expected = f"{least}, from either side of the equator"
            fail(("inclination_deg",), self.inclination_deg, expected)

    def _check_latitude(self) -> None:
        """Report an argument of latitude without exactly one angle to complete it."""
        if self.argument_of_latitude_deg is None:
            return
        beside = self._given(("argument_of_perigee_deg", "at", "true_anomaly_deg"))
        if self.dla_deg is not None:
            beside.append("dla_deg")
        if len(beside) != 1:
            fail(
                ("argument_of_latitude_deg",),
                self.argument_of_latitude_deg,
                "one of argument_of_perigee_deg, at and true_anomaly_deg beside it"
                if not beside
                else f"no such key beside {beside[0]} and {beside[1]}",
            )

    def _check_equatorial(self) -> None:
        """Report a node, or an angle counted from it, of an equatorial orbit."""
        if self.inclination_deg is None or self.keplerian:
            return
        if math.sin(math.radians(self.inclination_deg)) < _FLAT:
            named = ("ascending_node_deg", "argument_of_perigee_deg", "argument_of_latitude_deg")
            self.refuse(map(self.key_of, named), "no such key, the orbit lies in the equator")

    def node_deg(self, mission: "Mission") -> float | None:
        """Return the ascending node from the inertial x axis, deg; None if free."""
        if self.dla_deg is None:
            return super().node_deg(mission)
        return self._departure(mission)[0]

    def _departure(self, mission: "Mission") -> tuple[float, float]:
        """Return node and argument of perigee of the departure hyperbola, deg.

        Of the two planes of this inclination through the asymptote it takes the one nearer to the
        initial plane. Battin, An Introduction to the Mathematics and Methods of Astrodynamics,
        ch. 4.
        """
        assert self.dla_deg is not None and self.rla_deg is not None
        assert self.inclination_deg is not None
        conic = self.conic(mission)
        equinox = _equinox_deg(mission, "rla_deg", self.rla_deg)
        ascension = math.radians(equinox + self.rla_deg)
        tilt = math.radians(self.inclination_deg)
        first = math.asin(math.sin(math.radians(self.dla_deg)) / math.sin(tilt))
        start = mission.start()
        momentum = np.cross(start.position, start.velocity)
        planes = []
        for latitude in (first, math.pi - first):
            along = math.atan2(math.cos(tilt) * math.sin(latitude), math.cos(latitude))
            node = ascension - along
            normal = (
                math.sin(tilt) * math.sin(node),
                -math.sin(tilt) * math.cos(node),
                math.cos(tilt),
            )
            planes.append((float(momentum @ normal), node, latitude))
        _, node, latitude = max(planes)
        perigee = latitude - math.acos(-1.0 / conic.eccentricity)
        return math.degrees(node) % 360.0, math.degrees(perigee) % 360.0

    def _perigee_and_anomaly(self, mission: "Mission") -> tuple[float | None, float | None]:
        """Return argument of perigee and true anomaly of the cut-off, deg; None if free."""
        argument = self.argument_of_perigee_deg
        anomaly = {"perigee": 0.0, "apogee": 180.0, None: self.true_anomaly_deg}[self.at]
        if self.dla_deg is not None:
            argument = self._departure(mission)[1]
        latitude = self.argument_of_latitude_deg
        if latitude is not None and argument is not None:
            anomaly = latitude - argument
        elif latitude is not None and anomaly is not None:
            argument = latitude - anomaly
        return argument, anomaly

    def sizes(self, mission: "Mission") -> dict[str, float]:
        """Return the given elements of size and shape by the fields of TARGET, SI."""
        ground = mission.environment.earth.equatorial_radius_m
        fields = {
            "perigee_radius": self.perigee_radius_m,
            "apogee_radius": self.apogee_radius_m,
            "semi_major_axis": self.semi_major_axis_m,
            "eccentricity": self.eccentricity,
            "c3": self.c3_m2_s2,
        }
        if self.perigee_altitude_m is not None:
            fields["perigee_radius"] = ground + self.perigee_altitude_m
        if self.apogee_altitude_m is not None:
            fields["apogee_radius"] = ground + self.apogee_altitude_m
        return {field: value for field, value in fields.items() if value is not None}

    def conic(self, mission: "Mission") -> Conic:
        """Return the orbit aimed at, completed by :func:`complete`."""
        start = float(np.linalg.norm(mission.start().position))
        return complete(self.sizes(mission), mission.environment.mu_m3_s2, start)

    def circular(self, mission: "Mission") -> bool:
        """Return whether the orbit is a circle; a perigee alone means one."""
        sizes = self.sizes(mission)
        conic = self.conic(mission)
        known = len(sizes) == 2 or "perigee_radius" in sizes
        return known and abs(conic.apogee - conic.perigee) <= CIRCLE_M and not self.keplerian

    def check(self, mission: "Mission") -> None:
        """Report elements that define no orbit, or one below the ground."""
        mu = mission.environment.mu_m3_s2
        ground = mission.environment.earth.equatorial_radius_m
        above = f"above the Earth's radius, {ground:,.0f} m"
        sizes = self.sizes(mission)
        for apsis in self._given(("perigee", "apogee")):
            key = self.key_of(apsis)
            if sizes[f"{apsis}_radius"] <= ground:
                fail(("target", key), getattr(self, key), f"the {apsis} {above}")
        last = self.key_of(self._given(_SIZES)[-1])
        conic = self.conic(mission)
        if conic.apogee < conic.perigee - CIRCLE_M:
            fail(("target", last), getattr(self, last), "an apogee that is not below the perigee")
        if len(sizes) == 2 and not conic.perigee > ground:
            expected = f"a perigee {above}; it is {conic.perigee:,.0f} m"
            fail(("target", last), getattr(self, last), expected)
        if conic.eccentricity > _FASTEST:
            expected = "an escape that is slower at its perigee than twice the escape speed"
            fail(("target", last), getattr(self, last), expected)
        if len(sizes) == 1 and conic.c3 < -mu / ground:
            fail(("target", last), getattr(self, last), f"a semi-major axis {above}")
        self._check_place(mission, conic)

    def _check_place(self, mission: "Mission", conic: Conic) -> None:
        """Report angles from the perigee of a circle, and anomalies beyond the asymptotes."""
        places = ("argument_of_latitude_deg", "true_anomaly_deg", "at")
        if self.circular(mission):
            angles = (*places, "argument_of_perigee_deg")
            self.refuse(angles, "no such key, the orbit is a circle", ("target",))
        _, anomaly = self._perigee_and_anomaly(mission)
        if anomaly is None:
            return
        if 1.0 + conic.eccentricity * math.cos(math.radians(anomaly)) <= 0.0:
            key = self._given(places)[0]
            fail(("target", key), getattr(self, key), "a cut-off inside the asymptotes")

    def write(self, record: NDArray[np.void], mission: "Mission") -> None:
        """Write a record TARGET, except its plane."""
        mu = mission.environment.mu_m3_s2
        argument, anomaly = self._perigee_and_anomaly(mission)
        if argument is not None:
            record["argument_of_perigee"] = math.radians(argument)
        if self.keplerian:
            record["kind"] = layout.TARGET_KEPLERIAN
            record["semi_major_axis"] = self.semi_major_axis_m
            record["eccentricity"] = self.eccentricity
            return
        conic = self.conic(mission)
        named = sum({_NAMES[element] for element in self._given(_NAMES)})
        if self.dla_deg is not None:
            named |= layout.NAMES_ASCENDING_NODE
        if argument is not None:
            named |= layout.NAMES_ARGUMENT_OF_PERIGEE
        record["kind"] = layout.TARGET_ELEMENTS
        record["perigee_radius"] = conic.perigee
        record["apogee_radius"] = conic.apogee
        record["eccentricity"] = conic.eccentricity
        record["c3"] = conic.c3
        record["semi_major_axis"] = -mu / conic.c3 if conic.c3 else math.inf
        if anomaly is not None:
            named |= layout.NAMES_TRUE_ANOMALY
            record["true_anomaly"] = math.radians(anomaly)
        if self.circular(mission):
            record["radius"] = conic.perigee
            record["speed"] = math.sqrt(mu / conic.perigee)
            named &= layout.NAMES_INCLINATION | layout.NAMES_ASCENDING_NODE
            if named & layout.NAMES_INCLINATION:
                record["kind"] = (
                    layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
                    if named & layout.NAMES_ASCENDING_NODE
                    else layout.TARGET_RADIUS_SPEED_ANGLE_INCLINATION
                )
            named |= _NAMES_STATE
        # given elements keep the exact values of the file
        for field, value in self.sizes(mission).items():
            record[field] = value
        record["named"] = named

    def describe(self) -> str:
        """Describe the target in one line."""
        orbit = {
            "perigee_radius_m": "perigee r {:,.0f} m",
            "perigee_altitude_m": "perigee {:,.0f} m",
            "apogee_radius_m": "apogee r {:,.0f} m",
            "apogee_altitude_m": "apogee {:,.0f} m",
            "semi_major_axis_m": "a {:,.0f} m",
            "eccentricity": "e {:g}",
            "c3_m2_s2": "C3 {:,.0f} m2/s2",
            "inclination_deg": "i {:g} deg",
        }
        place = {
            "argument_of_perigee_deg": "argument of perigee {:g} deg",
            "at": "at {}",
            "true_anomaly_deg": "anomaly {:g} deg",
            "argument_of_latitude_deg": "argument of latitude {:g} deg",
            "dla_deg": "asymptote declination {:g} deg",
            "rla_deg": "right ascension {:g} deg",
        }

        def given(texts: Mapping[str, str]) -> list[str]:
            return [texts[key].format(getattr(self, key)) for key in self._given(texts)]

        node = self.describe_node()
        return ", ".join([*given(orbit), *([] if node is None else [node]), *given(place)])


#: What an error message names where there is no target.
EXPECTED_TARGET = (
    "an orbit by its elements, such as perigee_altitude_m, apogee_altitude_m and inclination_deg, "
    "or a point of it by radius_m, speed_m_s, flight_path_angle_deg and inclination_deg"
)
Target = Annotated[
    Annotated[TargetState, Tag("<state>")] | Annotated[TargetOrbit, Tag("<orbit>")],
    Discriminator(
        by_keys({"<state>": TargetState, "<orbit>": TargetOrbit}, None),
        custom_error_type="expected",
        custom_error_message=EXPECTED_TARGET,
    ),
]


def leaves_end_free(target: np.void) -> bool:
    """Return whether a target leaves the place of insertion on a known orbit free.

    If the argument of perigee is given, the direction of the end determines the place. An orbit
    with only one given element of size and shape is not known: there the aim is the perigee of
    :func:`complete`.

    Args:
        target: record TARGET.
    """
    named = int(target["named"])
    placed = named & (
        layout.NAMES_RADIUS | layout.NAMES_ARGUMENT_OF_PERIGEE | layout.NAMES_TRUE_ANOMALY
    )
    sizes = sum(1 for size in _SIZES if named & _NAMES[size])
    return bool(target["kind"] == layout.TARGET_ELEMENTS and sizes == 2 and not placed)


def check_heading(mission: "Mission") -> None:
    """Report a launch heading where not both planes of an inclination pass over the start.

    Raises:
        PydanticCustomError: the node is given, no inclination is, or there is no pad.
    """
    target, path = mission.target, ("target", "launch_heading")
    if target.launch_heading is None:
        return
    if target.node_deg(mission) is not None:
        expected = f"no such key beside {target.node_key or 'dla_deg'}"
        fail(path, target.launch_heading, expected)
    if target.inclination_deg is None:
        fail(("target", "inclination_deg"), None, "a number in deg beside launch_heading")
    if not mission.initial_state.ON_GROUND:
        expected = "no such key: the flight does not begin relative to the ground"
        fail(path, target.launch_heading, expected)


def target_record(mission: "Mission") -> NDArray[np.void]:
    """Compile the target of a mission, shape (1,), dtype TARGET."""
    record = orbit_record(mission.target, mission)
    if mission.abort is not None:
        equatorial = mission.environment.earth.equatorial_radius_m
        record["safe_radius"] = equatorial + mission.abort.safe_perigee_altitude_m
    return record


def parking_orbit(coast: CoastArc) -> TargetOrbit | None:
    """Return the prescribed orbit of a coast, or None."""
    if coast.perigee_altitude_m is None:
        return None
    return TargetOrbit(**{key: getattr(coast, key) for key in ORBIT_KEYS})


def orbit_record(target: Target, mission: "Mission") -> NDArray[np.void]:
    """Compile a target orbit, shape (1,), dtype TARGET."""
    record = np.zeros(1, layout.TARGET)
    if target.inclination_deg is not None:
        record["inclination"] = math.radians(target.inclination_deg)
    node = target.node_deg(mission)
    if node is not None:
        record["ascending_node"] = math.radians(node)
    target.write(record, mission)
    if target.launch_heading is not None:
        record["named"] |= _HEADINGS[target.launch_heading]
    return record
