"""What follows for a launch when its processes end."""

import signal

import pytest

from ares_bringup.launch_verdict import LaunchVerdict


def status(*ends, interrupt_after=None):
    """Exit status after processes ended so, in this order."""
    verdict = LaunchVerdict()
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
    verdict = LaunchVerdict()
    lost = verdict.ended("guidance", -9)
    assert lost.line == (
        "guidance was killed by SIGKILL in flight: flying on with its last good command; "
        "restarted (1 of 3)"
    )
    assert (lost.tell_judge, lost.shut_down, lost.restart) == ("SIGRTMIN", False, True)
    recorder = verdict.ended("recorder", -9)
    assert (recorder.tell_judge, recorder.restart) == ("SIGUSR1", False)
    assert verdict.ended("vehicle_sim", -9).tell_judge == "SIGUSR2"
    assert verdict.ended("judge", 1).shut_down
    assert not verdict.ended("guidance", 0).restart
    assert not LaunchVerdict(shut_down_with_judge=False).ended("judge", 0).shut_down
    assert LaunchVerdict().ended("recorder", 2).shut_down
