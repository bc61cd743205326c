# SPDX-License-Identifier: Apache-2.0
"""What follows when a node of a flight ends, for `ares fly` and for launch alike. No ROS."""

from ares_bringup.audience import LIVE, PAGELESS
from ares_bringup.crew import describe_end
from ares_bringup.options import RESTARTS
from ares_bringup.summary import EXIT_CANNOT_START

SIMULATOR = "vehicle_sim"
GUIDANCE = "guidance"
RECORDER = "recorder"
OPTIMIZER = "optimizer"
JUDGE = "judge"
VIEW = "view"

#: Nodes that a flight goes on without, and what that means.
SPARED = {
    OPTIMIZER: "guidance starts without its guess",
    VIEW: "it is not shown any more",
    LIVE: PAGELESS,
}
#: Nodes that take a flight up again where it is. A second recorder would be a second bag, a second
#: simulator is another flight.
KEPT = (GUIDANCE, OPTIMIZER, VIEW)

#: What follows in flight when a node has ended.
_IN_FLIGHT = {
    SIMULATOR: " in flight",
    GUIDANCE: " in flight: flying on with its last good command",
    RECORDER: " in flight: the bag is incomplete; `ares bag repair` saves what was written",
}


def describe_loss(name: str, status: int) -> str:
    """What it means that a node of a flight under way has ended, in words."""
    end = describe_end(status)
    return f"{name} {end}: {SPARED[name]}" if name in SPARED else f"{name} {end}{_IN_FLIGHT[name]}"


class Keeper:
    """Restarts the nodes of one flight, and gives up after a number of times."""

    def __init__(self, restarts: int = RESTARTS) -> None:
        """Nothing has ended yet.

        Args:
            restarts: how often each node is restarted.
        """
        self._allowed = restarts
        self._used = dict.fromkeys(KEPT, 0)

    def ended(self, name: str, status: int) -> tuple[str, bool]:
        """A node has ended in flight.

        Args:
            name: of the node.
            status: exit status, negative for a signal.

        Returns:
            The line that says so, and whether it is to be started again.
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
        """Whether a node runs, or ran, in another process than its first."""
        return self._used.get(name, 0) > 0
