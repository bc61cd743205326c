"""Run a node's module as a child of `ares fly` that never outlives its parent.

    python -m ares_bringup.child MODULE [ARGUMENT...]

The parent holds the other end of the standard input. When the parent is gone, however it
went, that end is closed and the child ends itself.
"""

import os
import runpy
import signal
import sys
import threading
import time

#: Wall time in s that a child without its parent gets to end in good order.
GRACE = 10.0


def _end_with_parent() -> None:
    while os.read(0, 4096):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE)
    os.kill(os.getpid(), signal.SIGKILL)


def main() -> None:
    """Watch the parent, become the module."""
    threading.Thread(target=_end_with_parent, name="parent-watch", daemon=True).start()
    module = sys.argv[1]
    sys.argv = sys.argv[1:]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
