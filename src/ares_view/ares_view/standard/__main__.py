# SPDX-License-Identifier: Apache-2.0
"""Process of the view node; the node's modules are imported later."""

import sys

from ares_node.entry import enter


def main() -> int:
    """Run until a signal comes."""
    return enter("ares_view", "ares_view.standard.node:ViewNode", "view")


if __name__ == "__main__":
    sys.exit(main())
