# SPDX-License-Identifier: Apache-2.0
"""Vectors as tuples."""

import math

from hypothesis import example, given
from hypothesis import strategies as st

from ares_models.kernels.vectors import angle_between, turned_beyond

X = (3.0, 0.0, 0.0)


@example(0.1, 0.1)
@example(0.0, 0.0)
@given(st.floats(0.0, math.pi), st.floats(0.0, math.pi))
def test_what_has_turned_beyond_a_limit_is_at_a_larger_angle(angle, limit):
    y = (2.0 * math.cos(angle), 2.0 * math.sin(angle), 0.0)
    assert turned_beyond(limit, X, y) == (angle_between(X, y) > limit)


def test_a_vector_that_is_no_number_has_not_turned():
    assert not turned_beyond(0.1, X, (math.nan, 0.0, 0.0))
