# SPDX-License-Identifier: Apache-2.0
"""The first thing that a node's process runs, before any slow import.

Standard library only, so that an interrupt or a missing package ends the process with at most
one line.
"""

import contextlib
import gc
import importlib
import io
import os
import signal
import sys
import warnings
from types import FrameType
from typing import Any

EXIT_OK = 0
EXIT_CANNOT_START = 2
#: How the warnings of NumPy about arithmetic begin.
BEYOND_NUMBERS = "(overflow|invalid value|divide by zero) encountered"


class OutputError(OSError):
    """Standard output takes no more; the text is why."""


class _Output(io.FileIO):
    """Standard output, whose errors are told from those of other files."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise OutputError(error.strerror) from error


class _Errors(io.FileIO):
    """Standard error: what cannot be written is left out."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def keep_standard_streams() -> None:
    """See that there are all three, and that a line to standard error never ends the process.

    The number of a stream that is closed would go to the next file that is opened, such as a bag.
    A full disk behind standard error, or a reader that has gone, is no reason to stop a flight.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # the lowest that is free, which is this one; for children too
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    # somebody else's, such as a test's, stay
    if sys.stdout in (None, sys.__stdout__):
        sys.stdout = _text(_Output(1, "w", closefd=False), sys.stdout)
    if sys.stderr in (None, sys.__stderr__):
        sys.stderr = _text(_Errors(2, "w", closefd=False), sys.stderr)


def _text(raw: io.FileIO, former: io.TextIOWrapper | None) -> io.TextIOWrapper:
    """A stream like the one before it; that of a file number that was closed has none."""
    if former is None:
        return io.TextIOWrapper(io.BufferedWriter(raw), "utf-8")
    # as Python does it: unbuffered is without a buffer below
    buffer = raw if former.write_through else io.BufferedWriter(raw)
    return io.TextIOWrapper(
        buffer,
        former.encoding,
        former.errors,
        line_buffering=former.line_buffering,
        write_through=former.write_through,
    )


def set_up_libraries() -> None:
    """Keep libraries from what is slow at each start, or no line of ours. What users set stays.

    NumPy and SciPy would start threads for matrices larger than any that is here: on two cores
    0.1 s of CPU time, on more cores more. pydantic would look for plugins in all that is
    installed: 0.03 s. NumPy would print lines of source when somebody sends numbers near the
    largest ones; what comes of such numbers is looked at where it is used.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if not sys.warnoptions:
        warnings.filterwarnings("ignore", BEYOND_NUMBERS, RuntimeWarning)


def enter(package: str, node: str, name: str, extra: str = "", stopped: int = EXIT_OK) -> int:
    """Run one node as a process, and end the process with the status of the node.

    Args:
        package: the package of the node; what it requires is checked first.
        node: where the node's class is, `module:class`.
        name: name of the node, with which error lines begin.
        extra: of what the package requires, checked too.
        stopped: exit status after a signal that came before the node was up.

    Returns:
        2, and a line on standard error, if something is not installed. Else it does not return:
        the process ends as soon as the node has, with the exit status of `ares_node.run.run_node`.
    """

    def leave(_number: int, _frame: FrameType | None) -> None:
        # nothing has begun, and imports in progress must not be unwound with a traceback
        os._exit(stopped)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, leave)
    # who has become this process may have held them back until there is somebody to take them
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
    keep_standard_streams()
    set_up_libraries()
    # nothing of what is imported is garbage: 0.05 s
    gc.disable()
    from ares_node.parent import end_with_launcher
    from ares_node.requirements import missing_middleware, unmet

    end_with_launcher()
    reason = missing_middleware() or unmet(package, extra)
    if reason is None:
        module, _, kind = node.partition(":")
        try:
            run_node = importlib.import_module("ares_node.run").run_node
            factory = getattr(importlib.import_module(module), kind)
        except ImportError as error:
            reason = " ".join(str(error).split())
    if reason is not None:
        print(f"{name}: {reason}", file=sys.stderr, flush=True)
        return EXIT_CANNOT_START
    gc.freeze()
    gc.enable()
    status: int = run_node(factory, name=name, stopped=stopped)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    # the node has freed what it held; the end of the interpreter, which must not be interrupted
    # either, and of the middleware, which sleeps in it, would take 0.2 s of a flight
    os._exit(status)
