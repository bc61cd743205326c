# SPDX-License-Identifier: Apache-2.0
"""Flight time: mission elapsed time as seconds, as integer nanoseconds and as a stamp."""

from builtin_interfaces.msg import Time

NANOSECONDS = 1_000_000_000
#: Range of times of a stamp, ns.
EARLIEST = -(2**31) * NANOSECONDS
LATEST = 2**31 * NANOSECONDS - 1


def ns_from_seconds(seconds: float) -> int:
    """Round a time in s to integer nanoseconds; raise ValueError if it is not finite."""
    try:
        return round(seconds * NANOSECONDS)
    except OverflowError as error:
        raise ValueError(f"time is {seconds}; expected a finite number of seconds") from error


def stamp_from_ns(nanoseconds: int) -> Time:
    """Convert a time in ns to a stamp; negative times keep a positive nanosec field.

    Times beyond the range of a stamp are clipped.
    """
    sec, nanosec = divmod(min(max(nanoseconds, EARLIEST), LATEST), NANOSECONDS)
    return Time(sec=sec, nanosec=nanosec)


def ns_from_stamp(stamp: Time) -> int:
    """Convert a stamp to ns."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def stamp_from_seconds(seconds: float) -> Time:
    """Convert a time in s to a stamp, to the nearest ns."""
    return stamp_from_ns(ns_from_seconds(seconds))


def seconds_from_stamp(stamp: Time) -> float:
    """Convert a stamp to s."""
    return ns_from_stamp(stamp) / NANOSECONDS
