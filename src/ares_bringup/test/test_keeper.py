# SPDX-License-Identifier: Apache-2.0
"""Restarts of nodes: which, how often, and the messages."""

import pytest

from ares_bringup.keeper import Keeper


@pytest.mark.parametrize("name", ["guidance", "optimizer", "view"])
def test_a_kept_node_is_restarted_and_given_up(name):
    keeper = Keeper(2)
    told = [keeper.ended(name, -9) for _ in range(3)]
    assert [again for _, again in told] == [True, True, False]
    assert [line.rpartition("; ")[2] for line, _ in told] == [
        "restarted (1 of 2)",
        "restarted (2 of 2)",
        "not restarted: 2 restarts were allowed",
    ]
    assert all(line.startswith(f"{name} was killed by SIGKILL") for line, _ in told)


def test_each_node_has_restarts_of_its_own():
    keeper = Keeper(1)
    assert keeper.ended("guidance", 1)[1]
    assert keeper.ended("view", 1)[1]
    assert not keeper.ended("guidance", 1)[1]
    assert keeper.restarted("guidance")
    assert not keeper.restarted("optimizer")


def test_a_node_that_cannot_start_is_not_tried_again():
    line, again = Keeper().ended("guidance", 2)
    assert not again
    assert line.endswith("; not restarted: it cannot start")


@pytest.mark.parametrize("name", ["recorder", "vehicle_sim", "live"])
def test_others_are_not_restarted(name):
    line, again = Keeper().ended(name, -9)
    assert not again
    assert "restarted" not in line
