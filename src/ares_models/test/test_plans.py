# SPDX-License-Identifier: Apache-2.0
"""Missions that guidance cannot fly without a plan."""

import numpy as np
import pytest

from ares_models.arrays import ARC, BURN, COAST
from ares_models.plans import LONG_COAST_S, coasts_long, leaves_arcs_free


def arcs_of(*pairs):
    arcs = np.zeros(len(pairs), ARC)
    arcs["kind"], arcs["duration"] = np.array(pairs).T
    return arcs


@pytest.mark.parametrize(
    ("length", "long"), [(1.0, False), (LONG_COAST_S, False), (LONG_COAST_S + 1.0, True)]
)
def test_a_long_coast_between_burns(length, long):
    assert coasts_long(arcs_of((BURN, 100.0), (COAST, length), (BURN, np.inf))) == long


def test_a_long_coast_before_the_first_burn_needs_no_plan():
    assert not coasts_long(arcs_of((COAST, 1000.0), (BURN, np.inf)))


def test_a_free_coast_is_counted_among_free_arcs():
    arcs = arcs_of((BURN, 100.0), (COAST, np.inf), (BURN, np.inf))
    assert leaves_arcs_free(arcs)
    assert not coasts_long(arcs)
