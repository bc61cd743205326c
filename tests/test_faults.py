# SPDX-License-Identifier: Apache-2.0
"""Faults in real flights: one trial of each kind, and the judgement of trials."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import page_tables
from ares_bringup.commands import interrupts
from ares_bringup.commands.cli import main
from ares_bringup.held import shared_memory
from ares_bringup.keeper import Keeper
from ares_bringup.options import CannotStart
from ares_trials.faults import campaign, tampering
from ares_trials.faults.campaign import as_object, chosen, spread
from ares_trials.faults.control import Control
from ares_trials.faults.rows import ROWS
from ares_trials.faults.scene import MARK, FlightResult, marked
from ares_trials.faults.signals import slowed
from ares_trials.faults.trial import Class, Trial, judge, run
from ares_trials.testing.ros import own_words
from ares_trials.testing.samples import one_in

CONTROL = Control(begin_s=155.9, jettison_s=434.0, cutoff_s=767.1, mass_kg=174117.5)


@pytest.mark.parametrize(
    "name",
    [
        "signal to fly",
        *(
            pytest.param(name, marks=pytest.mark.trial)
            for name in (
                "commands delayed, to 10 %, to 1 s",
                # so does the test of the verdicts
                "guidance killed",
                "forged, no key: the flight is complete",
                "simulator restarted",
                "guidance stopped",
                "optimizer answers nonsense",
                "recorder killed",
                "commands jettison above the limit",
                "stamps ahead",
                "forged, no key: guidance has left",
                "forged, sealed: commands one state ahead",
            )
        ),
    ],
)
def test_a_trial_of_each_kind(name):
    trial = run(name, seed=1, number=0)
    assert trial.result != Class.WRONG.value, trial.why


def row(name):
    return next(row for row in ROWS if row.name == name)


def flown(said="", status=1, touched=1, must_reach=True, **summary):
    facts = {"must_reach": must_reach}
    plain = {"outcome": "target", "m_f_kg": 174000.0, "shortcomings": [], "diagnostics": []}
    return FlightResult(status, plain | summary, said, touched, facts=facts)


SAID = f"flown without an answer from guidance for 3.0 s\n{Keeper().ended('guidance', -9)[0]}"


@pytest.mark.parametrize(
    ("result", "expected"),
    [
        (flown(SAID), Class.SURVIVED),
        (flown(SAID, outcome="target_missed"), Class.WRONG),
        (flown(SAID, outcome="target_missed", must_reach=False), Class.DEGRADED),
        (flown(SAID, outcome="impact", must_reach=False), Class.WRONG),
        (flown(SAID, status=0), Class.WRONG),
        (flown(""), Class.WRONG),
        (flown(SAID + "\nTraceback (most recent call last):"), Class.WRONG),
        (flown(SAID, status=None), Class.WRONG),
        (FlightResult(1, flown().summary, SAID, left=["a process"]), Class.WRONG),
        (FlightResult(2, {}, "ares: cannot"), Class.WRONG),
    ],
)
def test_a_flight_under_a_fault_is_judged(result, expected):
    assert judge(row("guidance killed"), result, CONTROL)[0] is expected


@pytest.mark.parametrize(("mass", "expected"), [(CONTROL.mass_kg, "survived"), (174117.0, "wrong")])
def test_a_fault_that_touched_nothing_leaves_no_trace(mass, expected):
    result = flown("", status=0, touched=0, m_f_kg=mass)
    assert judge(row("commands lost, to 10 %"), result, CONTROL)[0].value == expected


def test_what_cannot_be_told_need_not_be_said():
    result = flown("", status=0)
    drift = row("navigation drifts slowly")
    assert judge(drift, result, CONTROL)[0] is Class.WRONG
    result.facts["can_be_told"] = False
    assert judge(drift, result, CONTROL)[0] is Class.SURVIVED


def test_the_flight_without_a_fault_reaches_the_target():
    summary = {
        "outcome": "target",
        "shortcomings": [],
        "events": [{"t_s": CONTROL.begin_s}],
        "t_plf_s": CONTROL.jettison_s,
        "t_meco_s": CONTROL.cutoff_s,
        "m_f_kg": CONTROL.mass_kg,
    }
    assert Control.of(summary) == CONTROL
    for bad in ({}, summary | {"outcome": "impact"}, summary | {"shortcomings": ["late"]}):
        with pytest.raises(CannotStart, match="without a fault is not as it should be"):
            Control.of(bad)


@pytest.mark.parametrize(
    ("own", "others", "cores", "factor"),
    [
        (1, 0, 2, 1.0),
        (5, 0, 2, 1.0),
        (1, 1, 2, 1.0),
        (1, 3, 2, 2.0),
        (4, 4, 2, 2.0),
        (0, 9, 2, 1.0),
    ],
)
def test_time_as_the_machine_gives_it(own, others, cores, factor):
    assert slowed(own, others, cores) == factor


def test_tampering_is_drawn():
    def fates(seed):
        tamper = tampering.delay(np.random.default_rng(seed), 0.5, 3.0)
        return [tamper(0.0, k) for k in range(100)]

    assert fates(1) == fates(1) != fates(2)
    late = [delay for fate in fates(1) for delay, _ in fate if delay]
    assert 30 < len(late) < 70
    assert 0.0 < min(late) < max(late) < 3.0
    lost = tampering.lose(np.random.default_rng(1), 0.5)
    assert {len(lost(0.0, k)) for k in range(100)} == {0, 1}


def test_the_table_counts():
    trials = [
        Trial("guidance killed", 0, 0, "survived"),
        Trial("guidance killed", 0, 1, "wrong", "hung"),
        Trial("guidance stopped", 0, 0, "degraded", "late"),
    ]
    result = as_object(trials, 3, 0)
    assert [result[key] for key in ("injected", "survived", "degraded", "wrong")] == [3, 1, 1, 1]
    assert [line["row"] for line in result["rows"]] == ["guidance killed", "guidance stopped"]
    assert [trial["why"] for trial in result["trials"]] == ["hung", "late"]


def test_rows_are_chosen_by_word_and_taken_in_turn(capsys):
    names = chosen(["guidance"])
    assert set(names) >= {"guidance killed", "guidance stopped"}
    assert spread(names[:2], 3) == [(names[0], 0), (names[1], 0), (names[0], 1)]
    assert len(chosen([])) == len(ROWS) == len({row.name for row in ROWS})
    assert main(["faults", "--rows", "gremlins"]) == 2
    assert "--rows is 'gremlins'; expected a part of one of: guidance killed" in (
        capsys.readouterr().err
    )


@pytest.mark.trial
@pytest.mark.parametrize(
    ("number", "status"), one_in(2, [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
)
def test_a_campaign_that_is_interrupted_in_a_flight_says_so(number, status):
    mark = f"interrupted-{os.getpid()}-{status}"
    command = [sys.executable, "-m", "ares_bringup", "faults", "-n", "1"]
    process = subprocess.Popen(
        command,
        env=os.environ | {MARK: mark},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60.0
    while not any("fastrtps" in path for path in shared_memory(marked(mark))):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    said = "ares: interrupted; 0 of 1 faults were flown, none is kept\n"
    assert (out, own_words(err)) == ("", said)
    assert process.returncode == status


def test_the_pages_hold_what_was_kept():
    for table in page_tables.TABLES:
        assert table.filled() == table.page.read_text()
        assert table.page.read_text().count(page_tables.BEGIN) == 1
    reliability, links = (json.loads(table.result.read_text()) for table in page_tables.TABLES)
    assert page_tables.TABLES[0].page.read_text().count("\n| all |") == 1
    # each row of the page is a flight that was judged
    assert all(row["mass_kg"] > 0.0 and row["outcome"] for row in links["rows"])
    # each row that there is was tried
    assert {line["row"] for line in reliability["rows"]} == {row.name for row in ROWS}


def test_faults_say_how_many_were_flown(monkeypatch, capfd):
    def fly_three(tasks, seed, _workers, done):
        for name, number in tasks[:3]:
            done(campaign.Trial(name, seed, number, campaign.Class.SURVIVED.value))
        raise interrupts.Interrupted

    monkeypatch.setattr(interrupts, "GRACE", interrupts.GRACE)
    monkeypatch.setattr(interrupts, "_told", [])
    monkeypatch.setattr(campaign, "fly_all", fly_three)
    assert campaign.faults(8, 1, (), 1, False) == 130
    assert capfd.readouterr() == ("", "ares: interrupted; 3 of 8 faults were flown, none is kept\n")
    # its flights are ended by then
    assert interrupts.GRACE >= campaign.CLOSE_TIMEOUT
