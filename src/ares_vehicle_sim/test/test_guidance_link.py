# SPDX-License-Identifier: Apache-2.0
"""Patience with guidance, without a guidance."""

import pytest

from ares_vehicle_sim.link import PLAN_PATIENCE, GuidanceLink


def test_the_wait_is_shorter_after_each_loss():
    link = GuidanceLink(5.0)
    for lost, patience in ((0, 5.0), (1, 1.0), (2, 0.2)):
        link.lost_in_a_row = lost
        link.wait(100.0)
        assert link.patience_s == pytest.approx(patience)
        assert link.deadline == pytest.approx(100.0 + patience)


def test_an_answer_is_overdue_while_it_is_waited_for():
    link = GuidanceLink(5.0)
    assert not link.is_overdue(1e9, False)
    link.wait(100.0)
    assert not link.is_overdue(104.9, False)
    assert link.is_overdue(105.0, False)
    link.waiting = False
    assert not link.is_overdue(105.0, False)


def test_a_plan_takes_longer_without_a_pace():
    link = GuidanceLink(5.0)
    link.wait(100.0)
    link.planning_since = 100.0
    assert link.is_overdue(105.0, True)
    assert not link.is_overdue(105.0, False)
    assert link.is_overdue(100.0 + 5.0 * PLAN_PATIENCE, False)


def test_late_answers_count_ever_more_rarely_on_a_lost_link():
    link = GuidanceLink(5.0)
    assert not link.heeds_late_answer(10)
    waits = []
    for _ in range(4):
        link.lose(100)
        first = next(k for k in range(100, 200) if link.heeds_late_answer(k))
        waits.append(first - 100)
        assert link.regain(2)
    assert waits == [0, 1, 3, 7]
    assert not link.regain(0)
    assert link.lost_in_a_row == 0
