# SPDX-License-Identifier: Apache-2.0
"""Base class of the lifecycle nodes: transitions refused with a reason, end, exit status."""

import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import Executor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from ares_node.declaration import declare_parameters, read_parameters
from ares_node.diagnostics import Diagnostics, Level, folded
from ares_node.heartbeat import Heartbeat
from ares_node.parameters import Parameter
from ares_node.qos import NAMESPACE
from ares_node.states import Unreadable

#: Period of the lines of a node that still configures, wall time, s.
PATIENCE = 10.0

AUTOSTART = Parameter(
    name="autostart",
    default=True,
    description="Configure and activate at start; false leaves that to a lifecycle manager.",
    read_only=True,
)


class NodeError(Exception):
    """Report a refused transition; the text is the reason in one line."""


class FlightNode(LifecycleNode):
    """Run a lifecycle node of the graph.

    A subclass overrides `configure`, `activate`, `deactivate`, `cleanup`, `abandon`, `adjust` and
    `drain`, never the `on_...` callbacks. Raising NodeError (or OSError or ValueError with a
    one-line text) refuses the transition: the reason is kept in `failure` and goes to /rosout.

    Attributes:
        disposable: at the end of the process the work of a callback may be dropped, and what is
            freed then, by the middleware too, is not waited for.
        values: parameters in force, by name; those set before `configure` are included.
        diagnostics: the node's reports.
        heartbeat: the node's heartbeat.
        failure: reason of the last refused transition, one line, else None.
        done: the node has ended the run (`finish`); its process may exit.
        when_done: called by `finish`.
        interrupted: returns whether a signal has asked the process to end.
        exit_code: exit status of the node's process.
        unreadable: number of raw messages that could not be parsed.
    """

    disposable = False
    unreadable = 0

    def __init__(
        self,
        node_name: str,
        *,
        parameters: Sequence[Parameter] = (),
        namespace: str = NAMESPACE,
        **kwargs: Any,
    ) -> None:
        """Create the node and declare its parameters.

        Args:
            node_name: name of the node.
            parameters: the node's table; `autostart` is added to it.
            namespace: namespace of the node.
            **kwargs: passed on to rclpy (`context`, `parameter_overrides`, ...).

        Raises:
            ParameterError: a parameter is unknown, of the wrong type or out of range.
        """
        # rclpy creates subscriptions before the base constructor returns
        self._readers: set[Subscription] = set()
        super().__init__(node_name, namespace=namespace, **kwargs)
        self.failure: str | None = None
        self.done = False
        self.when_done: Callable[[], None] = lambda: None
        self.interrupted: Callable[[], bool] = lambda: False
        self.exit_code = 0
        self._starting = False
        self._table = [*parameters, AUTOSTART]
        try:
            self.values = declare_parameters(self, self._table, self._why_fixed)
            self.add_post_set_parameters_callback(self._on_set)
            self.diagnostics = Diagnostics(self, lambda: self.flight_id)
            self.heartbeat = Heartbeat(self, lambda: self._label, lambda: self.flight_id)
        except Exception:
            self.destroy_node()
            raise

    def configure(self) -> None:
        """Allocate: publishers, subscriptions, files, compiled functions."""

    def activate(self) -> None:
        """Start working."""

    def deactivate(self) -> None:
        """Stop working; `activate` may follow."""

    def cleanup(self) -> None:
        """Free what `configure` allocated. Also called before the node shuts down."""

    def abandon(self) -> None:
        """Release the remains of an interrupted transition at the end."""

    def adjust(self) -> None:
        """Apply changed parameters that may be set `at_any_time`."""

    def drain(self, executor: Executor) -> None:
        """Finish work in progress before the process destroys the node.

        Called outside the executor's callbacks, with a context that is still valid.
        """

    @property
    def flight_id(self) -> int:
        """Return the identity of the node's flight; 0 for none."""
        # only members of flights have one, from `configure` on
        membership = getattr(self, "_membership", None)
        return membership.flight_id if membership is not None else 0

    def may_be_abandoned(self) -> bool:
        """Return whether the process may end in the middle of the node's present work."""
        return self.disposable or self._label == "configuring"

    def finish(self, exit_code: int = 0) -> None:
        """End the run: the process leaves its loop and exits with this status."""
        self.exit_code = exit_code
        self.done = True
        self.when_done()

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos_profile: Any,
        *,
        raw: bool = False,
        **more: Any,
    ) -> Subscription:
        """Create a subscription that drops, counts and once reports `Unreadable` messages.

        A publisher may have another definition of the type. Arguments as in rclpy.
        """

        def receive(message: Any) -> None:
            if reader not in self._readers:
                # the executor held it for a subscription that has been destroyed
                return
            try:
                with self.heartbeat.counted():
                    callback(message)
            except Unreadable as error:
                self.unreadable += 1
                if self.unreadable == 1:
                    text = f"{topic}: a message that cannot be read: {error}"
                    self.diagnostics.report(Level.WARN, text, 0)

        reader = super().create_subscription(msg_type, topic, receive, qos_profile, raw=raw, **more)
        self._readers.add(reader)
        return reader

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Destroy a subscription and drop its pending messages."""
        self._readers.discard(subscription)
        return bool(super().destroy_subscription(subscription))

    def wall_timer(self, period_s: float, callback: Callable[[], None]) -> Timer:
        """Create a timer on this machine's steady clock, regardless of `use_sim_time`."""
        clock = Clock(clock_type=ClockType.STEADY_TIME)

        def due() -> None:
            # the executor may hold a call of a timer that has been destroyed
            if timer in self.timers:
                callback()

        timer = self.create_timer(period_s, due, clock=clock)
        return timer

    def start(self) -> bool:
        """Configure and activate; return False, with the reason in `failure`, if one is refused."""
        self._starting = True
        try:
            return all(
                transition() == TransitionCallbackReturn.SUCCESS
                for transition in (self.trigger_configure, self.trigger_activate)
            )
        finally:
            self._starting = False

    def stop(self) -> None:
        """Bring the node to its final state from any state."""
        if self._label in ("unconfigured", "inactive", "active"):
            self.trigger_shutdown()
        self.abandon()

    def destroy_node(self) -> None:
        """Destroy the node and its state machine, which would keep the node's participant alive."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    @property
    def _label(self) -> str:
        """Return the label of the lifecycle state."""
        return str(self._state_machine.current_state[1])

    def _why_fixed(self, row: Parameter) -> str | None:
        """Return the reason why a parameter cannot be set in this state, or None."""
        if self._label == "unconfigured" or row.at_any_time:
            return None
        return f"the node is {self._label}, and configured with it; clean it up first"

    def _on_set(self, parameters: list[RosParameter]) -> None:
        if self._label not in ("inactive", "active"):
            # `configure` reads them all
            return
        rows = {row.name: row for row in self._table if row.at_any_time}
        changed = [parameter for parameter in parameters if parameter.name in rows]
        for parameter in changed:
            self.values[parameter.name] = rows[parameter.name].checked(parameter.value)
        if changed:
            self.adjust()

    def _attempt(self, work: Callable[[], None]) -> TransitionCallbackReturn:
        self.failure = None
        try:
            work()
        except (NodeError, OSError, ValueError) as error:
            self.failure = folded(str(error))
        except Exception as error:
            # rclpy would swallow a defect. An exception by a signal during an import may arrive as
            # an error of the imported library.
            if not (self._starting and self.interrupted()):
                traceback.print_exc()
            self.failure = f"{type(error).__name__}: {folded(str(error))}"
        else:
            return TransitionCallbackReturn.SUCCESS
        if self._starting and self.interrupted():
            return TransitionCallbackReturn.FAILURE
        if self._starting:
            # the caller of `start` shows it
            self.diagnostics.log_last_error(self.failure)
        else:
            self.get_logger().error(self.failure)
        return TransitionCallbackReturn.FAILURE

    def _configure(self) -> None:
        self.values = read_parameters(self, self._table)
        with self._reporting_progress():
            self.configure()

    @contextmanager
    def _reporting_progress(self) -> Iterator[None]:
        """Log periodically that the node still configures, with the probable reason."""
        begun = time.monotonic()
        over = threading.Event()

        def report() -> None:
            while not over.wait(PATIENCE):
                self.get_logger().info(
                    f"configuring for {time.monotonic() - begun:.0f} s; "
                    "the first time after a build, kernels are compiled"
                )

        thread = threading.Thread(target=report, name="configuring", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure`; callback of rclpy."""
        result = super().on_configure(state)
        if result == TransitionCallbackReturn.SUCCESS:
            result = self._attempt(self._configure)
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`; callback of rclpy."""
        result = super().on_activate(state)
        if result == TransitionCallbackReturn.SUCCESS:
            result = self._attempt(self.activate)
            if result != TransitionCallbackReturn.SUCCESS:
                super().on_deactivate(state)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `deactivate`; callback of rclpy."""
        result = self._attempt(self.deactivate)
        super().on_deactivate(state)
        return result

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `cleanup`; callback of rclpy."""
        result = self._attempt(self.cleanup)
        super().on_cleanup(state)
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate if active, clean up and end the run; callback of rclpy."""
        if state.label == "active":
            self._attempt(self.deactivate)
        if state.label != "unconfigured":
            self._attempt(self.cleanup)
        self.done = True
        self.when_done()
        return super().on_shutdown(state)
