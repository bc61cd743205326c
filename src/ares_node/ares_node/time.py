# SPDX-License-Identifier: Apache-2.0
"""Flight time: mission elapsed time as seconds, as integer nanoseconds and as a stamp."""

from builtin_interfaces.msg import Time

NANOSECONDS = 1_000_000_000
#: The times that a stamp can hold, ns.
EARLIEST = -(2**31) * NANOSECONDS
LATEST = 2**31 * NANOSECONDS - 1


def ns_from_seconds(seconds: float) -> int:
    """Nearest integer nanosecond of a time in s. Raises ValueError if it is not finite."""
    try:
        return round(seconds * NANOSECONDS)
    except OverflowError as error:
        raise ValueError(f"time is {seconds}; expected a finite number of seconds") from error


def seconds_from_ns(nanoseconds: int) -> float:
    """Time in s."""
    return nanoseconds / NANOSECONDS


def stamp_from_ns(nanoseconds: int) -> Time:
    """The stamp of a time in ns; times before zero keep a positive nanosec field.

    What lies beyond the times that a stamp can hold becomes the nearest of them.
    """
    sec, nanosec = divmod(min(max(nanoseconds, EARLIEST), LATEST), NANOSECONDS)
    return Time(sec=sec, nanosec=nanosec)


def ns_from_stamp(stamp: Time) -> int:
    """Time of a stamp in ns."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def stamp_from_seconds(seconds: float) -> Time:
    """The stamp of a time in s, to the nearest ns."""
    return stamp_from_ns(ns_from_seconds(seconds))


def seconds_from_stamp(stamp: Time) -> float:
    """Time of a stamp in s."""
    return ns_from_stamp(stamp) / NANOSECONDS
