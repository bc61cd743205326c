# SPDX-License-Identifier: Apache-2.0
"""Process of the live node; the node's modules are imported later."""

import os
import sys

from ares_node.entry import enter

#: Scheduling priority by which the page yields to the flight.
NICENESS = 5


def main() -> int:
    """Run until a signal comes."""
    # the flight must not wait for the page
    os.nice(NICENESS)
    return enter("ares_view", "ares_view.live.node:LiveNode", "live", extra="live")


if __name__ == "__main__":
    sys.exit(main())
