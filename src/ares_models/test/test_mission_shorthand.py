# SPDX-License-Identifier: Apache-2.0
"""Short forms in a mission file: the Earth, a sun-synchronous orbit, a launch heading."""

from copy import deepcopy
from datetime import UTC, datetime

import pytest
import yaml

from ares_models import arrays as layout
from ares_models.input_file import read_input
from ares_models.mission import MISSION, TEMPLATE, MissionError, parse_mission
from ares_models.sidereal import greenwich_sidereal_time_deg

TEMPLATE_DATA = read_input(TEMPLATE, MISSION)[0]
#: WGS 84, as published.
WGS84 = {
    "mu_m3_s2": 3.986004418e14,
    "j2": 1.08262982e-3,
    "earth": {
        "equatorial_radius_m": 6378137.0,
        "polar_radius_m": 6356752.3142,
        "rotation_rate_rad_s": 7.292115e-5,
        "zero_longitude_deg": 0.0,
    },
    "atmosphere": {"model": "us76"},
}


def parsed(**blocks):
    """Parse the template with other blocks; None: without the block."""
    data = {
        key: value for key, value in (deepcopy(TEMPLATE_DATA) | blocks).items() if value is not None
    }
    return parse_mission(yaml.safe_dump(data), "my.yaml")


def target(**keys):
    keys = {key: value for key, value in keys.items() if value is not None}
    return {"target": keys}


def test_a_file_without_a_body_flies_on_the_earth():
    assert parsed(environment=None) == parsed(environment=WGS84)


def test_what_the_file_says_of_the_air_stays():
    wind = {"model": "us76", "wind_table": [[0.0, 3.0, -2.0], [9000.0, 30.0, 0.0]]}
    short = parsed(environment={"atmosphere": wind})
    assert short == parsed(environment=WGS84 | {"atmosphere": wind})


def test_an_epoch_places_longitude_zero():
    mission = parsed(environment=None, epoch="2026-03-20T12:00:00Z")
    expected = greenwich_sidereal_time_deg(datetime(2026, 3, 20, 12, tzinfo=UTC))
    assert mission.zero_longitude_deg == expected


@pytest.mark.parametrize("missing", ["mu_m3_s2", "earth", "atmosphere"])
def test_a_body_of_ones_own_is_whole(missing):
    environment = {key: value for key, value in WGS84.items() if key != missing}
    with pytest.raises(MissionError, match=rf"environment\.{missing} is missing"):
        parsed(environment=environment)


@pytest.mark.parametrize(
    ("perigee_km", "apogee_km", "published_deg"),
    [
        (705.0, 705.0, 98.2),  # Landsat 8
        (786.0, 786.0, 98.6),  # Sentinel-2
        (500.0, 500.0, 97.4),
        (1000.0, 1000.0, 99.5),
    ],
)
def test_a_sun_synchronous_orbit_has_the_published_inclination(
    perigee_km, apogee_km, published_deg
):
    mission = parsed(
        environment=None,
        **target(
            perigee_altitude_m=1e3 * perigee_km,
            apogee_altitude_m=1e3 * apogee_km,
            inclination_deg="sun_synchronous",
        ),
    )
    assert mission.target.inclination_deg == pytest.approx(published_deg, abs=0.06)


@pytest.mark.parametrize(
    ("keys", "environment", "expected"),
    [
        (
            {"perigee_altitude_m": 7e6, "apogee_altitude_m": 7e6},
            None,
            "'sun_synchronous'; expected a number in deg, because the node of so high an orbit",
        ),
        (
            {"perigee_altitude_m": 5e5, "apogee_altitude_m": 5e5},
            WGS84 | {"j2": 0.0},
            "expected a number in deg, because j2 is 0",
        ),
        (
            {"perigee_altitude_m": 5e5},
            None,
            "expected a number in deg, because size and shape of the orbit are not both named",
        ),
        (
            {"perigee_altitude_m": 5e5, "c3_m2_s2": 1e6},
            None,
            "expected a number in deg, because the orbit is an escape",
        ),
    ],
)
def test_an_orbit_that_cannot_be_sun_synchronous_is_refused(keys, environment, expected):
    with pytest.raises(MissionError) as refused:
        parsed(environment=environment, **target(**keys, inclination_deg="sun_synchronous"))
    assert "target.inclination_deg is " in str(refused.value)
    assert expected in str(refused.value)


def test_a_state_names_no_size_of_a_sun_synchronous_orbit():
    state = {"radius_m": 6.9e6, "speed_m_s": 7600.0, "flight_path_angle_deg": 0.0}
    with pytest.raises(MissionError, match=r"inclination_deg is 'sun_synchronous'; expected a num"):
        parsed(**target(**state, inclination_deg="sun_synchronous"))


def test_another_word_is_told_the_right_one():
    with pytest.raises(MissionError, match="or the word sun_synchronous"):
        parsed(**target(perigee_altitude_m=5e5, apogee_altitude_m=5e5, inclination_deg="sso"))


@pytest.mark.parametrize(
    ("heading", "bit"), [("north", layout.HEADS_NORTH), ("south", layout.HEADS_SOUTH)]
)
def test_a_heading_is_in_the_record_of_the_target(heading, bit):
    for apogee_m in (3e5, 9e5):
        mission = parsed(
            **target(
                perigee_altitude_m=3e5,
                apogee_altitude_m=apogee_m,
                inclination_deg=97.0,
                launch_heading=heading,
            )
        )
        assert mission.arrays().target["named"][0] & layout.HEADINGS == bit
        assert mission.target.describe().endswith(f"i 97 deg, launch to the {heading}")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            {"inclination_deg": 97.0, "ascending_node_deg": 10.0},
            "target.launch_heading is 'south'; expected no such key beside ascending_node_deg",
        ),
        ({}, "target.inclination_deg is missing; expected a number in deg beside launch_heading"),
    ],
)
def test_a_heading_needs_two_planes_of_an_inclination(keys, said):
    with pytest.raises(MissionError) as refused:
        parsed(**target(perigee_altitude_m=3e5, launch_heading="south", **keys))
    assert said in str(refused.value)


def test_a_heading_needs_a_pad():
    data = read_input(MISSION.find("ares_v"), MISSION)[0]
    data["target"]["launch_heading"] = "south"
    with pytest.raises(MissionError, match="does not begin relative to the ground"):
        parse_mission(yaml.safe_dump(data), "my.yaml")
