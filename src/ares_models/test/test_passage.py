# SPDX-License-Identifier: Apache-2.0
"""Mach 1 and the greatest dynamic pressure of a climb."""

import numpy as np
import pytest

from ares_models.passage import AirState, Passage, passage_of


def climb(**changes):
    """Make a climb of 100 s: Mach 2 at its end, 30 kPa at 60 s, then thinner air."""
    time = np.arange(101.0)
    return {
        "time": time,
        "altitude": 10.0 * time**1.5,
        "mass": 1000.0 - time,
        "dynamic_pressure": 3e4 * np.exp(-(((time - 60.0) / 15.0) ** 2)),
        "mach": 0.02 * time + 0.005,
        **changes,
    }


def test_mach_1_lies_between_two_states_and_max_q_is_one():
    passage = passage_of(climb())
    assert passage.mach_1.time_s == pytest.approx(49.75)
    assert passage.mach_1.mass_kg == pytest.approx(950.25)
    assert passage.mach_1.mach == pytest.approx(1.0)
    assert (passage.max_q.time_s, passage.max_q.dynamic_pressure_pa) == (60.0, 3e4)


def test_what_is_met_on_a_fall_back_does_not_count():
    time = np.arange(101.0)
    passage = passage_of(climb(altitude=np.where(time < 20.0, time, 20.0 - time)))
    assert passage.mach_1 is None
    assert passage.max_q.time_s < 20.0


def test_a_climb_that_begins_beyond_both_has_neither():
    rows = slice(70, None)
    passage = passage_of({name: values[rows] for name, values in climb().items()})
    assert (passage.mach_1, passage.max_q) == (None, None)


def test_when_it_is_beyond_max_q_and_when_out_of_the_air():
    passage, said = Passage(), []
    for numbers in zip(*climb().values(), strict=True):
        passage.add(AirState(*map(float, numbers)))
        said.append((passage.beyond_max_q, passage.left_s))
    assert [beyond for beyond, _ in said].index(True) == 65
    # 50 Pa
    assert [left for _, left in said].index(98.0) == 98
    assert {left for _, left in said[:98]} == {None}


def test_it_is_told_in_a_text_and_read_again():
    for passage in (passage_of(climb()), passage_of(climb(mach=np.zeros(101)))):
        read = Passage.from_text(passage.as_text())
        assert (read.mach_1, read.max_q) == (passage.mach_1, passage.max_q)


@pytest.mark.parametrize(
    "text", ["", "x", "1", "[]", "[1, 2]", "[[1], null]", "[[1, 2, 3, 4, 1e999], null]", "[{}, 1]"]
)
def test_what_is_no_such_text_is_none(text):
    assert Passage.from_text(text) is None
