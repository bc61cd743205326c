# SPDX-License-Identifier: Apache-2.0
"""Attitude programmes: where their knots are."""

import numpy as np

from ares_guidance.programme import Programme
from ares_models.arrays import NAVIGATION


def a_climb_and_a_coast() -> Programme:
    """Return a programme with a corner at 50 s, and a coast of three hours after 400 s."""
    climb = np.linspace(0.0, 400.0, 801)
    coast = np.linspace(400.0, 11_200.0, 4_001)
    time = np.concatenate((climb, coast))
    pitch = np.where(time < 50.0, 1.5 - 2e-4 * time**2, 1.0 - 2e-3 * (np.minimum(time, 400) - 50))
    return Programme(
        np.repeat([0, 1], [len(climb), len(coast)]),
        time,
        np.maximum.accumulate(np.concatenate((25.0 * climb + 2e-2 * climb**2, 0.0 * coast))),
        np.column_stack((np.sin(pitch), np.cos(pitch), 0.0 * pitch)),
        np.tile([0.0, 0.0, 1.0], (len(time), 1)),
        np.zeros(len(time)),
        np.zeros(1, NAVIGATION),
    )


def test_knots_are_where_the_attitude_turns_and_not_where_the_flight_is_long() -> None:
    whole = a_climb_and_a_coast()
    thin = whole.thinned(64)
    assert len(thin.time) <= 64
    assert (thin.arc == 1).sum() == 2
    at = np.interp(whole.speed[:801], thin.speed[thin.arc == 0], thin.time[thin.arc == 0])
    off = [
        np.interp(at, thin.time, thin.direction[:, c]) - whole.direction[:801, c] for c in range(3)
    ]
    assert np.abs(off).max() < 1e-3
    assert (np.diff(thin.time) >= 0.0).all()


def test_a_programme_that_is_straight_needs_the_ends_of_its_arcs_alone() -> None:
    whole = a_climb_and_a_coast()
    straight = whole._replace(
        direction=np.tile([0.0, 0.0, 1.0], (len(whole.time), 1)), speed=whole.time
    )
    thin = straight.thinned(64)
    assert list(thin.time) == [0.0, 400.0, 400.0, 11_200.0]


def test_knots_follow_the_load_relief_where_there_is_one() -> None:
    whole = a_climb_and_a_coast()._replace(relief=np.zeros(4802))
    whole.relief[:801] = np.sin(np.linspace(0.0, 20.0, 801))
    thin = whole.thinned(128)
    first = thin.arc == 0
    at = np.interp(whole.speed[:801], thin.speed[first], thin.time[first])
    assert (
        np.abs(np.interp(at, thin.time[first], thin.relief[first]) - whole.relief[:801]).max()
        < 0.05
    )
