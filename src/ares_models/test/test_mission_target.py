# SPDX-License-Identifier: Apache-2.0
"""Targets by elements: allowed keys, the resulting orbits, refused values."""

import json
import math
import re
from datetime import UTC, datetime
from importlib import resources

import numpy as np
import pytest

from ares_models import arrays as layout
from ares_models.kernels.targets import desired_state, plane_normal, size_and_shape, target_speed
from ares_models.mission import MissionError, load_mission
from ares_models.mission_target import TargetOrbit
from ares_models.orbits import Elements, Insertion
from ares_models.sidereal import greenwich_sidereal_time_deg

MU = 3.986e14
EQUATOR = 6378140.0
PERIGEE, APOGEE = EQUATOR + 185e3, EQUATOR + 35786e3
SHIPPED = load_mission("ares_v")
START = math.sqrt(sum(x * x for x in SHIPPED.initial_state.position_m))


@pytest.fixture
def aimed(tmp_path):
    """Write a mission file with another target."""
    text = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()

    def load(**target):
        path = tmp_path / "aimed.yaml"
        path.write_text(f"{text[: text.index('target:')]}target: {json.dumps(target)}\n")
        return load_mission(path)

    return load


@pytest.mark.parametrize(
    ("sizes", "perigee", "c3"),
    [
        ({"perigee_radius_m": PERIGEE, "apogee_radius_m": APOGEE}, PERIGEE, -16360445.319),
        ({"perigee_altitude_m": 185e3, "apogee_altitude_m": 35786e3}, PERIGEE, -16360445.319),
        ({"perigee_altitude_m": 185e3, "semi_major_axis_m": 24363640.0}, PERIGEE, -16360445.319),
        ({"apogee_altitude_m": 35786e3, "c3_m2_s2": -16360445.3193363}, PERIGEE, -16360445.319),
        ({"perigee_altitude_m": 185e3, "eccentricity": 0.5}, PERIGEE, -0.5 * MU / PERIGEE),
        ({"apogee_altitude_m": 35786e3, "eccentricity": 0.5}, APOGEE / 3, -1.5 * MU / APOGEE),
        ({"semi_major_axis_m": 2e7, "eccentricity": 0.5}, 1e7, -MU / 2e7),
        ({"semi_major_axis_m": -2e8, "eccentricity": 1.05}, 1e7, MU / 2e8),
        ({"c3_m2_s2": 1e6, "eccentricity": 1.02}, 0.02 * MU / 1e6, 1e6),
        ({"perigee_altitude_m": 185e3, "c3_m2_s2": 0.0}, PERIGEE, 0.0),
    ],
)
def test_two_sizes_are_an_orbit(aimed, sizes, perigee, c3):
    target = aimed(**sizes, inclination_deg=28.5).arrays().target[0]
    assert target["kind"] == layout.TARGET_ELEMENTS
    assert target["perigee_radius"] == pytest.approx(perigee, rel=1e-9)
    assert target["c3"] == pytest.approx(c3, rel=1e-9, abs=1e-6)
    assert size_and_shape(target, MU) == pytest.approx((perigee, c3)[::-1], rel=1e-9, abs=1e-6)
    e = float(target["eccentricity"])
    assert e == pytest.approx(1.0 + perigee * c3 / MU, rel=1e-9)
    if e < 1.0:
        assert target["apogee_radius"] == pytest.approx(perigee * (1 + e) / (1 - e), rel=1e-9)
    else:
        assert math.isinf(target["apogee_radius"])
    named = {
        "perigee": layout.NAMES_PERIGEE,
        "apogee": layout.NAMES_APOGEE,
        "semi": layout.NAMES_SEMI_MAJOR_AXIS,
        "eccentricity": layout.NAMES_ECCENTRICITY,
        "c3": layout.NAMES_C3,
    }
    names = sum(bit for key, bit in named.items() if any(size.startswith(key) for size in sizes))
    assert target["named"] == names | layout.NAMES_INCLINATION


def test_all_five_and_no_place_are_the_old_target(aimed):
    five = {
        "semi_major_axis_m": 24361140.0,
        "eccentricity": 0.7308,
        "inclination_deg": 28.5,
        "ascending_node_deg": 114.0,
        "argument_of_perigee_deg": 130.5,
    }
    old = aimed(**five).arrays().target[0]
    assert old["kind"] == layout.TARGET_KEPLERIAN
    assert old["named"] == 0
    for less in five:
        if less != "semi_major_axis_m":
            some = {key: value for key, value in five.items() if key != less}
            assert aimed(**some).arrays().target[0]["kind"] == layout.TARGET_ELEMENTS
    assert aimed(**five, at="perigee").arrays().target[0]["kind"] == layout.TARGET_ELEMENTS


def test_a_circle_is_a_state(aimed):
    for circle in (
        {"perigee_altitude_m": 185e3, "apogee_radius_m": PERIGEE},
        {"perigee_altitude_m": 185e3},
        {"semi_major_axis_m": PERIGEE, "eccentricity": 0.0},
        {"semi_major_axis_m": PERIGEE, "perigee_altitude_m": 185e3},
        {"c3_m2_s2": -MU / PERIGEE, "perigee_altitude_m": 185e3},
        {"perigee_altitude_m": 185e3, "apogee_altitude_m": 184999.5},
    ):
        target = aimed(**circle, inclination_deg=28.5).arrays().target[0]
        assert target["kind"] == layout.TARGET_RADIUS_SPEED_ANGLE_INCLINATION
        assert target["radius"] == PERIGEE
        assert target["speed"] == pytest.approx(math.sqrt(MU / PERIGEE), rel=1e-15)
        assert target["flight_path_angle"] == 0.0
        node = {"inclination_deg": 28.5, "ascending_node_deg": 114.0}
        named = aimed(**circle, **node).arrays().target[0]
        assert named["kind"] == layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
        free = aimed(**circle).arrays().target[0]
        assert free["kind"] == layout.TARGET_ELEMENTS
        state = layout.NAMES_RADIUS | layout.NAMES_SPEED | layout.NAMES_FLIGHT_PATH_ANGLE
        assert free["named"] == state


def test_a_lone_size_is_completed_from_the_start(aimed):
    apogee = aimed(apogee_altitude_m=400e3).arrays().target[0]
    assert apogee["perigee_radius"] == pytest.approx(START)
    assert apogee["apogee_radius"] == EQUATOR + 400e3
    escape = aimed(c3_m2_s2=1e6).arrays().target[0]
    assert escape["perigee_radius"] == pytest.approx(START)
    assert escape["eccentricity"] == pytest.approx(1.0 + START * 1e6 / MU)


GTO = {"perigee_altitude_m": 185e3, "apogee_altitude_m": 35786e3}
REFUSED = [
    ({**GTO, "perigee_radius_m": PERIGEE}, "perigee_altitude_m", "no such key beside perigee_rad"),
    ({**GTO, "apogee_radius_m": APOGEE}, "apogee_altitude_m", "no such key beside apogee_radius"),
    ({**GTO, "eccentricity": 0.7}, "eccentricity", "beside perigee_altitude_m and apogee_alti"),
    ({**GTO, "c3_m2_s2": -1e7}, "c3_m2_s2", "beside perigee_altitude_m and apogee_altitude_m"),
    ({"semi_major_axis_m": 7e6, "c3_m2_s2": -5e7}, "c3_m2_s2", "beside semi_major_axis_m"),
    ({**GTO, "at": "perigee", "true_anomaly_deg": 3.0}, "true_anomaly_deg", "beside at"),
    ({**GTO, "at": "the node"}, "at", "expected one of 'perigee'"),
    ({"eccentricity": 0.1}, "perigee_radius_m", "is missing; expected a size of the orbit"),
    ({"at": "perigee"}, "perigee_radius_m", "is missing; expected a size of the orbit"),
    ({"perigee_altitude_m": 4e5, "apogee_altitude_m": 3e5}, "apogee_altitude_m", "not below the"),
    ({"perigee_altitude_m": 4e5, "semi_major_axis_m": 6.5e6}, "semi_major_axis_m", "not below"),
    ({"perigee_radius_m": 6.3e6}, "perigee_radius_m", "the perigee above the Earth's radius"),
    ({"apogee_radius_m": 6.3e6}, "apogee_radius_m", "the apogee above the Earth's radius"),
    ({"perigee_altitude_m": 0.0}, "perigee_altitude_m", "the perigee above the Earth's radius"),
    ({"semi_major_axis_m": 7e6, "eccentricity": 0.2}, "eccentricity", "it is 5,600,000 m"),
    ({"apogee_altitude_m": 3e5, "eccentricity": 0.2}, "eccentricity", "it is 4,452,093 m"),
    ({"semi_major_axis_m": 6e6}, "semi_major_axis_m", "a semi-major axis above the Earth's"),
    ({"c3_m2_s2": -1e8}, "c3_m2_s2", "a semi-major axis above the Earth's radius"),
    ({"apogee_altitude_m": 3e5, "c3_m2_s2": 0.0}, "apogee_altitude_m", "no apogee, because c3_m"),
    ({"apogee_altitude_m": 3e5, "eccentricity": 1.2}, "apogee_altitude_m", "because eccentricity"),
    ({"c3_m2_s2": 10.0, "at": "apogee"}, "at", "no apogee, because c3_m2_s2 is that of an escape"),
    ({"semi_major_axis_m": 7e6, "eccentricity": 1.2}, "eccentricity", "less than 1, of an ellipse"),
    ({"c3_m2_s2": 1e6, "eccentricity": 0.2}, "eccentricity", "more than 1, of an escape"),
    ({"c3_m2_s2": 0.0, "eccentricity": 1.0}, "eccentricity", "no such key beside c3_m2_s2 0"),
    ({"c3_m2_s2": 1e11}, "c3_m2_s2", "expected a number from -1e10 to 1e10 in m2/s2"),
    ({"perigee_altitude_m": 2e5, "c3_m2_s2": 4e8}, "c3_m2_s2", "than twice the escape speed"),
    ({"perigee_altitude_m": 2e5, "eccentricity": 7.1}, "eccentricity", "an escape that is slower"),
    ({"semi_major_axis_m": 0.0}, "semi_major_axis_m", "more than 0, or less for a hyperbola"),
    (
        {"perigee_altitude_m": 2e5, "argument_of_perigee_deg": 3.0},
        "argument_of_perigee_deg",
        "circ",
    ),
    (
        {"perigee_altitude_m": 2e5, "apogee_altitude_m": 2e5, "at": "perigee"},
        "at",
        "the orbit is a circle",
    ),
    (
        {"perigee_altitude_m": 2e5, "eccentricity": 1.5, "true_anomaly_deg": 170.0},
        "true_anomaly_deg",
        "inside the asymptotes",
    ),
    ({"radius_m": 6.5e6, **GTO}, "radius_m", "is not a known key"),
    ({**GTO, "perigee_alitude_m": 3.0}, "perigee_alitude_m", "did you mean perigee_altitude_m?"),
]


@pytest.mark.parametrize(("target", "key", "words"), REFUSED)
def test_what_makes_no_sense_is_refused_by_its_key(aimed, target, key, words):
    with pytest.raises(MissionError) as caught:
        aimed(**target)
    text = str(caught.value)
    assert "\n" not in text
    assert re.search(rf"aimed\.yaml: (line \d+: )?target\.{key} ", text), text
    assert words in text


@pytest.mark.parametrize("key", ["ascending_node_deg", "argument_of_perigee_deg"])
def test_an_equatorial_orbit_has_no_node_to_count_from(key):
    with pytest.raises(ValueError, match="the orbit lies in the equator"):
        TargetOrbit(**GTO, inclination_deg=0.0, **{key: 10.0})


def test_what_is_aimed_at_lies_on_the_orbit(aimed):
    radial, normal = (0.0, 0.6, 0.8), (1.0, 0.0, 0.0)
    for place, anomaly in (
        ({}, 0.0),
        ({"at": "apogee"}, math.pi),
        ({"true_anomaly_deg": 40.0}, math.radians(40.0)),
    ):
        target = aimed(**GTO, **place).arrays().target[0]
        r, v, _ = (np.array(x) for x in desired_state(target, MU, radial, normal))
        found = Elements.from_state(r, v, MU)
        assert found.perigee_radius == pytest.approx(PERIGEE, rel=1e-9)
        assert found.apogee_radius == pytest.approx(APOGEE, rel=1e-9)
        assert math.cos(found.true_anomaly - anomaly) == pytest.approx(1.0, abs=1e-12)
        assert target_speed(target, MU, float(np.linalg.norm(r))) == pytest.approx(
            float(np.linalg.norm(v)), rel=1e-9
        )


def test_a_named_argument_of_perigee_tells_the_anomaly(aimed):
    target = aimed(**GTO, inclination_deg=28.5, argument_of_perigee_deg=150.0).arrays().target[0]
    node, i = math.radians(110.0), math.radians(28.5)
    normal = (math.sin(i) * math.sin(node), -math.sin(i) * math.cos(node), math.cos(i))
    towards = np.array([math.cos(node), math.sin(node), 0.0])
    ahead = np.cross(normal, towards)
    u = math.radians(120.0)
    radial = tuple((math.cos(u) * towards + math.sin(u) * ahead).tolist())
    r, v, _ = desired_state(target, MU, radial, normal)
    found = Elements.from_state(r, v, MU)
    assert math.degrees(found.argument_of_perigee) == pytest.approx(150.0, abs=1e-9)
    assert math.degrees(found.true_anomaly) == pytest.approx(-30.0, abs=1e-9)


def test_a_free_plane_is_that_of_the_motion(aimed):
    r, h = (6.5e6, 1e5, 2e5), (-1e10, 2e10, 4e10)
    along = np.array(h) / np.linalg.norm(h)
    free = aimed(**GTO).arrays().target[0]
    normal, reachable = plane_normal(free, r, h)
    assert reachable
    assert normal == pytest.approx(tuple(along))
    for sign in (1.0, -1.0):
        node = aimed(**GTO, ascending_node_deg=114.0).arrays().target[0]
        normal, _ = plane_normal(node, r, tuple(sign * x for x in h))
        assert np.dot(normal, r) == pytest.approx(0.0, abs=1e-6)
        line = (math.cos(math.radians(114.0)), math.sin(math.radians(114.0)), 0.0)
        assert np.dot(normal, line) == pytest.approx(0.0, abs=1e-12)
        assert sign * np.dot(normal, h) > 0.0


# ---- node from the equinox, cut-off by argument of latitude, departure by asymptote

EPOCH = datetime(2026, 1, 1, 12, tzinfo=UTC)
SIZES = {"perigee_altitude_m": 185e3, "apogee_altitude_m": 1e6, "inclination_deg": 28.5}
STATE = {
    "radius_m": 6518889.0,
    "speed_m_s": 7840.675,
    "flight_path_angle_deg": 1.0,
    "inclination_deg": 28.5,
}


@pytest.fixture
def dated(tmp_path):
    """Load a mission with an epoch and another target, with or without longitude zero."""
    text = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()

    def load(target, zero=True, epoch=EPOCH, rate="7.2921159e-5"):
        content = text[: text.index("jettisons:")]
        content = content.replace("7.2921159e-5", rate)
        if not zero:
            content = content.replace("    zero_longitude_deg", "    # zero_longitude_deg")
        if epoch is not None:
            content += f"epoch: {json.dumps(epoch.isoformat())}\n"
        path = tmp_path / "dated.yaml"
        path.write_text(f"{content}target: {json.dumps(target)}\n")
        return load_mission(path)

    return load


@pytest.mark.parametrize("form", [STATE, SIZES])
def test_a_raan_is_from_the_equinox_wherever_the_x_axis_is(dated, form):
    """Seen from the ground the node is in one place: RAAN less sidereal time."""
    mission = dated(form | {"raan_deg": 114.64})
    node = math.degrees(mission.arrays().target[0]["ascending_node"])
    longitude = node - mission.zero_longitude_deg
    apart = longitude - (114.64 - greenwich_sidereal_time_deg(EPOCH))
    assert math.remainder(apart, 360.0) == pytest.approx(0.0, abs=1e-9)
    # where the frame is that of the epoch it is the node itself
    start = Insertion.from_state(SHIPPED.start().position, SHIPPED.start().velocity)
    named = math.degrees(start.ascending_node)
    mission = dated(form | {"raan_deg": named}, zero=False)
    node = math.degrees(mission.arrays().target[0]["ascending_node"])
    assert node == pytest.approx(named, abs=1e-12)


def test_a_local_time_is_where_the_sun_says(dated):
    """At noon of Greenwich longitude zero has noon: 15 deg farther east it is an hour later."""
    target = STATE | {"local_time_of_node_h": 0.899}
    mission = dated(target)
    node = math.degrees(mission.arrays().target[0]["ascending_node"])
    longitude = node - mission.zero_longitude_deg
    apart = longitude - 15.0 * (0.899 - 12.0)
    assert math.remainder(apart, 360.0) == pytest.approx(0.0, abs=1e-9)
    assert "node at 0.899 h local time" in mission.target.describe()


@pytest.mark.parametrize(
    ("beside", "argument", "anomaly"),
    [
        ({"argument_of_perigee_deg": 130.0}, 130.0, 20.0),
        ({"at": "perigee"}, 150.0, 0.0),
        ({"at": "apogee"}, -30.0, 180.0),
        ({"true_anomaly_deg": 5.0}, 145.0, 5.0),
    ],
)
def test_an_argument_of_latitude_is_perigee_and_anomaly_together(aimed, beside, argument, anomaly):
    target = aimed(**SIZES, **beside, argument_of_latitude_deg=150.0).arrays().target[0]
    assert target["named"] & layout.NAMES_ARGUMENT_OF_PERIGEE
    assert target["named"] & layout.NAMES_TRUE_ANOMALY
    assert math.degrees(target["argument_of_perigee"]) == pytest.approx(argument)
    assert math.degrees(target["true_anomaly"]) == pytest.approx(anomaly)


ASYMPTOTE = {
    "perigee_altitude_m": 185e3,
    "c3_m2_s2": 1.2e7,
    "inclination_deg": 28.5,
    "dla_deg": 5.0,
    "rla_deg": 124.0,
}


@pytest.mark.parametrize(
    ("declination", "ascension"),
    [(-20.0, 80.0), (0.0, 115.0), (5.0, 124.0), (5.0, 285.0), (28, 195)],
)
def test_whoever_leaves_along_the_hyperbola_goes_where_the_asymptote_points(
    dated, declination, ascension
):
    mission = dated(ASYMPTOTE | {"dla_deg": declination, "rla_deg": ascension})
    target = mission.arrays().target[0]
    e = float(target["eccentricity"])
    assert e == pytest.approx(1.0 + 1.2e7 * PERIGEE / MU)
    # far out, by Keplerian elements alone: both position and velocity point there
    orbit = Elements(
        PERIGEE / (1.0 - e),
        e,
        float(target["inclination"]),
        float(target["ascending_node"]),
        float(target["argument_of_perigee"]),
        math.acos(-1.0 / e) - 1e-9,
    )
    position, velocity = orbit.state(MU)
    assert velocity @ velocity == pytest.approx(1.2e7, rel=1e-6)
    equinox = mission.zero_longitude_deg - greenwich_sidereal_time_deg(EPOCH)
    for vector in (position, velocity):
        x, y, z = vector / np.linalg.norm(vector)
        assert math.degrees(math.asin(z)) == pytest.approx(declination, abs=1e-4)
        found = math.degrees(math.atan2(y, x)) - equinox
        assert math.remainder(found - ascension, 360.0) == pytest.approx(0.0, abs=1e-4)
    # the plane is the nearer one
    start = SHIPPED.start()
    momentum = np.cross(start.position, start.velocity)
    node, tilt = float(target["ascending_node"]), math.radians(28.5)
    normal = [math.sin(tilt) * math.sin(node), -math.sin(tilt) * math.cos(node), math.cos(tilt)]
    assert math.degrees(math.acos(momentum @ normal / np.linalg.norm(momentum))) < 30.0


@pytest.mark.parametrize(
    ("target", "frame", "said"),
    [
        (
            STATE | {"raan_deg": 114.0},
            {"epoch": None},
            "epoch is missing; expected a date and time, because target.raan_deg is there",
        ),
        (
            STATE | {"raan_deg": 114.0},
            {"rate": "7.0882e-5"},
            "target.raan_deg is 114.0; expected no such key, because the body does not turn as",
        ),
        (
            STATE | {"raan_deg": 114.0, "ascending_node_deg": 114.0},
            {},
            "target.raan_deg is 114.0; expected no such key beside ascending_node_deg",
        ),
        (
            STATE | {"local_time_of_node_h": 25.0},
            {},
            "target.local_time_of_node_h is 25.0; expected a number from 0 to 24 in h",
        ),
        (
            SIZES | {"argument_of_latitude_deg": 150.0},
            {},
            (
                "target.argument_of_latitude_deg is 150.0; expected one of "
                "argument_of_perigee_deg, at and true_anomaly_deg beside it"
            ),
        ),
        (
            SIZES
            | {"argument_of_latitude_deg": 1.0, "at": "perigee", "argument_of_perigee_deg": 1.0},
            {},
            (
                "target.argument_of_latitude_deg is 1.0; expected no such key beside "
                "argument_of_perigee_deg and at"
            ),
        ),
        (
            SIZES | {"apogee_altitude_m": 185e3, "argument_of_latitude_deg": 1.0, "at": "perigee"},
            {},
            "target.argument_of_latitude_deg is 1.0; expected no such key, the orbit is a circle",
        ),
        (
            {key: ASYMPTOTE[key] for key in ASYMPTOTE if key != "rla_deg"},
            {},
            "target.rla_deg is missing; expected a number in deg beside dla_deg",
        ),
        (
            {key: ASYMPTOTE[key] for key in ASYMPTOTE if key != "inclination_deg"},
            {},
            (
                "target.inclination_deg is missing; expected a number in deg, because dla_deg and "
                "rla_deg give the node"
            ),
        ),
        (
            ASYMPTOTE | {"c3_m2_s2": -1e6},
            {},
            "target.c3_m2_s2 is -1000000.0; expected a number above 0 m2/s2, of an asymptote",
        ),
        (
            ASYMPTOTE | {"dla_deg": -30.0},
            {},
            "target.inclination_deg is 28.5; expected more than dla_deg, 30 deg",
        ),
        (
            ASYMPTOTE | {"argument_of_latitude_deg": 30.0},
            {},
            "target.argument_of_latitude_deg is 30.0; expected a cut-off inside the asymptotes",
        ),
    ],
)
def test_directions_that_are_none(dated, target, frame, said):
    with pytest.raises(MissionError) as caught:
        dated(target, **frame)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("target", "needed"),
    [
        ({"perigee_altitude_m": 185e3, "apogee_altitude_m": 35786e3}, True),
        ({"perigee_altitude_m": 185e3, "c3_m2_s2": 1e6, "inclination_deg": 28.5}, True),
        ({"semi_major_axis_m": 6.6e6, "eccentricity": 1e-4}, True),
        ({"perigee_altitude_m": 185e3, "apogee_altitude_m": 35786e3, "at": "perigee"}, False),
        (
            {
                "perigee_altitude_m": 185e3,
                "apogee_altitude_m": 35786e3,
                "inclination_deg": 28.5,
                "argument_of_perigee_deg": 180.0,
            },
            False,
        ),
        ({"perigee_altitude_m": 185e3}, False),
        ({"apogee_altitude_m": 35786e3}, False),
    ],
)
def test_a_place_that_is_free_needs_a_plan(aimed, target, needed):
    """Of a circle every place is as good; of an apogee alone the orbit is not known."""
    assert aimed(**target).needs_plan == needed
    assert not SHIPPED.needs_plan
