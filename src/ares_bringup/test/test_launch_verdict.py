# SPDX-License-Identifier: Apache-2.0
"""Consequences for a launch when its processes end."""

import signal
from pathlib import Path

import pytest

from ares_bringup.launch_verdict import LaunchVerdict, is_launched_itself

NODES = ("vehicle_sim", "guidance", "judge", "recorder", "optimizer")


def launched(**options):
    """Make the verdict on a flight whose processes run."""
    verdict = LaunchVerdict(**options)
    verdict.start(NODES)
    for name in NODES:
        verdict.started(name)
    return verdict


def status(*ends, interrupt_after=None):
    """Return the exit status after processes have ended in this order."""
    verdict = launched()
    for number, (name, code) in enumerate(ends):
        if number == interrupt_after:
            verdict.interrupt()
        verdict.ended(name, code)
    return verdict.status


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        ([("judge", 0)], 0),
        ([("judge", 1)], 1),
        ([("judge", 2)], 2),
        ([("judge", 130)], 130),
        ([("judge", 0), ("vehicle_sim", 0), ("guidance", 0)], 0),
        # what the judge cannot have seen counts too
        ([("judge", 0), ("recorder", 1)], 1),
        ([("judge", 0), ("guidance", -9)], 1),
        ([("guidance", -9), ("judge", 0)], 1),
        ([("recorder", 1), ("judge", 0)], 1),
        # a judge that was not up yet when it was told
        ([("guidance", -9), ("judge", -signal.SIGRTMIN)], 2),
        ([("recorder", -9), ("judge", -signal.SIGUSR1)], 2),
        # one that is killed has given no verdict
        ([("judge", -signal.SIGKILL)], 1),
        ([("judge", 139)], 1),
        # a node that was done, and whose middleware hung
        ([("judge", -signal.SIGALRM), ("recorder", -signal.SIGALRM)], 0),
        # a lost optimizer costs nothing
        ([("optimizer", -9), ("judge", 0)], 0),
        ([("judge", 0), ("optimizer", -9)], 0),
        # who cannot start has the word
        ([("recorder", 2), ("judge", 130)], 2),
        ([("vehicle_sim", 2), ("judge", 0)], 2),
        # once it has flown it is a loss
        ([("guidance", -9), ("guidance", 2), ("judge", 0)], 1),
        # no judge, no success
        ([], 130),
        ([("vehicle_sim", 0)], 130),
    ],
)
def test_the_status(ends, expected):
    assert status(*ends) == expected


def test_an_interrupt_counts_until_the_judge_has_spoken():
    assert status(("judge", 0), interrupt_after=0) == 130
    assert status(("judge", 0), ("vehicle_sim", 0), interrupt_after=1) == 0


def test_what_launch_must_do():
    verdict = launched()
    lost = verdict.ended("guidance", -9)
    assert lost.line == (
        "guidance was killed by SIGKILL in flight: flying on with its last good command; "
        "restarted (1 of 3)"
    )
    assert (lost.tell_judge, lost.shut_down, lost.restart) == (signal.SIGRTMIN, False, True)
    recorder = verdict.ended("recorder", -9)
    assert (recorder.tell_judge, recorder.restart) == (signal.SIGUSR1, False)
    assert verdict.ended("vehicle_sim", -9).tell_judge == signal.SIGUSR2
    assert verdict.ended("judge", 1).shut_down
    assert not verdict.ended("guidance", 0).restart
    assert not launched(shut_down_with_judge=False).ended("judge", 0).shut_down
    assert launched().ended("recorder", 2).shut_down
    # launch takes no name for a signal
    assert isinstance(lost.tell_judge, signal.Signals)


def test_a_judge_without_a_verdict_is_said():
    killed = launched().ended("judge", -9)
    assert killed.line == "judge was killed by SIGKILL: the flight ends without its verdict"
    assert killed.shut_down


def test_what_the_judge_cannot_have_seen_is_said():
    verdict = launched()
    verdict.ended("judge", 0)
    assert verdict.ended("guidance", -11).line == "guidance was killed by SIGSEGV after the flight"
    assert not verdict.ended("vehicle_sim", 0).line
    assert not verdict.ended("optimizer", -11).line


def test_a_node_that_ends_before_the_judge_is_up_ends_the_flight():
    verdict = LaunchVerdict()
    verdict.start(NODES)
    follows = verdict.ended("recorder", -9)
    assert (follows.tell_judge, follows.shut_down, verdict.status) == (None, True, 2)


def test_who_waits_to_be_started_again_is_not_waited_for():
    verdict = launched()
    assert verdict.ended("guidance", -9).restart
    assert verdict.ended("judge", 2).shut_down
    assert verdict.running == {"vehicle_sim", "recorder", "optimizer"}


def test_what_still_runs():
    verdict = launched()
    verdict.ended("guidance", -9)
    assert verdict.running == set(NODES)
    verdict.started("guidance")
    verdict.ended("judge", 0)
    for name in ("vehicle_sim", "recorder", "optimizer"):
        verdict.ended(name, 0)
    # one that was started again, and is up when the judge has spoken
    assert verdict.running == {"guidance"}
    verdict.ended("guidance", 0)
    assert not verdict.running


@pytest.mark.parametrize(
    ("words", "itself"),
    [
        (
            ["/opt/ros/jazzy/bin/ros2", "launch", "ares_bringup", "flight.launch.py", "pace:=1"],
            True,
        ),
        (["ros2", "launch", "-d", "ares_bringup", "flight.launch.py"], True),
        (["ros2", "launch", "{file}", "bag:=/b"], True),
        # a file of the same name that includes it
        (["ros2", "launch", "their_bringup", "flight.launch.py"], False),
        (["ros2", "launch", "their_bringup", "all.launch.py", "file:={file}"], False),
        (["their_program"], False),
        ([], False),
    ],
)
def test_whose_exit_status_it_is(tmp_path, words, itself):
    file = Path(tmp_path / "flight.launch.py")
    file.touch()
    given = [word.format(file=file) for word in words]
    assert is_launched_itself(file, given) == itself
