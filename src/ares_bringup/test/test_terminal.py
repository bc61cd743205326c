# SPDX-License-Identifier: Apache-2.0
"""The view of a flight on the terminal while it flies."""

import io
import math

import pytest

from ares_bringup.observed import GuidanceSample
from ares_bringup.report import WIDTH, console
from ares_bringup.terminal import picture
from ares_guidance.arrays import LAW_PEG
from ares_msgs.msg import VehicleState
from ares_node.time import stamp_from_ns
from ares_trials.testing.flights import RADIUS, SPEED, flown, made_up_status, state


def shown(summary, *, rate=2.0, silent=0.1, time_s=200.0):
    now = VehicleState(
        stamp=stamp_from_ns(round(time_s * 1e9)),
        velocity=[0.0, 3000.0, 4000.0],
        altitude=123_456.0,
        mass=1234.5,
    )
    text = io.StringIO()
    console(text).print(picture(summary, now, rate, silent))
    return text.getvalue()


def test_where_it_is_and_what_guidance_makes_of_it(facts):
    summary = flown(facts)
    position, velocity = state(radius=RADIUS + 0.25, speed=SPEED - 0.5)
    summary.add_status(GuidanceSample(195.0, 195, True, 8, 0, LAW_PEG, 400.0, position, velocity))
    text = shown(summary)
    assert max(map(len, text.splitlines())) <= WIDTH
    figures = {name: text.splitlines()[2].split()[k] for k, name in enumerate("hvmgs")}
    assert figures == {"h": "123.46", "v": "5,000.0", "m": "1,234.5", "g": "200.0", "s": "5.0"}
    assert "made_up: burn   t 200.0 s   2.0 times real time" in text
    assert "+2.50e-01   -5.00e-01" in text
    assert "last event: flight started at 100.00 s" in text


def test_what_is_unknown_is_said(facts):
    text = shown(flown(facts), rate=None, silent=7.2)
    assert "nothing heard for 7 s" in text
    assert "times real time" not in text
    assert "guidance has no solution yet" in text


@pytest.mark.parametrize("arc", [0, 7])
def test_an_arc_that_the_mission_lacks_has_its_number(facts, arc):
    summary = flown(facts)
    summary.add_status(made_up_status(1))
    text = io.StringIO()
    console(text).print(picture(summary, VehicleState(arc=arc), 1.0, 0.0))
    assert ("made_up: burn" if arc == 0 else "made_up: arc 7") in text.getvalue()


def test_in_the_boost_programme_the_air_is_shown_instead_of_a_solution(facts):
    summary = flown(facts)
    position, velocity = state()
    unknown = (150.0, 150, False, 0, 0, LAW_PEG, math.nan)
    summary.add_status(GuidanceSample(*unknown, position, velocity, boosts=True))
    text = shown(summary)
    assert max(map(len, text.splitlines())) <= WIDTH
    assert text.splitlines()[1].split() == (
        ["altitude,", "km", "speed,", "m/s", "mass,", "kg", "Mach", "dynamic", "pressure,", "kPa"]
    )
    assert "guidance flies the boost programme" in text
    assert "time to go" not in text
