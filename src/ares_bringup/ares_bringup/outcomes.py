# SPDX-License-Identifier: Apache-2.0
"""Name the ways in which a flight ends, and the exit statuses of `ares fly`."""

from enum import StrEnum

#: Exit statuses of `ares fly`.
EXIT_TARGET = 0
EXIT_NOT_AS_IT_SHOULD = 1
EXIT_CANNOT_START = 2
EXIT_INTERRUPTED = 130
#: Their meanings, after a start.
EXIT_MEANINGS = {
    EXIT_TARGET: "flown to the target",
    EXIT_NOT_AS_IT_SHOULD: "flown, but something went wrong",
    EXIT_INTERRUPTED: "interrupted",
}


class Outcome(StrEnum):
    """Name the ways in which a flight ends."""

    TARGET = "target"
    TARGET_MISSED = "target_missed"
    DEPLETION = "depletion"
    IMPACT = "impact"
    TIME_LIMIT = "time_limit"
    INCOMPLETE = "incomplete"
    INTERRUPTED = "interrupted"


#: Outcomes in a few words.
VERDICTS = {
    Outcome.TARGET: "Flown to the target",
    Outcome.TARGET_MISSED: "Target missed",
    Outcome.DEPLETION: "Propellant ran out",
    Outcome.IMPACT: "Hit the ground",
    Outcome.TIME_LIMIT: "Time limit reached",
    Outcome.INCOMPLETE: "Incomplete",
    Outcome.INTERRUPTED: "Interrupted",
}
