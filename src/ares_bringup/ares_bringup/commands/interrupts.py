# SPDX-License-Identifier: Apache-2.0
"""SIGINT and SIGTERM end a command at any time: between bytecodes, in a kernel, in an import.

Python runs its handlers between bytecodes, and a kernel has none. A thread hears of the signal
all the same, since kernels leave the interpreter's lock alone; if the command has not ended by
itself within GRACE, the thread ends the process. Whatever is being computed then is computed
only: files are written between kernels, and each whole or not at all.
"""

import atexit
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from types import FrameType, TracebackType

#: Wall time in s that a command gets to end in good order.
GRACE = 2.0

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

STANDARD_ERROR = 2

_written: list[str] = []
_told: list[str] = []


def exit_status(number: int) -> int:
    """Exit status of a command that a signal has ended: 130 for SIGINT, 143 for SIGTERM."""
    return 128 + number


def grant(grace_s: float) -> None:
    """Let this command take longer to end in good order, s: as long as processes end with it."""
    global GRACE  # noqa: PLW0603  the thread that ends the process has no other word of it
    GRACE = grace_s


def note_written(path: str) -> None:
    """Remember a file that is there whole, for the last word of a command that is interrupted."""
    _written.append(path)


def tell(kept: str = "") -> None:
    """Say, once, that the command was interrupted, and what of it is kept.

    Args:
        kept: empty for the files that are there whole.
    """
    if _told:
        return
    _told.append(kept)
    files = f"written: {', '.join(_written)}" if _written else "nothing was written"
    # no stream of Python's: it may be in use
    with suppress(OSError):
        os.write(STANDARD_ERROR, f"ares: interrupted; {kept or files}\n".encode())


def end_at_once() -> None:
    """Until the command line is there: a signal ends the process."""

    def end(number: int, _: FrameType | None) -> None:
        tell()
        os._exit(exit_status(number))

    for number in _SIGNALS:
        signal.signal(number, end)


def leave_the_end_alone() -> None:
    """From when Python has waited for its threads on, a signal does nothing: the command has ended.

    Python would give up its handlers then, and the signal end the process by itself.
    """
    # what is registered first is called last
    atexit.register(_ignore)


def _ignore() -> None:
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class Interrupted(KeyboardInterrupt):
    """A signal asks for the end.

    A KeyboardInterrupt of Python's own that passes through a text that is executed, as dataclasses
    are made, is remembered: Python ends itself by SIGINT later, whoever has caught it and whichever
    signal it was.
    """


class Interrupts:
    """Both signals as KeyboardInterrupt, and an end that comes for sure.

    Must be entered in the main thread; the interrupt may come as soon as it is, and until it is
    left: outside the block is the place to catch it. A verb with signals of its own, such as a
    flight, may take them meanwhile and give them back.
    """

    def __init__(self) -> None:
        self._number = 0
        self._over = False

    def __enter__(self) -> "Interrupts":
        """Take the signals."""
        self._readable, self._writable = os.pipe()
        os.set_blocking(self._writable, False)
        self._former_fd = signal.set_wakeup_fd(self._writable, warn_on_full_buffer=False)
        self._former_hook = sys.unraisablehook
        sys.unraisablehook = self._on_unraisable
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
        """Give them back; after a signal the process still ends within GRACE of it.

        Returns:
            Whether the error is what compiled code has made of the KeyboardInterrupt.
        """
        self._over = True
        signal.set_wakeup_fd(self._former_fd)
        if self._number:
            return kind is not None and issubclass(kind, Exception)
        for number, handler in self._former.items():
            signal.signal(number, handler)
        sys.unraisablehook = self._former_hook
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
        """Exit status after a signal; the other one if none came."""
        return exit_status(self._number) if self._number else otherwise

    def _interrupt(self, number: int, _: FrameType | None) -> None:
        # the next signal ends the process, in which Python's own clean-up may still run
        for each in _SIGNALS:
            signal.signal(each, lambda number, _: os._exit(exit_status(number)))
        self._number = number
        raise Interrupted

    def _on_unraisable(self, unraisable: "sys.UnraisableHookArgs") -> None:
        # raised where nobody can take it, or of an object that the interrupt has left half made:
        # the command ends all the same
        if not self._number:
            self._former_hook(unraisable)

    def _listen(self) -> None:
        number = 0
        while number not in _SIGNALS:
            number = os.read(self._readable, 1)[0]
            if number == 0:
                return
        time.sleep(GRACE)
        if not self._over:
            tell()
        os._exit(exit_status(number))
