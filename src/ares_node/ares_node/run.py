# SPDX-License-Identifier: Apache-2.0
"""Process of a node: start, spin, stop on a signal, exit status."""

import os
import re
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

import rclpy
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from ares_node.node import FlightNode
from ares_node.parameters import ParameterError
from ares_node.security import (
    SecurityError,
    check_security,
    enclave_arguments,
    stay_on_this_machine,
)
from ares_node.spin import Spinner

#: Time from a signal to the abandonment of unfinished work, wall time, s.
ABANDON_AFTER = 1.0
#: Wall time after which the system ends a node that is done, by SIGALRM, s.
HUNG_AFTER = 8.0

EXIT_OK = 0
EXIT_FAILED = 1
EXIT_CANNOT_START = 2

UnknownROSArgsError = rclpy_implementation.UnknownROSArgsError
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class _Stopped(BaseException):
    """Interrupt the start of a node after a signal."""


def _keep() -> bool:
    return False


def _drop() -> bool:
    return True


class StopSignals:
    """Handle SIGINT, SIGTERM and SIGHUP by a flag, and keep the context valid.

    SIGHUP, of a closed terminal, is not handled if it was ignored before, as by `nohup`.

    rclpy's own handlers, and those of the EventsExecutor, shut the context down at once; a recorder
    could then not drain its queues.

    Attributes:
        requested: a signal has come.
        starting: the node is starting; a signal interrupts that.
        abandonable: returns whether unfinished work may be abandoned, even in compiled code, by
            ending the process with `exit_status`.
        exit_status: of a process that abandons its work.
    """

    def __init__(
        self, abandonable: Callable[[], bool] = lambda: True, exit_status: int = EXIT_OK
    ) -> None:
        self.requested = False
        self.starting = True
        self.abandonable = abandonable
        self.exit_status = exit_status
        self._wake: Callable[[], None] | None = None
        hung_up = () if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN else (signal.SIGHUP,)
        self._signals = (*_SIGNALS, *hung_up)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        first = not self.requested
        self.requested = True
        if self.starting and first:
            # a second exception would disturb the handling of the first
            raise _Stopped

    def install(self) -> None:
        """Install the handlers, again after an executor has installed its own."""
        for number in self._signals:
            signal.signal(number, self._handle)

    def wake_with(self, wake: Callable[[], None] | None) -> None:
        """Set the function that wakes a sleep in compiled code, from another thread."""
        self._wake = wake

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Handle the signals for a block; restore the former handlers at the end."""
        former = {number: signal.getsignal(number) for number in self._signals}
        readable, writable = os.pipe()
        os.set_blocking(writable, False)
        former_fd = signal.set_wakeup_fd(writable, warn_on_full_buffer=False)

        former_hook = sys.unraisablehook

        def hook(unraisable: "sys.UnraisableHookArgs") -> None:
            # an exception in a callback of compiled code cannot propagate, nor one of an object
            # that the signal has left half made: `requested` holds the signal
            if not self.requested:
                former_hook(unraisable)

        sys.unraisablehook = hook
        over = threading.Event()

        def abandon() -> None:
            while not over.wait(ABANDON_AFTER):
                if self.abandonable():
                    os._exit(self.exit_status)

        def relay() -> None:
            while os.read(readable, 1) != b"\0":
                wake = self._wake
                if wake is not None:
                    wake()
                threading.Thread(target=abandon, name="abandon", daemon=True).start()

        # Python runs handlers only between bytecodes: an executor that sleeps in compiled code
        # would not notice before its timeout
        thread = threading.Thread(target=relay, name="stop-signals", daemon=True)
        thread.start()
        self.install()
        try:
            yield
        finally:
            over.set()
            sys.unraisablehook = former_hook
            signal.set_wakeup_fd(former_fd)
            os.write(writable, b"\0")
            thread.join()
            os.close(readable)
            os.close(writable)
            for number, handler in former.items():
                signal.signal(number, handler)


def one_line(error: BaseException) -> str:
    """Format an error on one line, without the source positions that rcl appends."""
    text = " ".join(str(error).split())
    return re.sub(r", at \S+:\d+", "", text)


def _complain(name: str, reason: str) -> None:
    print(f"{name}: {reason}", file=sys.stderr, flush=True)


def run_node(
    factory: Callable[..., FlightNode], *, name: str | None = None, stopped: int = EXIT_OK
) -> int:
    """Run one node as a process, with its command line, until it is done or a signal comes.

    Must be called from the main thread. Discovery stays on this machine unless
    ROS_AUTOMATIC_DISCOVERY_RANGE says otherwise.

    Args:
        factory: the node's class; called with `context=`.
        name: prefix of error lines before the node exists; default the program's name.
        stopped: exit status after a signal during the start.

    Returns:
        The exit status: the node's `exit_code` after a run (0 after a signal, unless the
        node says otherwise), 2 if it could not start, 1 after a defect. In the last two
        cases the reason is on standard error.
    """
    stay_on_this_machine()
    arguments = sys.argv[1:]
    who = name or Path(sys.argv[0]).name
    try:
        check_security()
    except SecurityError as error:
        _complain(who, str(error))
        return EXIT_CANNOT_START
    arguments += enclave_arguments(who, arguments)
    stop = StopSignals(exit_status=stopped)
    with stop.watch():
        try:
            return _run(factory, arguments, who, stop)
        except _Stopped:
            return stopped


def _make_node(
    factory: Callable[..., FlightNode],
    arguments: list[str],
    context: Context,
    who: str,
    stop: StopSignals,
) -> FlightNode | int:
    """Initialize the context and make the node; the exit status, with its reason, if it cannot."""
    try:
        rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
        left = remove_ros_args(arguments)
        if not left:
            return factory(context=context)
        reason = f"argument {left[0]!r} is not known; expected --ros-args ..."
    except UnknownROSArgsError as error:
        reason = f"ROS argument {one_line(error)} is not known; expected --ros-args ..."
    except (ParameterError, ParameterException, RuntimeError) as error:
        if stop.requested:
            return stop.exit_status
        # malformed ROS arguments come as subclasses of RuntimeError
        reason = one_line(error)
    _complain(who, reason)
    return EXIT_CANNOT_START


def _run(
    factory: Callable[..., FlightNode], arguments: list[str], who: str, stop: StopSignals
) -> int:
    context = Context()
    node: FlightNode | None = None
    executor: Executor | None = None
    try:
        made = _make_node(factory, arguments, context, who, stop)
        if isinstance(made, int):
            return made
        node = made
        node.interrupted = lambda: stop.requested
        executor = EventsExecutor(context=context)
        stop.install()
        stop.wake_with(executor.wake)
        executor.add_node(node)
        if node.values["autostart"] and not node.start():
            if stop.requested:
                return stop.exit_status
            _complain(node.get_name(), node.failure or "could not start")
            node.exit_code = EXIT_CANNOT_START
            return node.exit_code
        stop.starting = False
        stop.abandonable = node.may_be_abandoned
        try:
            with Spinner(executor, node) as spinner:
                stop.wake_with(spinner.come_back)
                node.when_done = spinner.come_back
                while not (stop.requested or node.done) and context.ok():
                    spinner.spin()
            stop.wake_with(executor.wake)
            stop.abandonable = _drop if node.disposable else _keep
            node.drain(executor)
        except Exception:
            traceback.print_exc()
            node.exit_code = EXIT_FAILED
        return node.exit_code
    finally:
        stop.starting = False
        stop.abandonable = _drop if node is not None and node.disposable else _keep
        stop.wake_with(None)
        if node is not None:
            # an error while tearing down must not hide the exit status
            with suppress(Exception):
                node.stop()
            # what is left frees memory, where the middleware was seen to hang
            stop.exit_status = node.exit_code
            stop.abandonable = _drop
            if node.exit_code == EXIT_OK:
                # with Python's lock too: then the system ends the process
                signal.setitimer(signal.ITIMER_REAL, HUNG_AFTER)
            if executor is not None:
                executor.shutdown()
            node.destroy_node()
        context.try_shutdown()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
