# SPDX-License-Identifier: Apache-2.0
"""Orientation of the Earth at a date: sidereal time, the node of a local time.

UTC is used as UT1; they differ by at most 0.9 s, 0.004 deg.
"""

from datetime import UTC, datetime

#: Rotation of the Earth, rad/s (WGS 84).
EARTH_RATE = 7.292115e-5
#: Largest relative difference of a rotation rate that counts as the Earth's. Mars is 2.8 % slower.
LIKE_EARTH = 0.01

_J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
_DAY_S = 86_400.0


def turns_as_earth(rotation_rate: float) -> bool:
    """Return whether a rotation rate, rad/s, is the Earth's within LIKE_EARTH."""
    return abs(rotation_rate - EARTH_RATE) <= LIKE_EARTH * EARTH_RATE


def greenwich_sidereal_time_deg(moment: datetime) -> float:
    """Return Greenwich mean sidereal time, 0 to 360 deg.

    This is the right ascension of longitude zero from the mean equinox of date. IAU 1982: Aoki and
    others, Astronomy and Astrophysics 105 (1982), 359; Vallado, Fundamentals of Astrodynamics,
    Eq. 3-45.

    Args:
        moment: with its time zone.
    """
    days = (moment - _J2000).total_seconds() / _DAY_S
    t = days / 36_525.0
    seconds = 67_310.54841 + t * (8_640_184.812866 + t * (0.093104 - 6.2e-6 * t))
    # whole turns per day are added apart, to keep the last digits
    return (seconds / 240.0 + 360.0 * (days % 1.0)) % 360.0


def node_of_local_time_deg(moment: datetime, hours: float) -> float:
    """Return the right ascension of a node with a given local time, 0 to 360 deg.

    Local mean solar time differs from Greenwich's by the longitude, at 15 deg per hour.

    Args:
        moment: epoch of the right ascension, with its time zone.
        hours: mean local solar time of the passage.
    """
    utc = moment.astimezone(UTC)
    midnight = utc.replace(hour=0, minute=0, second=0, microsecond=0)
    since = (utc - midnight).total_seconds() / 3600.0
    return (greenwich_sidereal_time_deg(moment) + 15.0 * (hours - since)) % 360.0
