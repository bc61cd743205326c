# SPDX-License-Identifier: Apache-2.0
"""Pace of a flight against the wall clock, and the deadlines of real time. No ROS."""

from dataclasses import dataclass

from ares_models.units import NANOSECONDS

#: Slowest real-time factor.
MIN_PACE = 1e-3
#: Largest delay that a paced flight catches up, wall time, s; a longer gap stays.
LONGEST_CATCH_UP = 0.5
#: Least time for messages between two steps in real time, wall time, s.
LEAST_DELAY = 1e-4


def why_no_pace(pace: float) -> str:
    """Return the reason to refuse a pace, one line, or ""."""
    if 0.0 < pace < MIN_PACE:
        return f"parameter pace is {pace!r}; expected 0, or {MIN_PACE:g} up"
    return ""


@dataclass
class Deadlines:
    """Count the deadlines of a flight in real time; a state is due when its period begins.

    Attributes:
        states: published navigation states.
        missed: states published after the next was due.
        latest_s: largest delay of a state, wall time, s.
        age_ns: largest age of a command in force, flight time, ns.
    """

    states: int = 0
    missed: int = 0
    latest_s: float = 0.0
    age_ns: int = 0

    def count(self, late_s: float, period_s: float) -> None:
        """Count a published state; times are wall time, s.

        Args:
            late_s: time since the next state was due; negative before.
            period_s: time between two states.
        """
        self.states += 1
        self.missed += late_s > 0.0
        self.latest_s = max(self.latest_s, late_s + period_s)

    def note_age(self, age_ns: int) -> None:
        """Note the age of the command in force, flight time, ns."""
        self.age_ns = max(self.age_ns, age_ns)

    def __str__(self) -> str:
        """Format the counts in one line."""
        return (
            f"real time: {self.missed} of {self.states} deadlines missed, the latest state "
            f"{1e3 * self.latest_s:.1f} ms after it was due; commands up to "
            f"{self.age_ns / NANOSECONDS:.9g} s old"
        )


class FlightPace:
    """Hold a flight to the wall clock.

    Attributes:
        deadlines: those of real time.
        started_at: wall time from which the pace counts, s.
    """

    def __init__(self, period_s: float) -> None:
        """Take the flight time between two states, s; `begin` is to follow."""
        self.deadlines = Deadlines()
        self._period_s = period_s

    def begin(self, now: float, time_ns: int) -> None:
        """Count from a wall time, s, and a flight time, ns, on."""
        self.started_at, self._start_ns = now, time_ns

    def delay(self, now: float, time_ns: int, factor: float, real_time: bool) -> tuple[float, str]:
        """Return the wall time to wait for the next state, s, and a line on a gap, or "".

        Args:
            now: wall time, s.
            time_ns: flight time of the present state, ns.
            factor: real-time factor, above 0.
            real_time: count the deadline, and leave time for messages.
        """
        flown = (time_ns - self._start_ns) / NANOSECONDS
        left = self.started_at + (flown + self._period_s) / factor - now
        line = ""
        if real_time:
            self.deadlines.count(-left, self._period_s / factor)
        if left < -LONGEST_CATCH_UP:
            # a long gap is not caught up
            self.started_at -= left
            line = f"behind its pace by {-left:.1f} s: not made up for"
        return max(left, LEAST_DELAY if real_time else 0.0), line
