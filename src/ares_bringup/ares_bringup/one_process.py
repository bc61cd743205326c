# SPDX-License-Identifier: Apache-2.0
"""Fly with all nodes in this process."""

from collections.abc import Mapping
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from ares_bringup.graph import Callbacks, Say, flight_graph, keep_watch, spinning
from ares_bringup.keeper import GUIDANCE, OPTIMIZER, RECORDER, SIMULATOR, VIEW
from ares_bringup.options import CannotStart
from ares_bringup.outcomes import EXIT_CANNOT_START
from ares_bringup.summary import FlightSummary
from ares_node.names import remappings

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node

    from ares_node.node import FlightNode


#: Classes of the nodes.
CLASSES = {
    SIMULATOR: "ares_vehicle_sim.node:VehicleSimNode",
    GUIDANCE: "ares_guidance.node:GuidanceNode",
    OPTIMIZER: "ares_optimizer.node:OptimizerNode",
    VIEW: "ares_view.standard.node:ViewNode",
    RECORDER: "ares_bags.recorder:RecorderNode",
}


def fly_in_process(
    summary: FlightSummary, parameters: Mapping[str, Mapping[str, Any]], terms: Callbacks
) -> None:
    """Fly with all nodes in this process; arguments as for `fly_in_processes`.

    Raises:
        CannotStart: a node cannot start; one line, "" if it has printed the reason.
    """
    say, audience = terms.say, terms.audience

    def lost() -> bool:
        audience.look(monitor)
        terms.show(monitor)
        return _node_lost(nodes, summary, say)

    with flight_graph(summary, say, lambda: not summary.started) as (monitor, executor, stop):
        audience.come(monitor)
        nodes: dict[str, FlightNode] = {}
        try:
            # the recorder last: a start interrupted while kernels compile leaves no bag
            for name in (OPTIMIZER, VIEW, GUIDANCE, SIMULATOR, RECORDER):
                if name in parameters and not stop.requested:
                    nodes[name] = _started(name, parameters[name], executor, monitor.node)
            with spinning(monitor, executor, stop) as spinner:
                for node in nodes.values():
                    node.when_done = spinner.come_back
                keep_watch(monitor, terms, stop, spinner, lost)
            for node in _in_order_of_end(nodes):
                if not node.done:
                    node.drain(executor)
                if stop.requested:
                    # else they would fly on while the recorder drains its queues
                    node.stop()
        finally:
            for node in _in_order_of_end(nodes):
                executor.remove_node(node)
                node.stop()
                node.destroy_node()
        if RECORDER in nodes and nodes[RECORDER].exit_code:
            summary.problems.append(f"{RECORDER} failed: the bag is incomplete")
        audience.leave(monitor)


def _in_order_of_end(nodes: Mapping[str, "FlightNode"]) -> list["FlightNode"]:
    """Sort the nodes with the recorder last, so that it writes all that the others sent."""
    order = (SIMULATOR, GUIDANCE, OPTIMIZER, VIEW, RECORDER)
    return [nodes[name] for name in order if name in nodes]


def _started(
    name: str, values: Mapping[str, Any], executor: "Executor", judge: "Node"
) -> "FlightNode":
    """Start a node; return it configured and active.

    Raises:
        CannotStart: a parameter or a transition was refused; one line.
    """
    from rclpy.exceptions import ParameterException
    from rclpy.parameter import Parameter

    from ares_node.parameters import ParameterError

    overrides = [Parameter(key, value=value) for key, value in values.items()]
    try:
        node: FlightNode = resolve_name(CLASSES[name])(
            context=judge.context,
            namespace=judge.get_namespace(),
            cli_args=["--ros-args", *remappings(judge.get_namespace())],
            parameter_overrides=overrides,
        )
    except (ParameterError, ParameterException) as error:
        raise CannotStart(f"{name}: {' '.join(str(error).split())}") from error
    executor.add_node(node)
    if not node.start():
        reason = node.failure or "could not start"
        executor.remove_node(node)
        node.stop()
        node.destroy_node()
        raise CannotStart(f"{name}: {reason}")
    return node


def _node_lost(nodes: "Mapping[str, FlightNode]", summary: FlightSummary, say: Say) -> bool:
    """Tell whether the simulator has ended in flight; raise if any node ends before it."""
    for name, node in nodes.items():
        if not node.done:
            continue
        if node.exit_code == EXIT_CANNOT_START:
            raise CannotStart("")
        if not summary.started:
            raise CannotStart(f"{name} ended")
        if name == SIMULATOR:
            summary.problems.append(f"{name} ended in flight")
            say(summary.problems[-1])
            return True
    return False
