# SPDX-License-Identifier: Apache-2.0
"""Messages of the simulator: states, events, clock and pace of its flight."""

import time
from typing import Any

from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock

from ares_msgs.msg import FlightEvent, NavState, VehicleState
from ares_node import qos
from ares_node.diagnostics import FLIGHT_TIME_S, Timing, pace_message
from ares_node.membership import Membership
from ares_node.node import FlightNode
from ares_node.seal import canonical
from ares_node.states import StateMessage, clock_data
from ares_node.time import NANOSECONDS, ns_from_seconds, stamp_from_ns
from ares_vehicle_sim.simulator import Simulator


class FlightPublishers:
    """Publish a flight in its present state."""

    def __init__(self, node: FlightNode, membership: Membership, simulator: Simulator) -> None:
        """Create the publishers."""
        self._node = node
        self._membership = membership
        self._simulator = simulator
        self._clock_out = node.create_publisher(Clock, qos.CLOCK, qos.CLOCK_QOS)
        self._nav_out = node.create_publisher(NavState, qos.NAV_STATE, qos.FLIGHT)
        self._truth_out = node.create_publisher(VehicleState, qos.VEHICLE_STATE, qos.FLIGHT)
        self._event_out = node.create_publisher(FlightEvent, qos.FLIGHT_EVENT, qos.EVENTS)
        self._timing_out = node.create_publisher(Timing, qos.TIMING, qos.DIAGNOSTIC)
        self._nav_message = StateMessage(NavState)
        self._truth_message = StateMessage(VehicleState)
        self._published_events: set[bytes] = set()

    def close(self) -> None:
        """Free the publishers."""
        for publisher in (self._clock_out, self._nav_out, self._truth_out, self._event_out):
            self._node.destroy_publisher(publisher)
        self._node.destroy_publisher(self._timing_out)

    def wait_until_heard(self, deadline: float) -> None:
        """Wait until the others have received the last messages, at most to a wall time, s."""
        for publisher in (self._nav_out, self._truth_out, self._event_out):
            left = max(0.0, deadline - time.monotonic())
            publisher.wait_for_all_acked(Duration(seconds=left))

    @property
    def nav_topic(self) -> str:
        """Return the full name of the topic of navigation states."""
        return self._nav_out.topic_name

    @property
    def _head(self) -> tuple[int, int, int]:
        """Return stamp in ns, flight_id and sequence of a state message."""
        return self._simulator.time_ns, self._membership.flight_id, self._simulator.sequence

    def publish_measured(self) -> None:
        """Publish the navigation state."""
        data = self._nav_message.data(*self._head, self._simulator.measured)
        self._membership.seals.seal(self._nav_message.content(data))
        self._nav_out.publish(data)

    def publish_truth(self) -> Any:
        """Publish clock and true state; return the state, record TRUTH."""
        head = self._head
        self._clock_out.publish(clock_data(head[0]))
        truth = self._simulator.truth()
        self._truth_out.publish(self._truth_message.data(*head, truth))
        return truth

    def publish_event(self, event: Any) -> None:
        """Publish an event with the fields of EVENT."""
        message = FlightEvent(
            stamp=stamp_from_ns(ns_from_seconds(float(event["time"]))),
            flight_id=self._membership.flight_id,
            time=float(event["time"]),
            type=int(event["type"]),
            index=int(event["index"]),
            position=event["position"],
            velocity=event["velocity"],
            mass=float(event["mass"]),
            heating_rate=float(event["heating_rate"]),
        )
        self._published_events.add(canonical(message))
        self._membership.seals.seal(message)
        self._event_out.publish(message)

    def publish_node_event(self, kind: int) -> None:
        """Publish an event of the node at the present state."""
        truth = self._simulator.truth()
        event = {name: truth[name] for name in ("position", "velocity", "mass", "heating_rate")}
        now = self._simulator.time_ns / NANOSECONDS
        self.publish_event({**event, "time": now, "type": kind, "index": truth["arc"]})

    def is_forged(self, event: FlightEvent) -> bool:
        """Return whether an event is of this flight, but was not published here."""
        ours = event.flight_id == self._membership.flight_id
        return ours and canonical(event) not in self._published_events

    def publish_pace(self, pace: float, paused: bool) -> None:
        """Publish pace and pause for pages, and flight time for the judge, to notice a hang."""
        facts = {FLIGHT_TIME_S: self._simulator.time_ns / NANOSECONDS}
        flight_id = self._membership.flight_id
        self._timing_out.publish(pace_message(self._node, flight_id, pace, paused, facts))
