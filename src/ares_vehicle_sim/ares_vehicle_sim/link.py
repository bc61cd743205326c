# SPDX-License-Identifier: Apache-2.0
"""Link to guidance: how long an answer is waited for, and when the link is lost. No ROS."""

import math
from dataclasses import dataclass

#: Number of consecutive lost answers after which the flight does not wait for more.
LINK_LOST_AFTER = 3
#: Ratio of the timeout of an answer to that of the one before, after losses.
PATIENCE_RATIO = 0.2
#: Timeout of a plan in flight, as a multiple of that of an answer.
PLAN_PATIENCE = 10.0


@dataclass
class GuidanceLink:
    """Hold what the simulator knows of its link to guidance; times are wall time, s.

    Attributes:
        timeout_s: timeout of an answer on a good link.
        waiting: the flight stands until an answer or the deadline.
        patience_s: timeout of the present answer.
        deadline: of the present answer.
        planning_since: begin of guidance's plan; -inf if it does not plan.
        unguided: the loss of guidance has been published, its return not yet.
        lost: the flight waits for no answer.
        lost_in_a_row: number of consecutive lost answers.
        deafness: number of states on a lost link before a late answer counts.
        listen_from: number of the first state from which one counts.
    """

    timeout_s: float
    waiting: bool = False
    patience_s: float = math.inf
    deadline: float = math.inf
    planning_since: float = -math.inf
    unguided: bool = False
    lost: bool = False
    lost_in_a_row: int = 0
    deafness: int = 0
    listen_from: int = 0

    def wait(self, now: float) -> None:
        """Wait for an answer, the shorter the more were lost."""
        self.waiting = True
        self.patience_s = self.timeout_s * PATIENCE_RATIO**self.lost_in_a_row
        self.deadline = now + self.patience_s

    def is_overdue(self, now: float, paced: bool) -> bool:
        """Return whether an answer is lost; without a pace a plan of guidance takes longer."""
        plans = now - self.planning_since < PLAN_PATIENCE * self.timeout_s and not paced
        return self.waiting and now >= self.deadline and not plans

    def lose(self, sequence: int) -> None:
        """Wait for no more answers, from the state ``sequence`` on."""
        self.lost = True
        self.listen_from = sequence + self.deafness

    def heeds_late_answer(self, sequence: int) -> bool:
        """Return whether to wait again after a late answer on a lost link: ever more rarely."""
        if not self.lost or sequence < self.listen_from:
            return False
        self.deafness = 2 * self.deafness + 1
        return True

    def regain(self, lost_in_a_row: int) -> bool:
        """Wait for answers again; return whether the link was lost."""
        self.lost_in_a_row = lost_in_a_row
        was_lost, self.lost = self.lost, False
        return was_lost
