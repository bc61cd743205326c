# SPDX-License-Identifier: Apache-2.0
"""Control a replay through parameters of its node."""

# mypy: allow-untyped-calls
# rclpy's functions have no types

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from ares_bags.playback import Playback
from ares_node.diagnostics import PACE, PAUSED, Timing, pace_message
from ares_node.qos import DIAGNOSTIC

#: Wall time in s between reports of the pace.
WORD_PERIOD = 0.25


def _check(parameters: list[Parameter]) -> SetParametersResult:
    for one in parameters:
        is_pace = one.name == PACE and isinstance(one.value, float)
        if is_pace and not 0.0 <= one.value < math.inf:
            reason = f"parameter pace is {one.value!r}; expected zero or a positive number"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


@contextmanager
def remote(node: Node, playback: Playback, topic: str, flight_id: int) -> Iterator[None]:
    """Serve the parameters in a thread, and publish the pace periodically.

    Args:
        node: of the replay, with parameter services; on no executor.
        playback: controlled by the parameters.
        topic: topic of the reports: TIMING, in the namespace of the flight.
        flight_id: identity of the replayed flight.
    """
    node.declare_parameter(PACE, playback.rate)
    node.declare_parameter(PAUSED, playback.paused)

    def obey(parameters: list[Parameter]) -> None:
        for one in parameters:
            if one.name == PACE:
                playback.set_rate(one.value)
            elif one.name == PAUSED:
                (playback.pause if one.value else playback.resume)()
        say()

    def say() -> None:
        out.publish(pace_message(node, flight_id, playback.rate, playback.paused))

    out = node.create_publisher(Timing, topic, DIAGNOSTIC)
    node.add_on_set_parameters_callback(_check)
    node.add_post_set_parameters_callback(obey)
    node.create_timer(WORD_PERIOD, say)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def spin() -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            return

    thread = threading.Thread(target=spin, name="remote", daemon=True)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()
