# SPDX-License-Identifier: Apache-2.0
"""Initial states of missions: five forms of one state, the ground they are relative to."""

import math

import numpy as np
import pytest
import yaml

from ares_models.earth import LaunchAngles
from ares_models.frames import earth_fixed_from_inertial
from ares_models.geodesy import geodetic
from ares_models.input_file import read_input
from ares_models.kernels.environment import relative_velocity
from ares_models.mission import MISSION, MissionError, load_mission
from ares_models.orbits import Elements
from ares_models.sidereal import greenwich_sidereal_time_deg

EPOCH = "2026-01-01T06:00:00Z"


def started(tmp_path, state, epoch=None, zero_longitude_deg=None, rotation_rate=7.2921159e-5):
    """Load Ares V with another initial state, epoch, longitude zero or rotation rate."""
    data, _ = read_input(MISSION.find("ares_v"), MISSION)
    data["initial_state"] = {"time_s": 155.9, **state}
    earth = data["environment"]["earth"]
    del earth["zero_longitude_deg"], data["abort"]
    earth["rotation_rate_rad_s"] = rotation_rate
    # any plane will do
    data["target"] = {"perigee_altitude_m": 2e5}
    if zero_longitude_deg is not None:
        earth["zero_longitude_deg"] = zero_longitude_deg
    if epoch is not None:
        data["epoch"] = epoch
    path = tmp_path / "started.yaml"
    path.write_text(yaml.safe_dump(data))
    return load_mission(path)


def forms(start, earth, mu):
    """Return a state in each form of a file, by the inverse conversion of each."""
    orbit = Elements.from_state(start.position, start.velocity, mu)
    angles = LaunchAngles.from_state(start.position, start.velocity)
    environment = load_mission("ares_v").environment_array()[0]
    relative = relative_velocity(tuple(start.position), tuple(start.velocity), environment)
    turn = earth_fixed_from_inertial(start.time_s, earth.rotation_rate, earth.angle_at_zero)
    fixed, over_ground = turn @ start.position, turn @ np.array(relative)
    place = geodetic(np.array([start.time_s]), start.position[None], earth)
    latitude, longitude = math.radians(place.latitude_deg[0]), math.radians(place.longitude_deg[0])
    up = np.array(
        [
            math.cos(latitude) * math.cos(longitude),
            math.cos(latitude) * math.sin(longitude),
            math.sin(latitude),
        ]
    )
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    speed = float(np.linalg.norm(over_ground))
    return {
        "elements": {
            "semi_major_axis_m": orbit.semi_major_axis,
            "eccentricity": orbit.eccentricity,
            "inclination_deg": math.degrees(orbit.inclination),
            "ascending_node_deg": math.degrees(orbit.ascending_node),
            "argument_of_perigee_deg": math.degrees(orbit.argument_of_perigee),
            "true_anomaly_deg": math.degrees(orbit.true_anomaly),
        },
        "angles": {
            "latitude_deg": math.degrees(angles.latitude),
            "right_ascension_deg": math.degrees(angles.right_ascension),
            "radius_m": angles.radius,
            "speed_m_s": angles.speed,
            "flight_path_angle_deg": math.degrees(angles.flight_path_angle),
            "azimuth_deg": math.degrees(angles.azimuth),
        },
        "over ground": {
            "geodetic_latitude_deg": float(place.latitude_deg[0]),
            "longitude_deg": float(place.longitude_deg[0]),
            "altitude_m": float(place.height_m[0]),
            "ground_speed_m_s": speed,
            "elevation_deg": math.degrees(math.asin(over_ground @ up / speed)),
            "ground_azimuth_deg": math.degrees(
                math.atan2(over_ground @ east, over_ground @ np.cross(up, east))
            ),
        },
        "Earth-fixed": {
            "earth_fixed_position_m": fixed.tolist(),
            "earth_fixed_velocity_m_s": over_ground.tolist(),
        },
    }


@pytest.mark.parametrize("form", ["elements", "angles", "over ground", "Earth-fixed"])
def test_an_initial_state_in_five_forms_is_one(tmp_path, form):
    mission = load_mission("ares_v")
    vectors = mission.start()
    state = forms(vectors, mission.earth(), 3.986e14)[form]
    start = started(tmp_path, state, zero_longitude_deg=-79.393).start()
    assert start.time_s == vectors.time_s
    assert np.allclose(start.position, vectors.position, rtol=0.0, atol=1e-3)
    assert np.allclose(start.velocity, vectors.velocity, rtol=0.0, atol=1e-6)


OVER_GROUND = {
    "geodetic_latitude_deg": 0.0,
    "longitude_deg": 30.0,
    "altitude_m": 60e3,
    "ground_speed_m_s": 1000.0,
    "elevation_deg": 0.0,
    "ground_azimuth_deg": 90.0,
}


def test_the_ground_carries_who_starts_from_it(tmp_path):
    """The ground's own speed adds to the start's, eastwards on the equator."""
    start = started(tmp_path, OVER_GROUND, zero_longitude_deg=10.0).start()
    radius = 6_378_140.0 + 60e3
    angle = math.radians(40.0) + 7.2921159e-5 * 155.9
    up, east = [math.cos(angle), math.sin(angle), 0.0], [-math.sin(angle), math.cos(angle), 0.0]
    assert start.position == pytest.approx(radius * np.array(up), abs=1e-6)
    speed = 1000.0 + 7.2921159e-5 * radius
    assert start.velocity == pytest.approx(speed * np.array(east), abs=1e-9)


def test_the_frame_follows_from_the_epoch(tmp_path):
    mission = started(tmp_path, OVER_GROUND, epoch=EPOCH)
    angle = greenwich_sidereal_time_deg(mission.epoch)
    given = started(tmp_path, OVER_GROUND, zero_longitude_deg=angle)
    assert mission.start().position == pytest.approx(given.start().position, abs=1e-6)
    assert mission.start().velocity == pytest.approx(given.start().velocity, abs=1e-9)
    zero = mission.environment_array()["zero_longitude"]
    assert zero == pytest.approx(math.radians(angle))
    # a given longitude zero defines another frame
    both = started(tmp_path, OVER_GROUND, epoch=EPOCH, zero_longitude_deg=0.0)
    assert both.zero_longitude_deg == 0.0


@pytest.mark.parametrize(
    ("frame", "change", "said"),
    [
        (
            {},
            {},
            (
                "environment.earth.zero_longitude_deg is missing; expected a number, or an epoch "
                "on the Earth, because initial_state is relative to the ground"
            ),
        ),
        # an epoch does not orient Mars
        (
            {"epoch": EPOCH, "rotation_rate": 7.0882e-5},
            {},
            "environment.earth.zero_longitude_deg is missing; expected a number, or an epoch",
        ),
        (
            {"epoch": EPOCH},
            {"altitude_m": 0.0},
            (
                "initial_state.altitude_m is 0.0; expected a place above the surface, 6,378,140 m "
                "from the centre there, and below 63,781,400 m; it is 6,378,140 m from the centre"
            ),
        ),
        (
            {"epoch": EPOCH},
            {"ground_speed_m_s": 1e6},
            (
                "initial_state.ground_speed_m_s is 1000000.0; expected an inertial speed below "
                "twice the escape speed, 22,255 m/s; it is 1,000,469 m/s"
            ),
        ),
        (
            {"epoch": EPOCH},
            {"azimuth_deg": 0.0},
            (
                "initial_state.azimuth_deg is not a known key (its value is 0.0); did you mean "
                "ground_azimuth_deg?"
            ),
        ),
    ],
)
def test_a_start_from_the_ground_that_is_wrong(tmp_path, frame, change, said):
    with pytest.raises(MissionError) as caught:
        started(tmp_path, OVER_GROUND | change, **frame)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
