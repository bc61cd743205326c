# SPDX-License-Identifier: Apache-2.0
"""Entry of a node's process, before any slow import.

Standard library only, so that an interrupt or a missing package ends the process with at most one
line.
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
#: Pattern of NumPy's warnings about arithmetic.
BEYOND_NUMBERS = "(overflow|invalid value|divide by zero) encountered"


class OutputError(OSError):
    """Report that standard output cannot be written; the text is the reason."""


class _Output(io.FileIO):
    """Write standard output; raise its errors as OutputError."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise OutputError(error.strerror) from error


class _Errors(io.FileIO):
    """Write standard error; drop text that cannot be written."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def keep_standard_streams() -> None:
    """Open missing standard streams, and make errors of standard error harmless.

    The number of a closed stream would go to the next file opened, such as a bag. A full disk
    behind standard error, or a closed reader, must not stop a flight.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # opens the lowest free number, which is this one; inherited by children
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    # keep streams that a caller, such as a test, has replaced
    if sys.stdout in (None, sys.__stdout__):
        sys.stdout = _text(_Output(1, "w", closefd=False), sys.stdout)
    if sys.stderr in (None, sys.__stderr__):
        sys.stderr = _text(_Errors(2, "w", closefd=False), sys.stderr)


def _text(raw: io.FileIO, former: io.TextIOWrapper | None) -> io.TextIOWrapper:
    """Wrap a raw stream with the settings of the former one; None: it was closed."""
    if former is None:
        return io.TextIOWrapper(io.BufferedWriter(raw), "utf-8")
    # as in Python, an unbuffered stream has no buffer layer
    buffer = raw if former.write_through else io.BufferedWriter(raw)
    return io.TextIOWrapper(
        buffer,
        former.encoding,
        former.errors,
        line_buffering=former.line_buffering,
        write_through=former.write_through,
    )


def set_up_libraries() -> None:
    """Switch off slow starts and foreign output of libraries; settings of the user have priority.

    NumPy and SciPy would start threads for matrices larger than any in this project: 0.1 s of CPU
    time on two cores, more on more cores. pydantic would search all installed packages for
    plugins: 0.03 s. NumPy would print lines of source on overflow; results are checked where they
    are used.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if not sys.warnoptions:
        warnings.filterwarnings("ignore", BEYOND_NUMBERS, RuntimeWarning)


def enter(package: str, node: str, name: str, extra: str = "", stopped: int = EXIT_OK) -> int:
    """Run one node as a process and end the process with the node's exit status.

    Args:
        package: of the node; its requirements are checked first.
        node: the node's class as `module:class`.
        name: of the node, prefix of error lines.
        extra: optional requirements of the package to check too.
        stopped: exit status after a signal during the start.

    Returns:
        2, with a line on standard error, if a requirement is not met. Else it does not return: the
        process ends with the exit status of `ares_node.run.run_node`.
    """

    def leave(_number: int, _frame: FrameType | None) -> None:
        # nothing to clean up, and imports in progress must not print a traceback
        os._exit(stopped)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, leave)
    # the program that executed this one may have blocked the signals until now
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
    keep_standard_streams()
    set_up_libraries()
    # imports create no garbage: this saves 0.05 s
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
    # the node has released its resources; the teardown of interpreter and middleware would take
    # 0.2 s and could be interrupted
    os._exit(status)
