# SPDX-License-Identifier: Apache-2.0
"""End of a process with the launcher of its flight. Standard library only.

`ros2 launch` leaves its nodes behind after SIGTERM or SIGKILL. Nodes that it starts for a flight
get its process id in the environment and end with it; nodes that are started by hand get none and
outlive their shell.
"""

import contextlib
import os
import select
import signal
import threading
from collections.abc import Callable

#: Environment variable with the process id of the launcher.
LAUNCHER = "ARES_LAUNCHER_PID"
#: Time between SIGTERM and SIGALRM after the end of the launcher, wall time, s.
GRACE = 4.0


def end_after(gone: Callable[[], object]) -> None:
    """End this process, by SIGTERM and after GRACE by SIGALRM, when a call returns.

    The system sends SIGALRM, which no Python handles: a thread that the middleware blocks at the
    end, without letting another one run, ends too.

    Args:
        gone: blocks until the parent has ended; called in a thread of its own.
    """

    def watch() -> None:
        gone()
        signal.setitimer(signal.ITIMER_REAL, GRACE)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()


def end_with_launcher() -> None:
    """End this process with the process named by LAUNCHER, however that one ends."""
    text = os.environ.get(LAUNCHER, "")
    if not text.isdigit():
        return
    process = None
    with contextlib.suppress(ProcessLookupError):
        process = os.pidfd_open(int(text))
    end_after(lambda: process is None or select.select([process], [], []))
