# SPDX-License-Identifier: Apache-2.0
"""End a command on SIGINT or SIGTERM at any time: between bytecodes, in a kernel, in an import.

Python runs its handlers between bytecodes, and a kernel has none. A thread notices the signal
anyway, since kernels release the interpreter's lock; if the command has not ended by itself within
GRACE, the thread ends the process. Only a computation is lost then: files are written between
kernels, and each atomically.
"""

import atexit
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from types import FrameType, TracebackType

#: Wall time in s for a command to end cleanly.
GRACE = 2.0

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

STANDARD_ERROR = 2

_found: list[str] = []
_written: list[str] = []
_told: list[str] = []


def exit_status(number: int) -> int:
    """Return the exit status of a command ended by a signal: 130 for SIGINT, 143 for SIGTERM."""
    return 128 + number


def extend_grace(grace_s: float) -> None:
    """Extend the time in which this command must end after a signal, s."""
    global GRACE  # noqa: PLW0603  read by the thread that ends the process
    GRACE = grace_s


def note_written(path: str) -> None:
    """Record a complete file, to be named if the command is interrupted."""
    _written.append(path)


def note_found(text: str) -> None:
    """Record the best result so far, to be told if the command is interrupted."""
    _found[:] = [text]


def report_interrupt(kept: str = "") -> None:
    """Print, once, that the command was interrupted, and what is kept of its work.

    Args:
        kept: description; "": what `note_found` recorded, else the files of `note_written`.
    """
    if _told:
        return
    _told.append(kept)
    files = f"written: {', '.join(_written)}" if _written else "nothing was written"
    known = kept or "".join(_found) or files
    # not Python's stream, which the interrupted code may be using
    with suppress(OSError):
        os.write(STANDARD_ERROR, f"ares: interrupted; {known}\n".encode())


def end_at_once() -> None:
    """Let a signal end the process at once, until the command line has started.

    So does one that came while Python started, when `./ares` blocks them.
    """

    def end(number: int, _: FrameType | None) -> None:
        report_interrupt()
        os._exit(exit_status(number))

    for number in _SIGNALS:
        signal.signal(number, end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


def leave_the_end_alone() -> None:
    """Ignore signals once Python has waited for its threads: the command has ended.

    Python would then reset its handlers, and the signal would kill the process.
    """
    # registered first, so called last
    atexit.register(_ignore)


def _ignore() -> None:
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class Interrupted(KeyboardInterrupt):
    """Interrupt the command after a signal.

    A subclass, since Python records a plain KeyboardInterrupt that leaves a text executed by
    `exec`, as dataclasses are made: it then ends itself by SIGINT later, even if the exception was
    caught and the signal was another.
    """


class Interrupts:
    """Raise `Interrupted` on both signals, and make sure that the process ends.

    Enter it in the main thread. The exception may come at any time inside the block, so catch it
    outside. A verb with handlers of its own, such as a flight, may install them inside and restore
    these.
    """

    def __init__(self) -> None:
        self._number = 0
        self._over = False

    def __enter__(self) -> "Interrupts":
        """Install the handlers."""
        self._readable, self._writable = os.pipe()
        os.set_blocking(self._writable, False)
        self._former_fd = signal.set_wakeup_fd(self._writable, warn_on_full_buffer=False)
        self._former_hook, self._former_excepthook = sys.unraisablehook, sys.excepthook
        sys.unraisablehook, sys.excepthook = self._on_unraisable, self._on_exception
        self._thread = threading.Thread(target=self._listen, name="interrupts", daemon=True)
        self._thread.start()
        self._former = {number: signal.getsignal(number) for number in _SIGNALS}
        for number in _SIGNALS:
            signal.signal(number, self._interrupt)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        """Restore the handlers; after a signal the process still ends within GRACE.

        Returns:
            Whether to suppress the error, which stems from the interrupt.
        """
        self._over = True
        signal.set_wakeup_fd(self._former_fd)
        if self._number:
            return kind is not None and issubclass(kind, Exception)
        for number, handler in self._former.items():
            signal.signal(number, handler)
        sys.unraisablehook, sys.excepthook = self._former_hook, self._former_excepthook
        os.write(self._writable, b"\0")
        self._thread.join()
        os.close(self._readable)
        os.close(self._writable)
        return False

    @property
    def came(self) -> bool:
        """Tell whether a signal has come."""
        return self._number != 0

    def status(self, otherwise: int) -> int:
        """Return the exit status after a signal; `otherwise` without one."""
        return exit_status(self._number) if self._number else otherwise

    def _interrupt(self, number: int, _: FrameType | None) -> None:
        # a second signal ends the process at once, even during Python's clean-up
        for each in _SIGNALS:
            signal.signal(each, lambda number, _: os._exit(exit_status(number)))
        self._number = number
        raise Interrupted

    def _on_unraisable(self, unraisable: "sys.UnraisableHookArgs") -> None:
        # an interrupt raised where it cannot propagate, or an error of an object that it has left
        # half made: ignored, since the command ends anyway
        if not self._number:
            self._former_hook(unraisable)

    def _on_exception(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        # the same, of compiled code that prints what its callback raises, as IPOPT's binding does
        if not self._number:
            self._former_excepthook(kind, error, trace)

    def _listen(self) -> None:
        number = 0
        while number not in _SIGNALS:
            number = os.read(self._readable, 1)[0]
            if number == 0:
                return
        time.sleep(GRACE)
        if not self._over:
            report_interrupt()
        os._exit(exit_status(number))
