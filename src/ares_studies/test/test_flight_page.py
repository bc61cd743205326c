# SPDX-License-Identifier: Apache-2.0
"""A recorded flight as series, positions and charts: no bag, no browser."""

import dataclasses
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from ares_guidance.arrays import PHASE_BOOST, PHASE_TRACKING
from ares_models.kernels.boost import boost_direction
from ares_models.kernels.environment import altitude, gravity
from ares_models.mission import MISSION as MISSION_FILE
from ares_models.mission import load_mission, parse_mission
from ares_models.orbits import Elements
from ares_studies.event_words import Moment
from ares_studies.flight_page import data
from ares_studies.flight_page.charts import ARC_ROLES, make_chapters
from ares_studies.flight_page.data import OPTIMUM, Recording, make_flight
from ares_studies.flight_page.geometry import (
    ground_range,
    ground_track,
    impact_time,
    impact_track,
    thrust_angles,
)
from ares_studies.flight_page.globe import make_globe
from ares_studies.flight_page.land import coasts, read_land
from ares_studies.flight_page.page import Account, make_report, render
from ares_studies.pages.parts import Guide, line
from ares_studies.pages.templates import PALETTES

MISSION = load_mission("ares_v")
ENVIRONMENT = MISSION.environment_array()[0]
EARTH = MISSION.earth()
DEGREE = math.pi / 180.0


def columns(count=4000, *, end=700.0):
    """Make a synthetic climb of two arcs and a jettison."""
    time = np.linspace(0.0, end, count)
    angle = 1e-3 * time
    radius = EARTH.equatorial_radius + 200.0 * time
    up = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(count)))
    along = np.column_stack((-np.sin(angle), np.cos(angle), np.zeros(count)))
    position = radius[:, None] * up
    velocity = 200.0 * up + (1e-3 * radius)[:, None] * along
    return {
        "time": time,
        "sequence": np.arange(count),
        "position": position,
        "velocity": velocity,
        "mass": 1e6 - 1e3 * time,
        "thrust_direction": along,
        "thrust": np.where(time < 400.0, 2e7, 1e6),
        "altitude": 200.0 * time,
        "relative_speed": np.full(count, 5e3),
        "flight_path_angle": np.full(count, 0.1),
        "inclination": np.full(count, 0.5),
        "heating_rate": np.exp(-time / 50.0),
        "arc": (time >= 400.0).astype(int),
        "jettisoned": (time >= 500.0).astype(int),
    }


def status(count=700):
    time = np.arange(float(count))
    cutoff = np.where(time < 3.0, math.nan, 650.0)
    return {
        "time": time,
        "time_to_go": cutoff - time,
        "iterations": np.ones(count, dtype=int),
        "cutoff_time": cutoff,
        "jettison_time": np.full(count, math.nan),
    }


EMPTY = {"time": np.empty(0)}


def recording(**changes):
    given = {
        "name": "made up",
        "law": "peg",
        "mission": MISSION,
        "truth": columns(),
        "navigation": EMPTY,
        "status": status(),
    }
    return Recording(**(given | changes))


def account(name="peg", **changes):
    given = {
        "name": name,
        "bag": "bags/made_up",
        "law": "peg",
        "title": "A <made-up> flight",
        "verdict": "Flown to the target",
        "good": True,
        "problems": (),
        "key_numbers": (("final mass", "1.00", "kg"),),
        "facts": (("bag", "bags/made_up"),),
        "tables": {"Insertion": None},
        "end": "insertion",
        "events": (Moment(1, 0.0, 1e6, "flight started"),),
        "marks": (),
        "air_marks": (),
        "diagnostics": (),
    }
    return Account(**(given | changes))


# ---- geometry


@pytest.mark.parametrize("pitch", [-40.0, 0.0, 12.5, 80.0])
@pytest.mark.parametrize("yaw", [-170.0, -3.0, 0.0, 45.0])
def test_pitch_and_yaw_are_those_of_the_thrust(pitch, yaw):
    # over the equator at x, flying north and up: right of it is east, +y
    east, north, up = np.eye(3)[1], np.eye(3)[2], np.eye(3)[0]
    p, y = pitch * DEGREE, yaw * DEGREE
    level = math.cos(y) * north + math.sin(y) * east
    direction = math.cos(p) * level + math.sin(p) * up
    velocity = 7e3 * north + 500.0 * up
    found = thrust_angles(7e6 * up[None], velocity[None], direction[None], ENVIRONMENT)
    expected = [pitch, yaw, yaw % 360.0]
    np.testing.assert_allclose([angle[0] for angle in found], expected, atol=1e-9)


def test_pitch_and_azimuth_are_those_of_a_programme():
    environment = load_mission("delta_iii_pad").environment_array()[0].copy()
    start = load_mission("delta_iii_pad").start()
    boost = environment["boost"]
    boost["knots"], boost["pitch"][0], boost["azimuth"][0] = 1, 62.0 * DEGREE, 42.0 * DEGREE
    place = tuple(start.position.tolist()), tuple(start.velocity.tolist())
    direction = np.array(boost_direction(0.0, *place, environment))
    rows = start.position[None], start.velocity[None], direction[None]
    pitch, _, azimuth = thrust_angles(*rows, environment)
    assert (pitch[0], azimuth[0]) == pytest.approx((62.0, 42.0), abs=1e-9)


def test_the_ground_track_is_that_of_a_known_place():
    # Cape Canaveral's pad 39A, from 0 to an hour after the mission's start
    times = np.array([0.0, 600.0, 3600.0])
    latitude, longitude = 28.6 * DEGREE, -80.6 * DEGREE
    places = [EARTH.position(latitude, longitude, 6.4e6, time) for time in times]
    track = ground_track(times, np.array(places), EARTH)
    np.testing.assert_allclose(track.latitude_deg, 28.6, atol=1e-12)
    np.testing.assert_allclose(track.longitude_deg, -80.6, atol=1e-9)


def test_the_earth_turns_below_and_longitude_zero_is_the_x_axis_at_time_zero():
    still = np.tile([7e6, 0.0, 0.0], (2, 1))
    unplaced = dataclasses.replace(EARTH, angle_at_zero=0.0)
    track = ground_track(np.array([0.0, 3600.0]), still, unplaced)
    np.testing.assert_allclose(track.longitude_deg, [0.0, -15.041], atol=1e-3)


def test_the_ground_range_is_the_way():
    quarter = ground_track(
        np.zeros(91), [(math.cos(k * DEGREE), 0.0, math.sin(k * DEGREE)) for k in range(91)], EARTH
    )
    found = ground_range(quarter, EARTH.equatorial_radius)
    assert found[0] == 0.0
    assert found[-1] == pytest.approx(0.5 * math.pi * EARTH.equatorial_radius, rel=1e-12)


def fall(position, velocity, step=0.05):
    """Integrate the fall by Runge-Kutta; return time to impact, s, and place."""

    def rate(state):
        return np.concatenate((state[3:], gravity(tuple(state[:3].tolist()), ENVIRONMENT)))

    state, time = np.concatenate((position, velocity)), 0.0
    height = altitude(tuple(state[:3].tolist()), ENVIRONMENT)
    while True:
        a = rate(state)
        b = rate(state + 0.5 * step * a)
        c = rate(state + 0.5 * step * b)
        d = rate(state + step * c)
        state = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        before, height = height, altitude(tuple(state[:3].tolist()), ENVIRONMENT)
        if height < 0.0:
            share = before / (before - height)
            return time + step * share, state[:3] - (1.0 - share) * step * state[3:]
        time += step


@pytest.mark.parametrize("climb", [-300.0, 0.0, 900.0])
def test_the_impact_point_is_where_an_integrated_fall_ends(climb):
    position = 6.45e6 * np.array([0.6, 0.64, 0.48])
    up = position / np.linalg.norm(position)
    along = np.cross([0.0, 0.0, 1.0], up)
    velocity = 5500.0 * along / np.linalg.norm(along) + climb * up
    expected, down = fall(position, velocity)
    assert impact_time(position, velocity, ENVIRONMENT) == pytest.approx(expected, abs=2e-3)
    track = impact_track(np.array([100.0]), position[None], velocity[None], ENVIRONMENT, EARTH)
    latitude, longitude = EARTH.latitude_longitude(down, 100.0 + expected)
    # a thousandth of a second is some five metres
    assert track.latitude_deg[0] == pytest.approx(latitude / DEGREE, abs=2e-4)
    assert track.longitude_deg[0] == pytest.approx(longitude / DEGREE, abs=2e-4)


@pytest.mark.parametrize(
    ("perigee", "apogee"), [(150e3, 300e3), (150e3, math.inf)], ids=["orbit", "hyperbola"]
)
def test_what_stays_above_has_no_impact_point(perigee, apogee):
    low = EARTH.equatorial_radius + perigee
    e = 1.3 if math.isinf(apogee) else (apogee - perigee) / (2 * EARTH.equatorial_radius + 450e3)
    orbit = Elements(low / (1.0 - e), e, 0.5, 1.0, 2.0, true_anomaly=1.0)
    assert math.isnan(impact_time(*orbit.state(float(ENVIRONMENT["mu"])), ENVIRONMENT))


def test_what_rests_on_the_ground_falls_there():
    position = EARTH.position(0.5, 1.0, EARTH.surface_radius(0.5) - 1.0, 0.0)
    velocity = np.cross([0.0, 0.0, EARTH.rotation_rate], position)
    assert impact_time(position, velocity, ENVIRONMENT) == 0.0


# ---- series


def test_states_are_chosen_evenly_and_at_each_change():
    truth = columns(60_000)
    rows = data.chosen(truth)
    assert data.MAX_STATES <= len(rows) <= data.MAX_STATES + 4
    assert (rows[0], rows[-1]) == (0, 59_999)
    for name in ("arc", "jettisoned"):
        edge = int(np.flatnonzero(np.diff(truth[name]))[0])
        assert {edge, edge + 1} <= set(rows.tolist())


def test_a_short_flight_keeps_every_state():
    assert data.chosen(columns(50)).tolist() == list(range(50))


def test_series_of_a_flight():
    flight = make_flight(recording())
    states = flight.states
    np.testing.assert_allclose(states.acceleration_m_s2, states.thrust_n / states.mass_kg)
    assert math.isnan(states.pitch_deg[0])
    np.testing.assert_allclose(states.pitch_deg[1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(states.yaw_deg[1:], 0.0, atol=1e-9)
    i = len(states.time_s) // 2
    radius = EARTH.equatorial_radius + states.altitude_m[i]
    v = math.hypot(200.0, 1e-3 * radius)
    a = 1.0 / (2.0 / radius - v * v / float(ENVIRONMENT["mu"]))
    size = states.perigee_m[i] + states.apogee_m[i] + 2.0 * EARTH.equatorial_radius
    assert size == pytest.approx(2.0 * a, rel=1e-9)
    assert states.apogee_m[i] - states.perigee_m[i] == pytest.approx(
        2.0 * a * states.eccentricity[i], rel=1e-9
    )
    names = [phase.name for phase in flight.phases]
    assert names == ["core", "upper stage", "upper stage, after payload fairing"]
    assert len(flight.impact_time_s) == data.MAX_IMPACTS
    assert flight.heating_limit_w_m2 == 1135.0


def test_navigation_is_shown_where_it_differs_only():
    truth = columns(100)
    right = {name: truth[name] for name in ("time", "sequence", "position", "velocity")}
    assert make_flight(recording(truth=truth, navigation=right)).navigation is None
    # one state of the two is missing in the bag
    wrong = {name: values[1:] for name, values in right.items()}
    wrong["position"] = wrong["position"] + [3.0, 4.0, 0.0]
    errors = make_flight(recording(truth=truth, navigation=wrong)).navigation
    assert len(errors.time_s) == 99
    np.testing.assert_allclose(errors.position_m, 5.0)
    np.testing.assert_allclose(errors.velocity_m_s, 0.0)


def test_a_flight_of_one_state_and_nothing_else():
    truth = {name: values[:1] for name, values in columns().items()}
    flight = make_flight(recording(truth=truth, status=EMPTY))
    assert flight.guidance is None
    report = make_report([flight], [account()], None)
    assert "Guidance" not in [chapter.title for chapter in report.chapters]
    assert "<canvas" in render(report)


# ---- charts, globe, page


def test_charts_leave_out_what_is_not_known_and_name_their_units():
    chapters = make_chapters([make_flight(recording())], ["peg"], ())
    items = [item for chapter in chapters for item in chapter.items]
    titles = [item.title for item in items]
    assert "Predicted jettison" not in titles
    assert "Position error" not in titles
    assert [item.name for item in items] == [f"Figure {k + 1}" for k in range(len(items))]
    by_time = [item.content.x for item in items if item.content.x.unit == "s"]
    assert len(set(by_time)) == 1
    for item in items:
        assert item.content.y.unit or item.title == "Eccentricity"
        own = [one for one in item.content.series if one.name != "land"]
        # one cursor goes over all: each point has a time
        assert all(bool(one.t) is (item.content.x.unit != "s") for one in own)
    range_km = items[titles.index("Altitude over ground range")].content
    assert (range_km.x.unit, range_km.y.unit) == ("km", "km")
    heating = items[titles.index("Heating")].content
    assert heating.y.log
    assert [level.at for level in heating.levels] == [1135.0]


def test_flights_over_each_other_have_a_colour_each():
    flights = [make_flight(recording()), make_flight(recording(truth=columns(end=600.0)))]
    chapters = make_chapters(flights, ["one", "two"], ())
    speed = next(item for item in chapters[0].items if item.title == "Speed").content
    assert [(one.name, one.role, one.shape) for one in speed.series] == [
        ("one, inertial", "here", "line"),
        ("one, against the air", "here", "dashes"),
        ("two, inertial", "thesis", "line"),
        ("two, against the air", "thesis", "dashes"),
    ]


def test_an_optimum_lies_over_the_flight_that_follows_it():
    flown = make_flight(recording())
    flights = [replace(flown, law=OPTIMUM), flown]
    chapters = make_chapters(flights, ["best", "flown"], ())
    speed = next(item for item in chapters[0].items if item.title == "Speed").content
    assert [one.shape for one in speed.series] == ["over", "dots", "line", "dashes"]
    globe = make_globe(flights, ["best", "flown"], ["", ""])
    assert [flight.over for flight in globe.flights] == [True, False]
    # alone it is drawn like any other
    assert not make_globe(flights[:1], ["best"], [""]).flights[0].over
    (altitude, *_) = make_chapters(flights[:1], ["best"], ())[0].items
    assert {one.shape for one in altitude.content.series} == {"line"}


def test_arcs_have_a_colour_each_as_long_as_there_are_some():
    flight = make_flight(recording())
    phase = replace(flight.phases[0], burns=True)
    many = replace(flight, phases=(phase,) * (len(ARC_ROLES) + 1))
    ways = make_globe([many], ["one"], [""]).flights[0].ways
    assert tuple(way.role for way in ways) == (*ARC_ROLES, ARC_ROLES[0])
    assert len(set(ARC_ROLES)) == 8
    for colours in PALETTES.values():
        assert len({colours[role] for role in ARC_ROLES}) == len(ARC_ROLES)


def test_the_globe_has_land_on_the_earth_only():
    flight = make_flight(recording())
    globe = make_globe([flight], ["peg"], ["insertion"])
    assert [way.name for way in globe.flights[0].ways] == [p.name for p in flight.phases]
    assert globe.flights[0].ways[-1].last == len(flight.states.time_s) - 1
    assert globe.land == read_land()
    moon = {"equatorial_radius_m": 1.738e6, "polar_radius_m": 1.736e6}
    earth = MISSION.environment.earth.model_copy(update=moon)
    environment = MISSION.environment.model_copy(update={"earth": earth})
    elsewhere = recording(mission=MISSION.model_copy(update={"environment": environment}))
    assert make_globe([make_flight(elsewhere)], ["peg"], ["end"]).land == ()


@pytest.mark.parametrize(("angle", "said"), [(-79.4, False), (None, True)])
def test_the_page_says_where_a_mission_leaves_longitude_zero_open(angle, said):
    earth = MISSION.environment.earth.model_copy(update={"zero_longitude_deg": angle})
    environment = MISSION.environment.model_copy(update={"earth": earth})
    flight = make_flight(recording(mission=MISSION.model_copy(update={"environment": environment})))
    page = render(make_report([flight], [account()], None))
    assert ("does not say where longitude zero is" in page) is said


def test_land_is_closed_rings_of_places():
    rings = read_land()
    assert len(rings) > 100
    for ring in rings:
        longitudes, latitudes = ring[::2], ring[1::2]
        assert len(longitudes) == len(latitudes) >= 4
        assert (longitudes[0], latitudes[0]) == (longitudes[-1], latitudes[-1])
        assert max(map(abs, longitudes)) <= 180.0
        assert max(map(abs, latitudes)) <= 90.0


def test_the_page_carries_all_that_it_needs_and_no_more():
    report = make_report([make_flight(recording())], [account()], None)
    page = render(report)
    assert len(page.encode()) < 4e6
    assert "A &lt;made-up&gt; flight" in page
    assert 'src="' not in page
    assert "url(" not in page
    assert '<script type="text/plain" id="plotly">' in page
    numbers = page.split('id="report">', 1)[1].split("</script>", 1)[0]
    assert json.loads(numbers.replace("<\\/", "</"))["globe"]["ends"] == ["insertion"]


def test_the_map_is_near_and_has_its_coasts():
    flight = make_flight(recording())
    chapters = make_chapters([flight], ["peg"], ())
    item = next(i for c in chapters for i in c.items if i.title == "Ground track")
    figure, track = item.content, flight.states.track
    assert item.wide
    assert figure.x.span == pytest.approx(
        (track.longitude_deg.min() - 1.0, track.longitude_deg.max() + 1.0), abs=1e-3
    )
    middle = math.radians(0.5 * (track.latitude_deg.min() + track.latitude_deg.max()))
    assert figure.stretch == pytest.approx(1.0 / math.cos(middle), abs=1e-6)
    assert [one.name for one in figure.series] == ["latitude", "land"]


def test_a_track_over_the_date_line_goes_on_and_so_do_the_coasts():
    box = (170.0, 200.0, -50.0, -30.0)
    land = coasts(read_land(), box)
    known = [(x, y) for x, y in zip(land.x, land.y, strict=True) if x is not None]
    assert known
    assert all(170.0 <= x <= 200.0 and -50.0 <= y <= -30.0 for x, y in known)
    # New Zealand lies there, also where longitudes are counted the other way
    west = coasts(read_land(), (-190.0, -160.0, -50.0, -30.0))
    shared = {(round(x - 360.0, 2), y) for x, y in known if x <= 190.0 and x >= 170.0}
    assert shared <= {(x, y) for x, y in zip(west.x, west.y, strict=True) if x is not None}


def test_a_way_by_time_keeps_its_ends_and_its_corners():
    t = np.linspace(0.0, 100.0, 2001)
    x, y = np.minimum(t, 40.0), np.maximum(t - 40.0, 0.0)
    drawn = line("way", "here", x, y, 3, t=t)
    assert (drawn.t[0], drawn.t[-1]) == (0.0, 100.0)
    assert 40.0 in drawn.t
    assert len(drawn.x) == len(drawn.y) == len(drawn.t) < 400


# ---- in the air

PAD = parse_mission(
    MISSION_FILE.find("delta_iii_pad")
    .read_text()
    .replace("    burn_time_s: 261.0\n", "    burn_time_s: 261.0\n    max_q_alpha_pa_rad: 9000.0\n")
    .replace("    boosters:", "    max_dynamic_pressure_pa: 40000.0\n    boosters:"),
    "pad.yaml",
)


def in_air(q_pa=3e4):
    """Make a synthetic climb with its greatest dynamic pressure at 60 s."""
    made = columns()
    time = made["time"]
    made["arc"][:] = 0
    return made | {
        "dynamic_pressure": q_pa * np.exp(-(((time - 60.0) / 20.0) ** 2)),
        "mach": 0.02 * time,
        "angle_of_attack": np.full(len(time), 0.1),
        "axial_acceleration": np.full(len(time), 12.0),
        "lateral_acceleration": np.full(len(time), 0.5),
    }


def air_figures(flights, marks=()):
    names = [flight.name for flight in flights]
    chapters = make_chapters(flights, names, (), marks)
    found = [chapter for chapter in chapters if chapter.title == "In the air"]
    return {item.title: item.content for chapter in found for item in chapter.items}


def test_a_flight_above_the_air_has_no_chapter_in_it():
    assert air_figures([make_flight(recording())]) == {}
    # nor has a bag of old, which does not tell of the air
    assert air_figures([make_flight(recording(mission=PAD))]) == {}


def test_charts_in_the_air_end_with_it_and_show_limits_with_what_is_spared():
    flight = make_flight(recording(mission=PAD, truth=in_air()))
    until = 60.0 + 20.0 * math.sqrt(math.log(3e4 / 50.0))
    assert flight.air.until_s == pytest.approx(until, abs=0.2)
    marks = (Guide(60.0, "max q"), Guide(400.0, "staging"))
    figures = air_figures([flight], marks)
    assert list(figures) == [
        "Dynamic pressure",
        "Mach number",
        "Angle of attack",
        "Q alpha",
        "Loads",
    ]
    for figure in figures.values():
        assert figure.x.span[1] == pytest.approx(until, abs=2.0)
        assert [mark.text for mark in figure.instants] == ["max q"]
    pressure = figures["Dynamic pressure"]
    assert max(pressure.series[0].y) == pytest.approx(30.0, abs=0.01)
    (level,) = pressure.levels
    assert (level.at, level.text) == (40.0, "limit, 40 kPa, 10.00 to spare")
    assert pressure.y.span[1] > 40.0
    (level,) = figures["Q alpha"].levels
    limit, spare = re.fullmatch(r"limit, (.*) kPa rad, (.*) to spare", level.text).groups()
    assert limit == "9"
    assert float(spare) == pytest.approx(9.0 - 30.0 * math.sin(0.1), abs=0.02)
    assert [series.name for series in figures["Loads"].series] == ["axial", "lateral"]


@pytest.mark.parametrize(
    ("q_pa", "said"), [(40020.0, "reached"), (39990.0, "reached"), (41000.0, "1.00 beyond it")]
)
def test_a_limit_that_is_not_kept_is_told(q_pa, said):
    flight = make_flight(recording(mission=PAD, truth=in_air(q_pa)))
    (level,) = air_figures([flight])["Dynamic pressure"].levels
    assert level.text == f"limit, 40 kPa, {said}"


def test_several_flights_share_limits_without_what_each_spares():
    flights = [
        make_flight(recording(name=name, mission=PAD, truth=in_air(q_pa)))
        for name, q_pa in (("one", 3e4), ("two", 2e4))
    ]
    (level,) = air_figures(flights)["Dynamic pressure"].levels
    assert level.text == "limit, 40 kPa"


def panels(flight, marks=()):
    """Plot a flight; return its panels by their titles."""
    from ares_studies.plots import draw_flight

    truth = columns() | in_air() if flight.air else columns()
    figure = draw_flight("a flight", truth, status(), flight=flight, air_marks=marks)
    return {panel.get_title(loc="left"): panel for panel in figure.axes}


def test_a_picture_shows_the_air_as_the_page_does():
    flight = make_flight(recording(mission=PAD, truth=in_air()))
    drawn = panels(flight, [(60.0, "max q"), (400.0, "staging")])
    assert len(drawn) == 10
    words = {
        "dynamic pressure, kPa": "Dynamic pressure",
        "Mach number": "Mach number",
        "angle of attack, deg": "Angle of attack",
        "q alpha, kPa rad": "Q alpha",
    }
    figures = air_figures([flight])
    for title, name in words.items():
        panel, figure = drawn[title], figures[name]
        assert panel.get_lines()[0].get_xdata() == pytest.approx(figure.series[0].x, abs=1e-3)
        assert panel.get_lines()[0].get_xdata()[-1] <= flight.air.until_s
        told = {text.get_text() for text in panel.texts}
        assert {level.text for level in figure.levels} <= told
        assert "staging" not in told
    assert "max q" in {text.get_text() for text in drawn["Mach number"].texts}


def test_a_picture_of_a_flight_above_the_air_has_its_six_panels():
    flight = make_flight(recording())
    assert flight.air is None
    assert len(panels(flight)) == 6


def test_the_boost_programme_belongs_to_the_part_in_the_air():
    said = status()
    said["phase"] = np.where(said["time"] < 200.0, PHASE_BOOST, PHASE_TRACKING)
    flight = make_flight(recording(mission=PAD, truth=in_air(), status=said))
    assert flight.air.until_s == 200.0


def test_in_the_air_no_heating_of_single_molecules_is_drawn():
    flight = make_flight(recording(mission=PAD, truth=in_air()))
    (vehicle,) = (c for c in make_chapters([flight], ["a"], ()) if c.title == "Vehicle")
    (heating,) = (item.content for item in vehicle.items if item.title == "Heating")
    shown = [x for x, y in zip(heating.series[0].x, heating.series[0].y, strict=True) if y]
    assert min(shown) > flight.air.until_s


def test_what_precedes_the_first_command_has_no_attitude():
    states = make_flight(recording(mission=PAD, truth=in_air())).states
    for name in ("pitch_deg", "yaw_deg", "azimuth_deg", "angle_of_attack_deg", "q_alpha_pa_rad"):
        assert np.isnan(getattr(states, name)[0])
        assert np.isfinite(getattr(states, name)[1])
