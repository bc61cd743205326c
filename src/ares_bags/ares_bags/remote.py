# SPDX-License-Identifier: Apache-2.0
"""Control a replay through parameters of its node."""

# mypy: allow-untyped-calls
# rclpy's functions have no types

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from ares_bags.playback import Playback
from ares_node.diagnostics import PACE, PAUSED, REPLAYED, Timing, pace_message, timing
from ares_node.qos import DIAGNOSTIC

#: Wall time in s between reports of the pace.
WORD_PERIOD = 0.25
#: Timeout for a reader of facts to appear, and for their delivery to it, wall time, s; long enough
#: for a busy machine, since they are sent once.
TELL_TIMEOUT = 10.0


def _check(parameters: list[Parameter]) -> SetParametersResult:
    for one in parameters:
        is_pace = one.name == PACE and isinstance(one.value, float)
        if is_pace and not 0.0 <= one.value < math.inf:
            reason = f"parameter pace is {one.value!r}; expected zero or a positive number"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


@contextmanager
def remote(
    node: Node, playback: Playback, topic: str, flight_id: int
) -> Iterator[Callable[[Mapping[str, object]], None]]:
    """Serve the parameters in a thread, and publish the pace periodically.

    Args:
        node: of the replay, with parameter services; on no executor.
        playback: controlled by the parameters.
        topic: topic of the reports: TIMING, in the namespace of the flight.
        flight_id: identity of the replayed flight.

    Yields:
        a function that publishes facts of the flight on the same topic.
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
        rate, paused = playback.rate, playback.paused
        out.publish(pace_message(node, flight_id, rate, paused, {REPLAYED: True}))

    def tell(facts: Mapping[str, object]) -> None:
        deadline = time.monotonic() + TELL_TIMEOUT
        while not out.get_subscription_count() and time.monotonic() < deadline:
            time.sleep(0.01)
        out.publish(timing(node, flight_id, facts))
        out.wait_for_all_acked(Duration(seconds=TELL_TIMEOUT))

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
        yield tell
    finally:
        executor.shutdown()
        thread.join()
