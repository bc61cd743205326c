# SPDX-License-Identifier: Apache-2.0
"""The impact point against falls integrated on a rotating body, and areas of all shapes."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ares_models.earth import Earth
from ares_models.impacts import find_impact, outlines
from ares_models.kernels.impact import fall, impact_direction, impact_jacobian, outside_areas
from ares_models.mission import Mission, load_mission

ARES = load_mission("ares_v")


def environment(polar_share=1.0, altitude="ellipsoid", zero_deg=25.0):
    """Return the record of an Earth with a given flattening."""
    earth = ARES.environment.earth.model_copy(
        update={
            "polar_radius_m": polar_share * ARES.environment.earth.equatorial_radius_m,
            "zero_longitude_deg": zero_deg,
        }
    )
    part = ARES.environment.model_copy(update={"earth": earth, "altitude": altitude})
    return ARES.model_copy(update={"environment": part, "abort": None}).environment_array()[0]


BODIES = {
    "Earth": environment(6356750.0 / 6378140.0),
    "sphere": environment(0.99, "spherical"),
    "flat": environment(0.97),
    "still": environment(),
}
BODIES["still"]["rotation_rate"] = 0.0


def to_earth(record, time):
    """Transform from inertial to body-fixed axes."""
    angle = float(record["zero_longitude"] + record["rotation_rate"] * time)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def integrated(position, velocity, time, record):
    """Integrate the fall in rotating axes: time, s, and place, m; None: no impact in one orbit."""
    rate = np.array([0.0, 0.0, float(record["rotation_rate"])])
    mu, a = float(record["mu"]), float(record["equatorial_radius"])
    b = a if record["altitude_model"] == 0 else float(record["polar_radius"])

    def motion(_, state):
        r, v = state[:3], state[3:]
        turning = -2.0 * np.cross(rate, v) - np.cross(rate, np.cross(rate, r))
        return np.concatenate((v, -mu / np.linalg.norm(r) ** 3 * r + turning))

    def ground(_, state):
        return (state[0] ** 2 + state[1] ** 2) / a**2 + state[2] ** 2 / b**2 - 1.0

    ground.terminal, ground.direction = True, -1.0
    turned = to_earth(record, time)
    start = turned @ (velocity - np.cross(rate, position))
    alpha = 2.0 / np.linalg.norm(position) - velocity @ velocity / mu
    longest = 2.0 * math.pi / math.sqrt(mu * alpha**3) if alpha > 0.0 else 2e4
    way = solve_ivp(
        motion,
        (0.0, min(longest, 2e5)),
        np.concatenate((turned @ position, start)),
        "DOP853",
        events=ground,
        rtol=1e-12,
        atol=1e-6,
    )
    if not len(way.t_events[0]):
        return None
    return way.t_events[0][0], way.y_events[0][0][:3]


def random_states(seed, count):
    """Draw states up to 1,500 km high, at up to 1.05 times circular speed, at all angles."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        up = rng.normal(size=3)
        up /= np.linalg.norm(up)
        level = np.cross(up, rng.normal(size=3))
        level /= np.linalg.norm(level)
        radius = 6378140.0 + 10.0 ** rng.uniform(3.0, 6.2)
        speed = rng.uniform(0.05, 1.05) * math.sqrt(3.986e14 / radius)
        angle = math.radians(rng.uniform(-80.0, 80.0) if rng.random() < 0.5 else rng.normal(0, 8))
        velocity = speed * (math.cos(angle) * level + math.sin(angle) * up)
        yield radius * up, velocity, rng.uniform(-100.0, 2e4)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name == "Earth" else [pytest.mark.trial]) for name in BODIES],
)
def test_the_impact_is_where_an_integrated_fall_ends(name):
    record = BODIES[name]
    fallen = 0
    for r, v, time in random_states(11, 150):
        span, _ = fall(tuple(r.tolist()), tuple(v.tolist()), record)
        other = integrated(r, v, time, record)
        assert math.isnan(span) == (other is None)
        if other is None:
            continue
        fallen += 1
        assert span == pytest.approx(other[0], abs=1e-3)
        place = impact_direction(tuple(r.tolist()), tuple(v.tolist()), time, record)
        down = other[1] / np.linalg.norm(other[1])
        # m over the ground
        assert 6.4e6 * np.linalg.norm(np.array(place) - down) < 1.0
    assert fallen > 80


def test_it_moves_with_the_velocity_as_integrated_falls_do():
    record = BODIES["Earth"]
    for r, v, time in random_states(5, 12):
        moves = np.array(impact_jacobian(tuple(r.tolist()), tuple(v.tolist()), time, record))
        if not np.all(np.isfinite(moves)):
            continue
        for k in range(3):
            step = np.zeros(3)
            step[k] = 1.0
            ends = [integrated(r, v + sign * step, time, record) for sign in (1.0, -1.0)]
            if None in ends:
                continue
            ahead, back = (end[1] / np.linalg.norm(end[1]) for end in ends)
            expected = 0.5 * (ahead - back)
            assert moves[k] == pytest.approx(expected, rel=1e-2, abs=1e-3 * np.abs(moves).max())


def test_on_the_ground_and_descending_it_falls_at_once():
    record = BODIES["sphere"]
    radius = float(record["equatorial_radius"])
    span, down = fall((radius - 5.0, 0.0, 0.0), (-10.0, 300.0, 0.0), record)
    assert span == 0.0
    assert down == pytest.approx((radius - 5.0, 0.0, 0.0), abs=1e-3)


@pytest.mark.parametrize(
    ("r", "v"),
    [
        ((6.6e6, 0.0, 0.0), (0.0, 7790.0, 0.0)),  # an orbit
        ((6.6e6, 0.0, 0.0), (0.0, 12e3, 0.0)),  # an escape
        ((6.6e6, 0.0, 0.0), (100.0, 0.0, 0.0)),  # straight up: it has no plane
        ((math.nan, 0.0, 0.0), (0.0, 100.0, 0.0)),
    ],
)
def test_what_has_no_impact_point(r, v):
    record = BODIES["Earth"]
    span, down = fall(r, v, record)
    assert math.isnan(span) and all(map(math.isnan, down))
    assert outside_areas(impact_direction(r, v, 0.0, record), record) == (math.inf, -1)


# ---- areas


def mission_with(*areas):
    """Return the thesis' mission with other areas."""
    data = ARES.model_dump(exclude_unset=True)
    data["abort"]["avoid"] = list(areas)
    return Mission.model_validate(data)


def direction(latitude_deg, longitude_deg):
    latitude, longitude = np.radians(latitude_deg), np.radians(longitude_deg)
    latitude = ARES.earth().geocentric_latitude(latitude)
    across = math.cos(latitude)
    return (across * math.cos(longitude), across * math.sin(longitude), math.sin(latitude))


def circle(latitude_deg, longitude_deg, radius_m, name="spot"):
    return {
        "name": name,
        "latitude_deg": latitude_deg,
        "longitude_deg": longitude_deg,
        "radius_m": radius_m,
    }


SHAPES = {
    "square": [[10, 20], [10, 30], [20, 30], [20, 20]],
    "the other way round": [[20, 20], [20, 30], [10, 30], [10, 20]],
    "across 180 deg": [[-10, 175], [-12, -170], [8, -172], [12, 178]],
    "across 180 deg, written on": [[-10, 175], [-12, 190], [8, 188], [12, 178]],
    "over the north pole": [[70, 0], [65, 90], [75, 180], [72, -90]],
    "over the south pole": [[-70, 0], [-65, 120], [-75, 240]],
    "with a bay": [[0, 0], [0, 20], [20, 20], [5, 10], [20, 0]],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_polygon_is_what_it_is_seen_from_the_centre(shape):
    record = mission_with({"name": "x", "vertices_deg": SHAPES[shape]}).environment_array()[0]
    corners = np.array([direction(*corner) for corner in SHAPES[shape]])
    middle = corners.mean(axis=0)
    middle /= np.linalg.norm(middle)
    east = np.cross(middle, [0.3, 0.5, 0.81])
    east /= np.linalg.norm(east)
    plane = np.array([east, np.cross(middle, east)])
    flat = corners @ plane.T / (corners @ middle)[:, None]
    edges = np.concatenate(
        [
            np.linspace(0, 1, 4000)[:, None] * (b - a) + a
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
        ]
    )
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    rng = np.random.default_rng(2)
    count = 0
    for k in range(600):
        place = rng.normal(size=3) if k % 3 == 0 else middle + 0.2 * rng.normal(size=3)
        place /= np.linalg.norm(place)
        x, y = plane @ place / (middle @ place)
        inside = False
        for (x0, y0), (x1, y1) in zip(flat, np.roll(flat, -1, axis=0), strict=True):
            if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
                inside = not inside
        inside = inside and place @ middle > 0.0
        outside_m, area = outside_areas(tuple(place.tolist()), record)
        assert area == 0
        assert (outside_m < 0.0) == inside
        away = 6378140.0 * np.arccos(np.clip(edges @ place, -1, 1)).min()
        assert abs(outside_m) == pytest.approx(away, abs=500.0)
        count += inside
    assert count > 20


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(28.0, -64.0), (0.0, 179.9), (89.9, 0.0), (-90.0, 12.0)]
)
def test_a_circle_is_round_and_counts_over_the_ground(latitude, longitude):
    radius = 300e3
    mission = mission_with(circle(latitude, longitude, radius))
    record = mission.environment_array()[0]
    centre = np.array(direction(latitude, longitude))
    assert outside_areas(tuple(centre.tolist()), record) == (pytest.approx(-radius, abs=1.0), 0)
    for point in outlines(mission)["spot"]:
        outside_m, _ = outside_areas(direction(*point), record)
        assert outside_m == pytest.approx(0.0, abs=1.0)
    far = tuple((-centre).tolist())
    assert outside_areas(far, record)[0] == pytest.approx(math.pi * 6378140.0 - radius, abs=10.0)


def test_the_nearest_of_several_areas_is_named():
    mission = mission_with(circle(0, 0, 1e5, "a"), circle(0, 10, 1e5, "b"), circle(0, 20, 1e5, "c"))
    record = mission.environment_array()[0]
    assert [outside_areas(direction(0.0, x), record)[1] for x in (-3, 4, 6, 14, 16)] == [
        *(0, 0, 1, 1, 2)
    ]


def test_an_impact_in_words():
    earth = ARES.earth()
    record = mission_with(circle(-33.0, -71.6, 50e3, "Valparaiso")).environment_array()[0]
    at = Earth.position(
        earth, earth.geocentric_latitude(math.radians(-33.1)), math.radians(-71.5), 6.4e6, 500.0
    )
    # at rest over the ground, and 28 km above it: it falls to the place below, nearly
    velocity = np.cross([0.0, 0.0, earth.rotation_rate], at)
    impact = find_impact(at, velocity, 500.0, record, ["Valparaiso"])
    assert impact.area == "Valparaiso"
    assert impact.place == "33.10 S 71.50 W"
    assert impact.time_s - 500.0 == pytest.approx(math.sqrt(2 * 28e3 / 9.8), rel=0.03)
    orbit = find_impact([6.6e6, 0.0, 0.0], [0.0, 7790.0, 0.0], 0.0, record, ["Valparaiso"])
    assert orbit is None


def test_shipped_areas_lie_where_their_names_say():
    for name in ("ares_v", "saturn_v_as506"):
        mission = load_mission(name)
        record = mission.environment_array()[0]
        for latitude, longitude, area in (
            (32.3, -64.75, "Bermuda"),
            (28.1, -15.4, "Canary Islands"),
            (14.7, -17.4, "Africa"),
            (25.06, -77.34, "Bahamas"),
            (40.4, -75.0, "North America"),
        ):
            outside_m, index = outside_areas(direction(latitude, longitude), record)
            assert outside_m < 0.0 and mission.area_names[index] == area
        # out at sea, and where they begin
        assert outside_areas(direction(25.0, -50.0), record)[0] > 1e6
        start = mission.start()
        place = find_impact(start.position, [0.0, 1e3, 0.0], start.time_s, record, ())
        assert place.longitude_deg == pytest.approx(-80.0, abs=1.5)
        assert place.latitude_deg == pytest.approx(28.6, abs=0.5)
