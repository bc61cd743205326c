"""Process of the recorder node."""

import sys

from ares_bags.recorder import RecorderNode
from ares_node.run import run_node

__all__ = ["RecorderNode", "main"]


def main() -> None:
    """Record until a signal comes; exit status 1 if the bag is incomplete."""
    sys.exit(run_node(RecorderNode, name="recorder"))


if __name__ == "__main__":
    main()
