# SPDX-License-Identifier: Apache-2.0
"""Process of the optimizer node; the node's modules are imported later."""

import sys

from ares_node.entry import enter


def main() -> int:
    """Run until the node is done or a signal comes."""
    return enter("ares_optimizer", "ares_optimizer.node:OptimizerNode", "optimizer", "solve")


if __name__ == "__main__":
    sys.exit(main())
