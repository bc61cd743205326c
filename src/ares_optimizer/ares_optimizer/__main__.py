# SPDX-License-Identifier: Apache-2.0
"""Run the process of the optimizer node; its modules are imported later."""

import sys

from ares_node.entry import enter


def main() -> int:
    """Run until the node ends or a signal arrives."""
    return enter("ares_optimizer", "ares_optimizer.node:OptimizerNode", "optimizer", "solve")


if __name__ == "__main__":
    sys.exit(main())
