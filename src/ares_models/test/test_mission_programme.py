# SPDX-License-Identifier: Apache-2.0
"""Boost programmes of mission files: what is refused, and where the thrust points."""

import math
from importlib import resources

import numpy as np
import pytest

from ares_models.kernels.boost import boost_direction, horizon, is_over
from ares_models.kernels.environment import altitude
from ares_models.mission import MissionError, parse_mission

TEXT = resources.files("ares_trials").joinpath("sweep", "programme.yaml").read_text()
TURN = TEXT[TEXT.index("programme:\n  kick") : TEXT.index("\ntarget:")]
TABLE = """programme:
  over: {over}
  table: [[0.0, 90.0, 60.0], [{at}, 90.0, 60.0], [{at}, 80.0, 60.0], [{to}, 40.0, 90.0]]
  horizon: {horizon}
  beyond: {beyond}
  until: {until}
"""


def mission(programme=TURN):
    return parse_mission(TEXT.replace(TURN, programme), "x.yaml")


def tabled(over="time_s", at=10.0, to=110.0, horizon="local", beyond="constant", until=None):
    until = until or "{time_s: 150.0}"
    return TABLE.format(over=over, at=at, to=to, horizon=horizon, beyond=beyond, until=until)


#: Replacement in the mission's file, and the message.
BROKEN = {
    "neither form": (
        TURN,
        "programme: {until: {time_s: 9.0}}\n",
        "programme.table is missing; expected a list of knots, or a kick in its place",
    ),
    "a table over nothing": (
        TURN,
        "programme: {table: [[0, 90, 60]]}\n",
        "programme.over is missing; expected time_s, altitude_m or speed_m_s",
    ),
    "both forms": (
        "  kick_deg: 4.0\n",
        "  kick_deg: 4.0\n  over: time_s\n",
        "programme.over is 'time_s'; expected no such key beside kick",
    ),
    "a kick into nowhere": (
        "  azimuth_deg: 60.5\n",
        "",
        "programme.azimuth_deg is missing; expected a number in deg",
    ),
    "a kick at no time": (
        "  kick: {speed_m_s: 60.0}\n",
        "",
        "programme.kick is missing; expected one of time_s, altitude_m, speed_m_s",
    ),
    "a kick at two times": (
        "{speed_m_s: 60.0}",
        "{speed_m_s: 60.0, time_s: 3.0}",
        "programme.kick.speed_m_s is 60.0; expected no such key beside time_s",
    ),
    "a kick at the end of a stage": (
        "kick: {speed_m_s: 60.0}",
        "kick: {end_of: first}",
        "programme.kick.end_of is not a known key",
    ),
    "a kick of radians": (
        "kick_deg: 4.0",
        "kick_rad: 0.07",
        "programme.kick_rad is not a known key",
    ),
    "knots that fall": (
        TURN,
        "programme: {over: altitude_m, table: [[0, 90, 60], [500, 80, 60], [400, 70, 60]]}\n",
        "programme.table[2][0] is 400.0; expected 500 again, or at least 500.001",
    ),
    "a pitch beyond the vertical": (
        TURN,
        "programme: {over: time_s, table: [[0, 95, 60]]}\n",
        "programme.table[0][1] is 95; expected a number from -90 to 90",
    ),
    "an end with no arc": (
        "end_of: first",
        "end_of: boost",
        (
            "programme.until.end_of is 'boost'; expected the name of a stage, a burn or a coast: "
            "first, second"
        ),
    ),
    "an end with the last arc": (
        "end_of: first",
        "end_of: second",
        (
            "programme.until.end_of is 'second'; expected an arc before the last; without until "
            "it flies all of them"
        ),
    ),
    "an end before the start": (
        "until: {end_of: first}",
        "until: {time_s: 0.0}",
        "programme.until.time_s is 0.0; expected a time after initial_state.time_s, 0 s",
    ),
    "an end before the kick": (
        "until: {end_of: first}",
        "until: {speed_m_s: 50.0}",
        "programme.until.speed_m_s is 50.0; expected more than 60, that of its kick",
    ),
    "an end of no kind": (
        "until: {end_of: first}",
        "until: {}",
        "programme.until.time_s is missing; expected one of time_s, altitude_m, speed_m_s, end_of",
    ),
    "no end, and a free burn": (
        "  until: {end_of: first}\n",
        "",
        (
            "stages[1].arcs[1].burn_time_s is 'free'; expected a time in s, because programme has "
            "no until"
        ),
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_wrong_programme_is_one_line(case):
    old, new, expected = BROKEN[case]
    assert TEXT.count(old) == 1
    with pytest.raises(MissionError) as caught:
        parse_mission(TEXT.replace(old, new), "x.yaml")
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def angles(made, t, r, v):
    """Return pitch and azimuth of the thrust over the horizon below, deg."""
    environment = made.arrays().environment[0]
    u = np.array(boost_direction(t, tuple(r), tuple(v), environment))
    east, north, up = (np.array(axis) for axis in horizon(tuple(r), environment))
    assert np.linalg.norm(u) == pytest.approx(1.0, abs=1e-12)
    return math.degrees(math.asin(u @ up)), math.degrees(math.atan2(u @ east, u @ north))


def state(made, up=0.0, climb=0.0, east=0.0):
    """Return position and velocity above the pad: altitude over it m, speeds over ground m/s."""
    start = made.start()
    environment = made.arrays().environment[0]
    axes = horizon(tuple(start.position), environment)
    r = start.position + up * np.array(axes[2])
    turn = environment["rotation_rate"] * np.array([-r[1], r[0], 0.0])
    return r, turn + climb * np.array(axes[2]) + east * np.array(axes[0])


def test_a_table_over_time_is_straight_between_its_knots_and_may_jump():
    made = mission(tabled())
    r, v = state(made, 5000.0, 300.0)
    assert angles(made, 9.99, r, v)[0] == pytest.approx(90.0)
    assert angles(made, 10.0, r, v) == pytest.approx((80.0, 60.0))
    assert angles(made, 60.0, r, v) == pytest.approx((60.0, 75.0))
    assert angles(made, 500.0, r, v) == pytest.approx((40.0, 90.0))


def test_a_table_goes_by_altitude_or_by_speed_in_the_air():
    made = mission(tabled("altitude_m", 1020.0, 2020.0))
    assert angles(made, 0.0, *state(made, 1500.0))[0] == pytest.approx(60.0, abs=0.01)
    made = mission(tabled("speed_m_s", 100.0, 200.0))
    assert angles(made, 0.0, *state(made, 900.0, 150.0))[0] == pytest.approx(60.0)


def test_the_horizon_of_the_launch_does_not_turn():
    there = 1e5 * np.array([0.0, 10.0, 0.0])
    local, launch = mission(tabled()), mission(tabled(horizon="launch"))
    r, v = state(local, 5000.0, 300.0)
    assert angles(launch, 60.0, r, v) == pytest.approx(angles(local, 60.0, r, v))
    environment = launch.arrays().environment[0]
    here = boost_direction(60.0, tuple(r), tuple(v), environment)
    assert boost_direction(60.0, tuple(r + there), tuple(v), environment) == pytest.approx(here)


def test_a_kick_is_held_until_the_velocity_is_as_low_and_followed_then():
    made = mission()
    assert angles(made, 3.0, *state(made, 100.0, 59.0))[0] == pytest.approx(90.0)
    # steeper than the kick of 4 deg, then lower
    assert angles(made, 9.0, *state(made, 300.0, 61.0, 1.0)) == pytest.approx((86.0, 60.5))
    assert angles(made, 9.0, *state(made, 300.0, 60.0, 60.0)) == pytest.approx((45.0, 90.0))


def test_a_programme_ends_where_it_says():
    made = mission()
    names, environment = made.arc_names, made.arrays().environment[0]
    r, v = (tuple(x) for x in state(made, 100.0))
    assert names == ("first", "second", "second")
    assert [bool(is_over(1e3, r, v, k, environment)) for k in range(3)] == [False, True, True]
    by_time = mission(tabled()).arrays().environment[0]
    assert [bool(is_over(t, r, v, 0, by_time)) for t in (149.9, 150.0)] == [False, True]
    high = mission(tabled(until="{altitude_m: 5000.0}")).arrays().environment[0]
    r, v = (tuple(x) for x in state(made, 5000.0))
    assert altitude(r, high) > 5000.0
    assert is_over(0.0, r, v, 0, high)


def test_a_mission_without_one_is_as_before():
    made = mission("")
    environment = made.arrays().environment[0]
    r, v = (tuple(x) for x in state(made, 100.0))
    assert is_over(0.0, r, v, 0, environment)
    assert '"programme":' not in made.model_dump_json()
    assert made.digest != mission().digest


def test_a_mission_flown_whole_by_its_programme_needs_no_plan():
    assert mission().needs_plan
    text = TEXT.replace("  until: {end_of: first}\n", "").replace(
        "burn_time_s: free", "burn_time_s: 300.0"
    )
    assert not parse_mission(text, "x.yaml").needs_plan
