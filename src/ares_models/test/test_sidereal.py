# SPDX-License-Identifier: Apache-2.0
"""Sidereal time and local time, against printed examples."""

from datetime import UTC, datetime, timedelta, timezone

import pytest

from ares_models.sidereal import (
    greenwich_sidereal_time_deg,
    node_of_local_time_deg,
    turns_as_earth,
)


@pytest.mark.parametrize(
    ("moment", "degrees"),
    [
        # Vallado, Fundamentals of Astrodynamics, example 3-5
        (datetime(1992, 8, 20, 12, 14, tzinfo=UTC), 152.578787810),
        # Meeus, Astronomical Algorithms, examples 12.a and 12.b
        (datetime(1987, 4, 10, tzinfo=UTC), 15.0 * (13 + 10 / 60 + 46.3668 / 3600)),
        (datetime(1987, 4, 10, 19, 21, tzinfo=UTC), 128.7378734),
    ],
)
def test_sidereal_time_is_what_books_print(moment, degrees):
    assert greenwich_sidereal_time_deg(moment) == pytest.approx(degrees, abs=2e-7)
    elsewhere = moment.astimezone(timezone(timedelta(hours=5)))
    assert greenwich_sidereal_time_deg(elsewhere) == greenwich_sidereal_time_deg(moment)


def test_a_node_at_noon_points_to_the_mean_sun():
    # the mean sun passes the equinox near 20 March and goes round once a year
    for month, right_ascension in ((3, 0.0), (6, 90.0), (9, 180.0), (12, 270.0)):
        moment = datetime(2026, month, 21, 6, 30, tzinfo=UTC)
        found = node_of_local_time_deg(moment, 12.0)
        assert abs((found - right_ascension + 180.0) % 360.0 - 180.0) < 3.0
    at = datetime(2026, 3, 21, 6, 30, tzinfo=UTC)
    apart = node_of_local_time_deg(at, 22.5) - node_of_local_time_deg(at, 10.5)
    assert apart % 360.0 == pytest.approx(180.0)
    # the local time at longitude zero is that of Greenwich
    assert node_of_local_time_deg(at, 6.5) == pytest.approx(greenwich_sidereal_time_deg(at))


def test_the_moon_and_mars_do_not_turn_as_the_earth():
    # a day taken for sidereal is still the Earth's
    assert turns_as_earth(7.2921159e-5) and turns_as_earth(7.2722e-5)
    assert not turns_as_earth(2.6617e-6) and not turns_as_earth(7.0882e-5)
