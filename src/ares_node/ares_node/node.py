"""Base class of the lifecycle nodes: refusals with a reason, an end, an exit status."""

import traceback
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import Executor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.timer import Timer

from ares_node.parameters import Parameter, declare_parameters
from ares_node.qos import NAMESPACE

AUTOSTART = Parameter(
    name="autostart",
    default=True,
    description="Configure and activate at start; false leaves that to a lifecycle manager.",
)


class NodeError(Exception):
    """A transition cannot be made; the text is the one line that says why."""


class FlightNode(LifecycleNode):
    """Lifecycle node of the graph.

    A subclass overrides `configure`, `activate`, `deactivate`, `cleanup` and `drain`, never
    the `on_...` callbacks. Raising NodeError (or OSError or ValueError with a one-line text)
    refuses the transition: the reason is kept in `failure`.

    Attributes:
        values: parameters in force, by name.
        failure: why the last transition was refused, one line; None if it was not.
        done: the node has ended the run itself (`finish`); its process may exit.
        exit_code: exit status of the node's process.
    """

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
        super().__init__(node_name, namespace=namespace, **kwargs)
        self.failure: str | None = None
        self.done = False
        self.exit_code = 0
        try:
            self.values = declare_parameters(self, [*parameters, AUTOSTART])
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

    def drain(self, executor: Executor) -> None:
        """Finish what is under way before the process tears the node down.

        Called outside the executor's callbacks, with a context that is still valid.
        """

    def finish(self, exit_code: int = 0) -> None:
        """End the run: the process leaves its loop and exits with this status."""
        self.exit_code = exit_code
        self.done = True

    def wall_timer(self, period_s: float, callback: Callable[[], None]) -> Timer:
        """A timer on the steady clock of this machine, whatever `use_sim_time` says."""
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        return self.create_timer(period_s, callback, clock=clock)

    def start(self) -> bool:
        """Configure and activate; False if either was refused (`failure` says why)."""
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() != TransitionCallbackReturn.SUCCESS:
                return False
        return True

    def stop(self) -> None:
        """Take the node to its final state, from whatever state it is in."""
        if self._state_machine.current_state[1] in ("unconfigured", "inactive", "active"):
            self.trigger_shutdown()

    def _attempt(self, work: Callable[[], None]) -> TransitionCallbackReturn:
        self.failure = None
        try:
            work()
        except (NodeError, OSError, ValueError) as error:
            self.failure = " ".join(str(error).split())
        except Exception as error:
            # rclpy would swallow it; a defect must be seen
            traceback.print_exc()
            self.failure = f"{type(error).__name__}: {' '.join(str(error).split())}"
        else:
            return TransitionCallbackReturn.SUCCESS
        if not self.values["autostart"]:
            self.get_logger().error(self.failure)
        return TransitionCallbackReturn.FAILURE

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """rclpy callback; see `configure`."""
        result = super().on_configure(state)
        if result == TransitionCallbackReturn.SUCCESS:
            result = self._attempt(self.configure)
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """rclpy callback; see `activate`."""
        result = super().on_activate(state)
        if result == TransitionCallbackReturn.SUCCESS:
            result = self._attempt(self.activate)
            if result != TransitionCallbackReturn.SUCCESS:
                super().on_deactivate(state)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """rclpy callback; see `deactivate`."""
        result = self._attempt(self.deactivate)
        super().on_deactivate(state)
        return result

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """rclpy callback; see `cleanup`."""
        result = self._attempt(self.cleanup)
        super().on_cleanup(state)
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """rclpy callback: deactivates if active, cleans up, ends the run."""
        if state.label == "active":
            self._attempt(self.deactivate)
        if state.label != "unconfigured":
            self._attempt(self.cleanup)
        self.done = True
        return super().on_shutdown(state)
