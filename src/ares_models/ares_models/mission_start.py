# SPDX-License-Identifier: Apache-2.0
"""Initial state of a mission: its six forms, their checks and their conversion.

Three forms are inertial, three are relative to the rotating body.
"""

import math
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from ares_models import mission_keys as allowed
from ares_models.earth import Earth, LaunchAngles
from ares_models.geodesy import earth_fixed_place, inertial_state, velocity_over_ground
from ares_models.mission_keys import Part, added_later, by_keys, fail
from ares_models.orbits import Elements
from ares_models.ranges import Range
from ares_models.tolerances import ROUNDING_M

if TYPE_CHECKING:
    from ares_models.mission import Mission

Array = NDArray[np.float64]

#: Largest initial radius, in equatorial radii.
MAX_INITIAL_RADII = 10.0
#: Speed over the ground below which a flight begins at its launch, m/s.
LAUNCH_M_S = 100.0
#: Least perigee radius of an initial state by elements, m.
LEAST_PERIGEE_M = 1.0

Position = tuple[allowed.Coordinate, allowed.Coordinate, allowed.Coordinate]
Velocity = tuple[allowed.VelocityComponent, allowed.VelocityComponent, allowed.VelocityComponent]
StartAltitude = Annotated[float, Range(0.0, 1e9)]
RailLength = Annotated[float, Range(0.1, 1e3)]
RailElevation = Annotated[float, Range(10.0, 90.0)]


class InitialStatePart(Part):
    """Hold the common part of all forms of an initial state.

    Attributes:
        PLACE: key to name in an error of the position.
        MOTION: key to name in an error of the velocity.
        ON_GROUND: the form is relative to the rotating body.
        AT_REST: it is at rest on the ground.
    """

    PLACE: ClassVar[str]
    MOTION: ClassVar[str]
    ON_GROUND: ClassVar[bool] = False
    AT_REST: ClassVar[bool] = False

    time_s: allowed.MissionTime = Field(description="mission elapsed time")

    @property
    def is_launch(self) -> bool:
        """Return whether the flight begins at its launch: at rest, or off a rail."""
        return False

    @property
    def waits(self) -> bool:
        """Return whether the engines burn before the release, held down or on a rail."""
        return False


class StateVectors(InitialStatePart):
    """Hold an initial state as inertial vectors."""

    PLACE = "position_m"
    MOTION = "velocity_m_s"

    position_m: Position = Field(description="three numbers")
    velocity_m_s: Velocity = Field(description="three numbers")

    def state(self, mu: float, earth: Earth) -> tuple[Array, Array]:
        """Return position (m) and velocity (m/s), each shape (3,)."""
        return np.array(self.position_m), np.array(self.velocity_m_s)


class StateAngles(InitialStatePart):
    """Hold an initial state as place, speed, flight-path angle and azimuth, all inertial."""

    PLACE = "radius_m"
    MOTION = "speed_m_s"

    latitude_deg: allowed.Latitude = Field(description="geocentric")
    right_ascension_deg: allowed.Turn = Field(
        description="from the inertial x axis, not from Greenwich"
    )
    radius_m: allowed.Radius = Field(description="from the centre")
    speed_m_s: allowed.Speed = Field(description="inertial")
    flight_path_angle_deg: allowed.FlightPathAngle = Field(description="of the inertial velocity")
    azimuth_deg: allowed.Turn = Field(description="of the inertial velocity, north to east")

    def state(self, mu: float, earth: Earth) -> tuple[Array, Array]:
        """Return position (m) and velocity (m/s), each shape (3,); Eqs. 2.14 and 2.18."""
        return LaunchAngles(
            radius=self.radius_m,
            latitude=math.radians(self.latitude_deg),
            right_ascension=math.radians(self.right_ascension_deg),
            speed=self.speed_m_s,
            flight_path_angle=math.radians(self.flight_path_angle_deg),
            azimuth=math.radians(self.azimuth_deg),
        ).state()


class StateElements(InitialStatePart):
    """Hold an initial state as Keplerian elements."""

    PLACE = "semi_major_axis_m"
    MOTION = "semi_major_axis_m"

    semi_major_axis_m: allowed.AnySemiMajorAxis = Field(description="negative for a hyperbola")
    eccentricity: allowed.AnyEccentricity = Field(description="not 1")
    inclination_deg: allowed.Inclination = Field(description="to the equator")
    ascending_node_deg: allowed.Turn = Field(description="from the inertial x axis")
    argument_of_perigee_deg: allowed.Turn = Field(description="from the node")
    true_anomaly_deg: allowed.Turn = Field(description="from perigee")

    @model_validator(mode="after")
    def _conic(self) -> "StateElements":
        if self.eccentricity == 1.0:
            fail(("eccentricity",), self.eccentricity, "not exactly 1")
        if self.semi_major_axis_m * (1.0 - self.eccentricity) < LEAST_PERIGEE_M:
            fail(
                ("semi_major_axis_m",),
                self.semi_major_axis_m,
                "more than 0 for an ellipse, less than 0 for a hyperbola, with a perigee at least "
                f"{LEAST_PERIGEE_M:g} m from the centre",
            )
        if 1.0 + self.eccentricity * math.cos(math.radians(self.true_anomaly_deg)) <= 0.0:
            fail(("true_anomaly_deg",), self.true_anomaly_deg, "an anomaly inside the asymptotes")
        return self

    def state(self, mu: float, earth: Earth) -> tuple[Array, Array]:
        """Return position (m) and velocity (m/s), each shape (3,)."""
        return Elements(
            self.semi_major_axis_m,
            self.eccentricity,
            math.radians(self.inclination_deg),
            math.radians(self.ascending_node_deg),
            math.radians(self.argument_of_perigee_deg),
            math.radians(self.true_anomaly_deg),
        ).state(mu)


class Rail(Part):
    """Hold the rail along which a vehicle is launched."""

    length_m: RailLength = Field(description="that the vehicle travels from ignition on")
    elevation_deg: RailElevation = Field(description="above the horizon")
    azimuth_deg: allowed.Turn = Field(description="north to east")


class StateOnPad(InitialStatePart):
    """Hold an initial state at rest on the ground."""

    PLACE = "altitude_m"
    MOTION = "geodetic_latitude_deg"
    ON_GROUND = True
    AT_REST = True

    geodetic_latitude_deg: allowed.Latitude = Field(description="of the normal of the ellipsoid")
    longitude_deg: allowed.Turn = Field(description="from longitude zero, positive to the east")
    altitude_m: StartAltitude = Field(description="above the ellipsoid")
    hold_down_s: allowed.Delay | None = added_later(
        "from ignition until the pad releases the vehicle, which is at time_s"
    )
    rail: Rail | None = added_later(
        "that guides the vehicle, from rest at ignition to its end at time_s"
    )

    @model_validator(mode="after")
    def _one_release(self) -> "StateOnPad":
        if self.rail is not None:
            self.refuse(("hold_down_s",), "none, with a rail")
        return self

    @property
    def is_launch(self) -> bool:
        """Return whether the flight begins at its launch: at rest, or off a rail."""
        return True

    @property
    def waits(self) -> bool:
        """Return whether the engines burn before the release, held down or on a rail."""
        return self.rail is not None or bool(self.hold_down_s)

    def place(self, earth: Earth) -> Array:
        """Return the Earth-fixed position, shape (3,), m."""
        return earth_fixed_place(
            self.geodetic_latitude_deg, self.longitude_deg, self.altitude_m, earth
        )

    def state(self, mu: float, earth: Earth) -> tuple[Array, Array]:
        """Return position (m) and velocity (m/s), each shape (3,): that of the turning ground."""
        return inertial_state(self.time_s, self.place(earth), np.zeros(3), earth)


class StateOverGround(InitialStatePart):
    """Hold an initial state as a geodetic place and a velocity over the ground."""

    PLACE = "altitude_m"
    MOTION = "ground_speed_m_s"
    ON_GROUND = True

    geodetic_latitude_deg: allowed.Latitude = Field(description="of the normal of the ellipsoid")
    longitude_deg: allowed.Turn = Field(description="from longitude zero, positive to the east")
    altitude_m: StartAltitude = Field(description="above the ellipsoid")
    ground_speed_m_s: allowed.Speed = Field(description="relative to the body that turns")
    elevation_deg: allowed.FlightPathAngle = Field(
        description="of that velocity, above the horizon"
    )
    ground_azimuth_deg: allowed.Turn = Field(description="of that velocity, north to east")

    @property
    def is_launch(self) -> bool:
        """Return whether the flight begins at its launch: at rest, or off a rail."""
        return self.ground_speed_m_s < LAUNCH_M_S

    def state(self, mu: float, earth: Earth) -> tuple[Array, Array]:
        """Return position (m) and velocity (m/s), each shape (3,)."""
        place = self.geodetic_latitude_deg, self.longitude_deg
        motion = self.ground_speed_m_s, self.elevation_deg, self.ground_azimuth_deg
        return inertial_state(
            self.time_s,
            earth_fixed_place(*place, self.altitude_m, earth),
            velocity_over_ground(*place, *motion),
            earth,
        )


class StateEarthFixed(InitialStatePart):
    """Hold an initial state as vectors in body-fixed axes."""

    PLACE = "earth_fixed_position_m"
    MOTION = "earth_fixed_velocity_m_s"
    ON_GROUND = True

    earth_fixed_position_m: Position = Field(
        description="three numbers: x through longitude zero, z to the north pole"
    )
    earth_fixed_velocity_m_s: Velocity = Field(
        description="three numbers: relative to the body that turns, in the same axes"
    )

    @property
    def is_launch(self) -> bool:
        """Return whether the flight begins at its launch: at rest, or off a rail."""
        return math.hypot(*self.earth_fixed_velocity_m_s) < LAUNCH_M_S

    def state(self, mu: float, earth: Earth) -> tuple[Array, Array]:
        """Return position (m) and velocity (m/s), each shape (3,)."""
        position = np.array(self.earth_fixed_position_m)
        return inertial_state(self.time_s, position, np.array(self.earth_fixed_velocity_m_s), earth)


FORMS: dict[str, type[InitialStatePart]] = {
    "<vectors>": StateVectors,
    "<angles>": StateAngles,
    "<elements>": StateElements,
    "<pad>": StateOnPad,
    "<over ground>": StateOverGround,
    "<earth-fixed>": StateEarthFixed,
}

#: What an error message names where there is no initial state.
EXPECTED_START = (
    "time_s and one of six forms, such as geodetic_latitude_deg, longitude_deg and altitude_m on "
    "the pad, or position_m and velocity_m_s"
)
InitialState = Annotated[
    Annotated[StateVectors, Tag("<vectors>")]
    | Annotated[StateAngles, Tag("<angles>")]
    | Annotated[StateElements, Tag("<elements>")]
    | Annotated[StateOnPad, Tag("<pad>")]
    | Annotated[StateOverGround, Tag("<over ground>")]
    | Annotated[StateEarthFixed, Tag("<earth-fixed>")],
    Discriminator(
        by_keys(FORMS, None), custom_error_type="expected", custom_error_message=EXPECTED_START
    ),
]


def check_initial_state(mission: "Mission") -> None:
    """Check that the start is above the ground, not too far out, not too fast, not vertical.

    Raises:
        PydanticCustomError: a value is out of bounds.
    """
    form = mission.initial_state
    if form.ON_GROUND and mission.zero_longitude_deg is None:
        expected = "a number, or an epoch on the Earth"
        path = ("environment", "earth", "zero_longitude_deg")
        fail(path, None, f"{expected}, because initial_state is relative to the ground")
    start = mission.start()
    earth = mission.earth()
    radius = math.hypot(*start.position)
    surface = earth.equatorial_radius
    farthest = MAX_INITIAL_RADII * surface
    if mission.environment.altitude == "ellipsoid" and radius > 0.0:
        latitude, _ = earth.latitude_longitude(start.position, 0.0)
        surface = earth.surface_radius(latitude)
    surface += -ROUNDING_M if form.AT_REST else ROUNDING_M
    if not surface < radius < farthest:
        fail(
            ("initial_state", form.PLACE),
            getattr(form, form.PLACE),
            f"a place above the surface, {surface:,.0f} m from the centre there, and below "
            f"{farthest:,.0f} m; it is {radius:,.0f} m from the centre",
        )
    speed = math.hypot(*start.velocity)
    escape = math.sqrt(2.0 * mission.environment.mu_m3_s2 / radius)
    if speed >= 2.0 * escape:
        fail(
            ("initial_state", form.MOTION),
            getattr(form, form.MOTION),
            f"an inertial speed below twice the escape speed, {2.0 * escape:,.0f} m/s; it is "
            f"{speed:,.0f} m/s",
        )
    momentum = float(np.linalg.norm(np.cross(start.position, start.velocity)))
    if not momentum > 0.0:
        expected = "a velocity that is not straight up, so that it spans a plane"
        fail(("initial_state",), start.velocity.tolist(), expected)
