# SPDX-License-Identifier: Apache-2.0
"""Flight time keeps every nanosecond."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ares_node.time import (
    ns_from_seconds,
    ns_from_stamp,
    seconds_from_stamp,
    stamp_from_ns,
    stamp_from_seconds,
)


@given(st.integers(-(2**31) * 10**9, (2**31 - 1) * 10**9))
def test_stamp_round_trip(nanoseconds: int) -> None:
    stamp = stamp_from_ns(nanoseconds)
    assert 0 <= stamp.nanosec < 10**9
    assert ns_from_stamp(stamp) == nanoseconds


def test_tenths_of_a_second_are_exact() -> None:
    for tick in range(10_000):
        assert ns_from_seconds(155.9 + tick * 0.1) == 155_900_000_000 + tick * 100_000_000
    assert seconds_from_stamp(stamp_from_seconds(155.9)) == 155.9


@pytest.mark.parametrize("seconds", [math.inf, -math.inf, math.nan])
def test_not_finite_is_refused(seconds: float) -> None:
    with pytest.raises(ValueError, match=r"inf|NaN"):
        ns_from_seconds(seconds)
