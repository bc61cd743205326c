# SPDX-License-Identifier: Apache-2.0
"""Pace against the wall clock, without a clock."""

import pytest

from ares_models.units import NANOSECONDS
from ares_vehicle_sim.pace import LEAST_DELAY, Deadlines, FlightPace, why_no_pace

PERIOD_NS = NANOSECONDS // 10


@pytest.fixture
def pace():
    """Begin at wall time 50 s and flight time 1000 s, with ten states a second."""
    pace = FlightPace(0.1)
    pace.begin(50.0, 1000 * NANOSECONDS)
    return pace


def test_a_pace_is_zero_or_not_too_slow():
    assert not why_no_pace(0.0)
    assert not why_no_pace(1e-3)
    assert why_no_pace(1e-9) == "parameter pace is 1e-09; expected 0, or 0.001 up"


def test_a_state_is_due_a_period_after_the_one_before(pace):
    delay, line = pace.delay(50.01, 1000 * NANOSECONDS, 2.0, False)
    assert (delay, line) == (pytest.approx(0.04), "")
    delay, _ = pace.delay(50.01, 1000 * NANOSECONDS + PERIOD_NS, 2.0, False)
    assert delay == pytest.approx(0.09)
    assert pace.deadlines.states == 0


def test_a_short_delay_is_caught_up_and_a_long_one_is_not(pace):
    assert pace.delay(50.5, 1000 * NANOSECONDS, 1.0, False) == (0.0, "")
    assert pace.started_at == 50.0
    delay, line = pace.delay(51.6, 1000 * NANOSECONDS, 1.0, False)
    assert (delay, line) == (0.0, "behind its pace by 1.5 s: not made up for")
    assert pace.started_at == pytest.approx(51.5)


def test_real_time_counts_and_leaves_time_for_messages(pace):
    assert pace.delay(50.3, 1000 * NANOSECONDS, 1.0, True) == (LEAST_DELAY, "")
    assert (pace.deadlines.states, pace.deadlines.missed) == (1, 1)
    assert pace.deadlines.latest_s == pytest.approx(0.3)


def test_deadlines_are_counted():
    deadlines = Deadlines()
    deadlines.count(-0.09, 0.1)
    deadlines.count(0.02, 0.1)
    deadlines.note_age(3 * PERIOD_NS)
    deadlines.note_age(PERIOD_NS)
    assert str(deadlines) == (
        "real time: 1 of 2 deadlines missed, the latest state 120.0 ms after it was due; "
        "commands up to 0.3 s old"
    )
