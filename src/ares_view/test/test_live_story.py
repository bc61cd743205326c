# SPDX-License-Identifier: Apache-2.0
"""Messages to the live page: bounded, in order, each page gets what it lacks."""

import math

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_models.passage import AirState, Passage
from ares_view.live.story import MAX_COMPLAINTS, STATE_FIELDS, STATUS_FIELDS, RowSeries, Seen, Story

MISSION = load_mission("ares_v")


def numbers(rows, since=0):
    return [number for number, _ in rows.since(since)]


def columns(first, count, arc=0, thrust=1e6):
    """Make states of a flight eastwards along the equator."""
    time = first + np.arange(count, dtype=float)
    angle = 1e-3 * time
    there = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    along = np.stack([-np.sin(angle), np.cos(angle), np.zeros(count)], axis=1)
    return {
        "time": time,
        "sequence": time.astype(int),
        "position": 6.5e6 * there,
        "velocity": 6.5e3 * along,
        "thrust_direction": along,
        "mass": np.full(count, 1e5),
        "thrust": np.full(count, thrust),
        "altitude": np.full(count, 1.2e5),
        "relative_speed": np.full(count, 6e3),
        "flight_path_angle": np.zeros(count),
        "inclination": np.zeros(count),
        "heating_rate": np.full(count, 500.0),
        "arc": np.full(count, arc),
        "jettisoned": np.zeros(count, int),
    }


@pytest.fixture
def story():
    story = Story()
    story.begin(7, MISSION)
    return story


def test_rows_are_thinned_and_the_last_one_stays():
    rows = RowSeries(most=8)
    for k in range(101):
        rows.add([float(k)])
        assert numbers(rows)[-1] == k
        assert len(numbers(rows)) <= 9
    assert rows.stride == 16
    assert numbers(rows) == [0, 16, 32, 48, 64, 80, 96, 100]


def test_a_page_that_thins_as_the_server_does_has_the_same_rows():
    """Thin the rows received as live.js does."""
    rows, page, seen = RowSeries(most=10), [], 0
    for k in range(300):
        rows.add([float(k)])
        if k % 7 == 0:
            news = numbers(rows, seen)
            page = [number for number in page if number % rows.stride == 0] + news
            seen = rows.count
            assert page == numbers(rows)


def test_a_page_gets_all_once_and_then_what_is_new(story):
    story.add_states(columns(0, 5))
    message, seen = story.news(Seen())
    assert message["kind"] == "flight"
    assert message["about"]["title"] == MISSION.title
    assert len(message["states"]) == 5
    assert story.news(seen)[0] is None
    story.add_states(columns(5, 2))
    message, seen = story.news(seen)
    assert message["kind"] == "update"
    assert [number for number, _ in message["states"]] == [5, 6]
    assert "about" not in message
    story.begin(8, None, "what")
    message, _ = story.news(seen)
    assert message["kind"] == "flight"
    assert message["states"] == []
    assert message["about"]["note"] == "what"


def test_numbers_are_those_of_the_offline_page(story):
    story.add_states(columns(0, 3))
    _, row = story.news(Seen())[0]["states"][2]
    shown = dict(zip(STATE_FIELDS, row, strict=True))
    assert shown["altitude_km"] == 120.0
    assert shown["speed_m_s"] == 6500.0
    assert shown["acceleration_m_s2"] == 10.0
    assert shown["pitch_deg"] == pytest.approx(0.0, abs=1e-3)
    earth = MISSION.earth()
    turn = math.degrees(2e-3 - 2.0 * earth.rotation_rate - earth.angle_at_zero)
    assert shown["longitude_deg"] == pytest.approx(turn, abs=1e-4)
    first = dict(zip(STATE_FIELDS, story.news(Seen())[0]["states"][0][1], strict=True))
    assert first["pitch_deg"] is None


def test_the_predicted_altitude_is_by_the_rule_of_the_mission(story):
    known = {"time_s": 1.0, "time_to_go_s": 2.0, "cutoff_s": 3.0, "iterations": 4}
    # above the pole, on the ellipsoid of the mission
    story.add_status(known, (0.0, 0.0, 6.5e6), (7e3, 0.0, 0.0))
    story.add_status(known, (math.nan,) * 3, (math.nan,) * 3)
    rows = [row for _, row in story.news(Seen())[0]["statuses"]]
    shown = dict(zip(STATUS_FIELDS, rows[0], strict=True))
    pole = MISSION.environment.earth.polar_radius_m
    assert shown["predicted_altitude_km"] == pytest.approx((6.5e6 - pole) / 1e3, abs=1e-3)
    assert shown["predicted_speed_m_s"] == 7e3
    assert rows[1] == [1.0, 2.0, 3.0, 4, None, None]


def test_a_phase_for_each_arc_and_a_colour_for_each_burn(story):
    story.add_states(columns(0, 2))
    story.add_states(columns(2, 2, arc=1, thrust=0.0))
    story.add_states(columns(4, 2, arc=1))
    phases = story.news(Seen())[0]["about"]["phases"]
    assert [phase["name"] for phase in phases] == list(MISSION.arc_names[:2])
    assert [phase["from_s"] for phase in phases] == [0.0, 2.0]
    assert [phase["role"] for phase in phases] == ["here", "thesis"]


def test_the_heating_limit_acts_once_the_fairing_is_off(story):
    story.add_states(columns(0, 2))
    assert story.news(Seen())[0]["about"]["idle"] == ["heating_w_m2"]
    story.add_states({**columns(2, 1), "jettisoned": np.array([1])})
    assert story.news(Seen())[0]["about"]["idle"] == []


def test_diagnostics_are_counted_and_bounded(story):
    for k in range(3 * MAX_COMPLAINTS):
        story.add_complaint(float(k), "WARN", "guidance", f"text {k % (2 * MAX_COMPLAINTS)}")
    complaints = story.news(Seen())[0]["complaints"]
    assert len(complaints) == MAX_COMPLAINTS
    assert complaints[0] == {
        "time_s": 0.0,
        "count": 2,
        "level": "WARN",
        "node": "guidance",
        "text": "text 0",
    }


# ---- in the air


def climbing(first, count):
    """Make states of a climb from the pad: 30 kPa at 60 s, Mach 1 at 50 s."""
    made = columns(first, count)
    time = made["time"]
    return made | {
        "altitude": 300.0 * time,
        "dynamic_pressure": 3e4 * np.exp(-(((time - 60.0) / 20.0) ** 2)) * (time > 0.0),
        "mach": 0.02 * time,
        "angle_of_attack": np.full(count, 0.1),
        "axial_acceleration": np.full(count, 12.0),
        "lateral_acceleration": np.full(count, 0.5),
    }


def about(story):
    return story.news(Seen())[0]["about"]


@pytest.fixture
def from_pad():
    story = Story()
    story.begin(7, load_mission("delta_iii_pad"))
    return story


def test_a_flight_above_the_air_shows_nothing_of_it(story):
    story.add_states(columns(0, 3))
    told = about(story)
    assert not any(told[name] for name in ("air", "in_air", "moments", "guidance"))
    _, row = story.news(Seen())[0]["states"][-1]
    shown = dict(zip(STATE_FIELDS, row, strict=True))
    assert (shown["mach"], shown["heating_w_m2"]) == (None, 500.0)
    assert told["limits"] == {"heating_w_m2": 1135.0}


def test_mach_1_is_shown_at_once_and_max_q_when_it_is_past(from_pad):
    from_pad.add_states(climbing(0, 61))
    assert [moment["mark"] for moment in about(from_pad)["moments"]] == ["Mach 1"]
    from_pad.add_states(climbing(61, 15))
    told = about(from_pad)
    assert told["in_air"]
    marked = {moment["mark"]: moment["time_s"] for moment in told["moments"]}
    assert marked == {"Mach 1": 50.0, "max q": 60.0}
    assert told["moments"][1]["text"] == "greatest dynamic pressure: 30.00 kPa at 18.0 km"


def test_what_the_simulator_tells_counts_in_the_end(from_pad):
    from_pad.add_states(climbing(0, 150))
    passage = Passage()
    passage.max_q = AirState(60.1, 18_030.0, 900.0, 30_100.0, 1.2)
    from_pad.set_passage(passage)
    (moment,) = about(from_pad)["moments"]
    assert moment["text"] == "greatest dynamic pressure: 30.10 kPa at 18.0 km"


def test_in_the_air_its_numbers_are_shown_and_above_it_heating(from_pad):
    from_pad.add_states(climbing(0, 150))
    told = about(from_pad)
    assert not told["in_air"]
    left = told["left_air_s"]
    rows = [dict(zip(STATE_FIELDS, r, strict=True)) for _, r in from_pad.news(Seen())[0]["states"]]
    assert rows[0]["q_alpha_kpa_rad"] is None
    assert rows[60]["dynamic_pressure_kpa"] == 30.0
    assert rows[60]["q_alpha_kpa_rad"] == pytest.approx(30.0 * math.sin(0.1), abs=1e-4)
    for row in rows:
        assert (row["heating_w_m2"] is None) == (row["time_s"] < left)


def test_guidance_flies_the_boost_programme_and_hands_over(from_pad):
    known = {"time_s": 90.0, "time_to_go_s": math.nan, "cutoff_s": math.nan, "iterations": 0}
    nowhere = (math.nan,) * 3
    from_pad.add_status(known, nowhere, nowhere, boosts=True)
    assert about(from_pad)["guidance"] == "boost programme"
    from_pad.add_status(known | {"time_s": 91.0}, nowhere, nowhere)
    told = about(from_pad)
    assert told["guidance"] == "closed loop"
    assert [(m["mark"], m["time_s"]) for m in told["moments"]] == [("hand-over", 91.0)]
