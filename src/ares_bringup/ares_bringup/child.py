# SPDX-License-Identifier: Apache-2.0
"""Run a node's module as a child of `ares fly` that never outlives its parent.

    python -m ares_bringup.child MODULE [ARGUMENT...]

The parent holds the other end of standard input. When the parent ends, even if it is killed, that
end is closed and the child ends itself.
"""

import os
import runpy
import sys

from ares_node.parent import end_after


def _read_to_the_end() -> None:
    while os.read(0, 4096):
        pass


def main() -> None:
    """Watch the parent in a thread and run the module."""
    end_after(_read_to_the_end)
    module = sys.argv[1]
    sys.argv = sys.argv[1:]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
