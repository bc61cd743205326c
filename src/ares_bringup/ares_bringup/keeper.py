# SPDX-License-Identifier: Apache-2.0
"""Decide the consequence of a node's end, for `ares fly` and launch alike. No ROS."""

from ares_bringup.audience import LIVE, PAGELESS
from ares_bringup.crew import describe_end
from ares_bringup.options import RESTARTS
from ares_bringup.outcomes import EXIT_CANNOT_START

SIMULATOR = "vehicle_sim"
GUIDANCE = "guidance"
RECORDER = "recorder"
OPTIMIZER = "optimizer"
JUDGE = "judge"
VIEW = "view"

#: Nodes that a flight can spare, with the consequence of their end.
SPARED = {
    OPTIMIZER: "guidance starts without an initial guess",
    VIEW: "no standard messages any more (RViz, Foxglove, maps)",
    LIVE: PAGELESS,
}
#: Nodes that can rejoin a flight after a restart. A second recorder would write a second bag, a
#: second simulator would fly another flight.
KEPT = (GUIDANCE, OPTIMIZER, VIEW)

#: Consequence of a node's end in flight.
_IN_FLIGHT = {
    SIMULATOR: " in flight",
    GUIDANCE: " in flight: flying on with its last good command",
    RECORDER: " in flight: the bag is incomplete; `ares bag repair` saves what was written",
}


def describe_loss(name: str, status: int) -> str:
    """Describe the end of a node in flight and its consequence."""
    end = describe_end(status)
    return f"{name} {end}: {SPARED[name]}" if name in SPARED else f"{name} {end}{_IN_FLIGHT[name]}"


class Keeper:
    """Decide on restarts of a flight's nodes; allow a limited number of each."""

    def __init__(self, restarts: int = RESTARTS) -> None:
        """Start with no restarts used.

        Args:
            restarts: restarts allowed per node.
        """
        self._allowed = restarts
        self._used = dict.fromkeys(KEPT, 0)

    def ended(self, name: str, status: int) -> tuple[str, bool]:
        """Decide on the restart of a node that has ended in flight.

        Args:
            name: of the node.
            status: exit status, negative for a signal.

        Returns:
            A line on it, and whether to restart the node.
        """
        line = describe_loss(name, status)
        if name not in KEPT:
            return line, False
        used = self._used[name]
        if status == EXIT_CANNOT_START:
            return f"{line}; not restarted: it cannot start", False
        if used == self._allowed:
            return f"{line}; not restarted: {used} restarts were allowed", False
        self._used[name] += 1
        return f"{line}; restarted ({used + 1} of {self._allowed})", True

    def restarted(self, name: str) -> bool:
        """Tell whether a node has been restarted."""
        return self._used.get(name, 0) > 0
