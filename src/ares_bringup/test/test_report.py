# SPDX-License-Identifier: Apache-2.0
"""The tables: legible in 80 columns, plain when piped."""

import io
import math
import re

import pytest

from ares_bringup.observed import Diagnostic
from ares_bringup.report import console, number, print_summary, shown_path
from ares_bringup.summary import FlightSummary
from ares_trials.testing.flights import flown, good_flight, made_up_event, made_up_status
from ares_vehicle_sim.arrays import (
    CUTOFF,
    DEPLETION,
    FAILED,
    FLIGHT_COMPLETE,
    IMPACT,
    JETTISON_STUCK,
)


def printed(summary):
    file = io.StringIO()
    print_summary(summary, console(file))
    return file.getvalue()


def test_a_good_flight_in_80_columns(facts):
    summary = good_flight(facts)
    summary.add_status(made_up_status(1))
    summary.add_diagnostic(Diagnostic(1.0, "guidance", "WARN", "something"))
    summary.set_rate(300.0, 2.0)
    text = printed(summary)
    assert max(len(line) for line in text.splitlines()) <= 80
    assert "\x1b" not in text
    for word in ("target", "predicted", "flown", "error", "jettison: fairing", "500.00 kg"):
        assert word in text
    assert "150 times real time" in text
    assert "6,600.0000" in text
    assert "flown by peg" not in text
    # another law that had no solution of its own
    summary.guidance = "igm"
    assert re.search(r"flown by peg +1 cycles", printed(summary))


def test_only_an_end_by_cut_off_is_compared_with_the_plan(facts):
    end, failed = made_up_event(FLIGHT_COMPLETE, 401.0), made_up_event(FAILED, 300.0)
    cut_off = made_up_event(CUTOFF, 400.0)
    missed = made_up_event(FLIGHT_COMPLETE, 401.0, speed=7690.0)
    for events, compared in (
        ((cut_off, end), True),
        ((failed, cut_off, end), True),
        ((cut_off, missed), True),
        ((failed, cut_off, missed), False),
        ((made_up_event(JETTISON_STUCK, 300.0), cut_off, missed), False),
        ((failed, end), False),
        ((made_up_event(DEPLETION, 300.0), end), False),
        ((cut_off, made_up_event(IMPACT, 500.0)), False),
    ):
        summary = flown(facts, *events)
        summary.planned_m_f_kg = 510.0
        assert ("500.00 kg, 1.961 % below the plan's 510.00 kg" in printed(summary)) == compared
        assert ("the plan's" in printed(summary)) == compared


@pytest.mark.parametrize("wide", ["40", "200"])
def test_a_pipe_has_80_columns_whatever_the_terminal(facts, monkeypatch, wide):
    monkeypatch.setenv("COLUMNS", wide)
    assert "6,600.0000  7,700.0000" in printed(good_flight(facts))


def test_a_flight_that_never_began(facts):
    text = printed(FlightSummary(facts, "peg"))
    assert "the flight did not come to its end" in text
    assert "nan" not in text


def test_shortcomings_are_printed(facts):
    assert "target missed: radius off by 200 m" in printed(good_flight(facts, radius=6.6e6 + 200.0))
    assert "met the ground" in printed(flown(facts, made_up_event(9, 300.0)))


def test_numbers():
    assert number(1234.5678, 2) == "1,234.57"
    assert number(math.nan, 2) == number(None, 2) == "-"


def test_paths_are_shown_as_one_would_type_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert shown_path(str(tmp_path / "bags" / "one")) == "bags/one"
