# SPDX-License-Identifier: Apache-2.0
"""Label the instants of a flight to mark in plots."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ares_studies.event_words import MARKS, Moment
from ares_vehicle_sim.arrays import ARC_ENDED, IGNITION

if TYPE_CHECKING:
    from ares_bringup.summary import FlightSummary

#: Fraction of the flight within which neighbouring labels are merged, at the last of them: in a
#: picture, and on a page, which sets labels in rows.
NEAR_MARKS = 0.15
NEAR_ON_PAGES = 0.01


def apart(
    words: Mapping[float, str], span_s: float, near: float = NEAR_MARKS
) -> list[tuple[float, str]]:
    """Merge the labels of close instants at the last of them, so that most have room.

    Args:
        words: labels by instant, s.
        span_s: duration of the whole flight.
        near: fraction of it within which all labels of a group are.

    Returns:
        Instants in order, each with a label that may be "".
    """
    groups: dict[float, list[str]] = {}
    last = math.inf
    for at, word in sorted(words.items(), reverse=True):
        if not last - at < near * span_s:
            last = at
        groups.setdefault(last, []).insert(0, word)
    labels = {at: ", ".join(dict.fromkeys(group)) for at, group in groups.items()}
    return [(at, labels.get(at, "")) for at in sorted(words)]


def words_of(summary: "FlightSummary") -> dict[float, str]:
    """Label the instants of a flight, mission elapsed time in s, one word each.

    A coast begins where a burn ends, and ends where an engine ignites; a drop at the same instant
    takes precedence.
    """
    ignitions = {round(event.time, 3) for event in summary.events if event.type == IGNITION}
    words: dict[float, str] = {}
    for event in summary.events:
        if event.type in MARKS:
            words.setdefault(round(event.time, 3), MARKS[event.type])
    for event in summary.events:
        if event.type == ARC_ENDED:
            at = round(event.time, 3)
            word = "ignition" if at in ignitions else "coast"
            words.setdefault(at, "pitch-over" if event.index in summary.facts.rises else word)
    return words


def marks_of(summary: "FlightSummary", near: float = NEAR_MARKS) -> list[tuple[float, str]]:
    """Return the instants to mark in plots of a whole flight; `near` as in `apart`."""
    words = words_of(summary)
    return apart(words, summary.events[-1].time - summary.events[0].time, near) if words else []


def air_marks(words: Mapping[float, str], moments: Sequence[Moment]) -> list[tuple[float, str]]:
    """Return the instants to mark in plots of the part in the air, each with its label.

    Args:
        words: labels by instant, s.
        moments: of the climb through the air.
    """
    return sorted({**words, **{moment.time_s: MARKS[moment.kind] for moment in moments}}.items())
