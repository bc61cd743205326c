# SPDX-License-Identifier: Apache-2.0
"""End with the process that started the flight. Standard library only.

`ros2 launch` leaves its nodes behind when it gets SIGTERM or SIGKILL. Nodes that it starts for a
flight are told its process id, and end when it is gone; nodes that are started by hand are told
none, and outlive their shell where that is wanted.
"""

import contextlib
import os
import select
import signal
import threading
import time
from collections.abc import Callable, Mapping

#: Names the process to end with, by its id.
LAUNCHER = "ARES_LAUNCHER_PID"
#: Wall time in s that a process whose parent is gone gets to end in good order.
GRACE = 4.0


def end_after(gone: Callable[[], object]) -> None:
    """End this process, by SIGTERM and after GRACE by SIGKILL, as soon as a call has returned.

    Args:
        gone: returns when the parent is gone; called in a thread of its own.
    """

    def watch() -> None:
        gone()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(GRACE)
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()


def end_with_launcher(environ: Mapping[str, str] = os.environ) -> None:
    """End this process with the one that LAUNCHER names, however that one ends."""
    text = environ.get(LAUNCHER, "")
    if not text.isdigit():
        return
    process = None
    with contextlib.suppress(ProcessLookupError):
        process = os.pidfd_open(int(text))
    end_after(lambda: process is None or select.select([process], [], []))
