# SPDX-License-Identifier: Apache-2.0
"""Publish a flight in standard messages, for RViz, maps and other tools: the view node."""

import math
import struct
import time
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Path
from rclpy.executors import Executor
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import NavSatFix
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from ares_bags.layout import stamp_of_cdr
from ares_bags.types import flight_of_cdr
from ares_models.mission import Mission, MissionError, load_mission
from ares_msgs.msg import (
    FlightEvent,
    FlightMember,
    GuidanceStatus,
    NavState,
    ThrustCommand,
    VehicleState,
)
from ares_node import qos
from ares_node.diagnostics import Level, of_another_flight
from ares_node.heartbeat import is_heartbeat
from ares_node.membership import MOST_HEARD, Role
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter
from ares_node.requirements import unmet
from ares_node.states import StateMessage, Unreadable
from ares_node.time import NANOSECONDS, ns_from_stamp
from ares_view.standard import messages
from ares_view.standard.frames import Array, Frames, turn_rate
from ares_view.standard.trail import Trail
from ares_view.told_mission import told_mission

if TYPE_CHECKING:
    from ares_view.standard.foxglove_server import FoxgloveServer

POSE = "pose"
TWIST = "twist"
FIX = "fix"
PATH = "path"
MARKER = "marker"

#: Topics published, with type and QoS; that of /tf and /tf_static is tf2's.
PUBLISHED = {
    POSE: (PoseStamped, qos.reliable(10)),
    TWIST: (TwistStamped, qos.reliable(10)),
    FIX: (NavSatFix, qos.reliable(10)),
    PATH: (Path, qos.reliable(1, keep_for_late=True)),
    MARKER: (Marker, qos.reliable(100, keep_for_late=True)),
    qos.TF: (TFMessage, qos.reliable(100)),
    qos.TF_STATIC: (TFMessage, qos.reliable(1, keep_for_late=True)),
}
#: Messages of the flight forwarded to Foxglove, and how many a late client gets.
FORWARDED = {
    qos.VEHICLE_STATE: (VehicleState, 1),
    qos.NAV_STATE: (NavState, 1),
    qos.THRUST_COMMAND: (ThrustCommand, 1),
    qos.GUIDANCE_STATUS: (GuidanceStatus, 1),
    qos.FLIGHT_EVENT: (FlightEvent, qos.EVENTS.depth),
    qos.DIAGNOSTICS: (DiagnosticArray, qos.EVENTS.depth),
}
#: QoS of the states: best effort and a short queue, so that a viewer never slows the flight.
GLIMPSE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)

#: Wall time in s between two paths: a message with all points.
PATH_PERIOD = 1.0
#: Wall time in s without a state after which another flight may be shown.
SILENCE = 5.0

ENDS = (FlightEvent.FLIGHT_COMPLETE, FlightEvent.IMPACT, FlightEvent.TIME_LIMIT)
#: Events labelled in the 3D view.
LABELS = {
    FlightEvent.IGNITION: "ignition",
    FlightEvent.STAGING: "staging",
    FlightEvent.JETTISON: "jettison",
    FlightEvent.CUTOFF: "cut-off",
    FlightEvent.DEPLETION: "propellant depleted",
    FlightEvent.FAILED: "failure",
    FlightEvent.JETTISON_STUCK: "jettison stuck",
    FlightEvent.OVER_LIMIT: "acceleration over its limit",
    FlightEvent.FLIGHT_COMPLETE: "flight complete",
    FlightEvent.IMPACT: "impact",
}

PARAMETERS = (
    Parameter(
        "mission",
        "ares_v",
        "Mission whose Earth is shown where a flight does not tell its own: name, or path.",
    ),
    Parameter(
        "flight_id",
        0,
        "Identity of the flight that is shown; 0: the first that is heard of, and another when "
        "it is over.",
        minimum=0,
    ),
    Parameter(
        "frame_prefix",
        "",
        "Prefix of the names of all frames but `earth`, such as `b/`, for more flights than one.",
    ),
    Parameter(
        "rate_hz",
        20.0,
        "States that are shown per second of wall time, at most.",
        unit="Hz",
        minimum=0.1,
        maximum=1000.0,
    ),
    Parameter(
        "path_points",
        1000,
        "Points of the path, at most; the path of a longer flight has them farther apart.",
        minimum=2,
        maximum=100_000,
    ),
    Parameter(
        "foxglove_port",
        0,
        "Port of this machine where Foxglove and Lichtblick get all of it too; 0: none.",
        minimum=0,
        maximum=65535,
        option="foxglove_port",
    ),
)


@dataclass
class Shown:
    """Hold the flight shown.

    Attributes:
        flight_id: its identity.
        mission: source of its Earth and names.
        trail: its path.
        last_ns: stamp of its latest state; None before the first.
        shown_ns: stamp of the state shown last; None before the first.
        direction: of the thrust in the state shown last.
        burns: whether an engine burnt then; None before.
        labels: number of events labelled.
        begun: its first event was received.
        over: its last event was received.
    """

    flight_id: int
    mission: Mission
    trail: Trail
    last_ns: int | None = None
    shown_ns: int | None = None
    direction: Array = field(default_factory=lambda: np.zeros(3))
    burns: bool | None = None
    labels: int = 0
    begun: bool = False
    over: bool = False


class ViewNode(FlightNode):
    """Convert vehicle states and events of one flight to standard messages.

    It is no member of the flight: no node waits for it, and it may start and stop at any time. It
    shows the newest state at its rate; the path is built from all states received.
    """

    disposable = True

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters."""
        super().__init__("view", parameters=PARAMETERS, **kwargs)
        self._shown: Shown | None = None

    @property
    def flight_id(self) -> int:
        """Return the identity of the flight shown; 0 for none."""
        return self._shown.flight_id if self._shown else 0

    def configure(self) -> None:
        """Read the mission, create the publishers."""
        try:
            self._mission = load_mission(self.values["mission"])
        except MissionError as error:
            raise NodeError(str(error)) from error
        self._states = StateMessage(VehicleState)
        self._frames = Frames(self.values["frame_prefix"])
        self._simulators: dict[int, FlightMember] = {}
        self._foxglove = self._open(self.values["foxglove_port"])
        self._out = {
            name: self.create_publisher(kind, name, profile)
            for name, (kind, profile) in PUBLISHED.items()
        }

    def activate(self) -> None:
        """Subscribe."""
        self._shown = None
        self._waiting: tuple[int, Any, bytes] | None = None
        self._forwarded = dict.fromkeys((qos.NAV_STATE, qos.THRUST_COMMAND), -math.inf)
        self._heard = self._last_shown = self._last_path = -math.inf
        self._path_due = False
        self._period = 1.0 / self.values["rate_hz"]
        self._inputs = [
            self.create_subscription(FlightMember, qos.FLIGHT_MEMBER, self._on_member, qos.MEMBERS),
            self.create_subscription(FlightEvent, qos.FLIGHT_EVENT, self._on_event, qos.EVENTS),
            self.create_subscription(
                VehicleState, qos.VEHICLE_STATE, self._on_state, GLIMPSE, raw=True
            ),
        ]
        if self._foxglove is not None:
            self._inputs += self._more_inputs()
        # the timer shows the last state before a pause
        self._timer = self.wall_timer(self._period, self._on_timer)

    def deactivate(self) -> None:
        """Show the last messages and unsubscribe."""
        self._show_the_rest()
        self.destroy_timer(self._timer)
        for subscription in self._inputs:
            self.destroy_subscription(subscription)

    def cleanup(self) -> None:
        """Free the publishers and the port."""
        for publisher in self._out.values():
            self.destroy_publisher(publisher)
        if self._foxglove is not None:
            self._foxglove.close()

    def drain(self, executor: Executor) -> None:
        """Show the last messages."""
        self._show_the_rest()

    # ---- choice of the flight

    def _on_member(self, member: FlightMember) -> None:
        if member.role == Role.VEHICLE_SIM and member.flight_id:
            self._simulators[int(member.flight_id)] = member
            if len(self._simulators) > MOST_HEARD:
                del self._simulators[next(iter(self._simulators))]

    def _admitted(self, flight_id: int, again: bool) -> Shown | None:
        """Return the flight shown if a message belongs to it, or switches to its flight; else None.

        Args:
            flight_id: of the message.
            again: the message shows that its flight starts again.
        """
        shown = self._shown
        if shown is not None and flight_id == shown.flight_id and not again:
            return shown
        if self.values["flight_id"] not in (0, flight_id):
            return None
        busy = shown is not None and not shown.over and time.monotonic() - self._heard < SILENCE
        if busy and flight_id != self.flight_id:
            return None
        return self._begin(flight_id)

    def _begin(self, flight_id: int) -> Shown:
        """Show a flight from its beginning, in place of the previous one."""
        mission, simulator = self._mission, self._simulators.get(flight_id)
        complaint = ""
        if simulator is not None:
            try:
                mission = told_mission(simulator)
            except MissionError as error:
                if simulator.mission not in ("", mission.name):
                    complaint = f"shown on the Earth of {mission.name}: {error}"
        self._waiting = None
        self._shown = Shown(flight_id, mission, Trail(self.values["path_points"]))
        if self._foxglove is not None:
            self._foxglove.clear()
        self._publish(MARKER, messages.nothing(self._frames, 0))
        if complaint:
            self.diagnostics.report(Level.WARN, complaint, 0)
        return self._shown

    # ---- subscriptions

    def _on_state(self, data: bytes) -> None:
        stamp_ns, flight_id, _, state = self._states.read(data)
        last = self._shown.last_ns if self._shown else None
        shown = self._admitted(flight_id, last is not None and stamp_ns < last)
        if shown is None:
            return
        if shown.last_ns is None:
            self._show_the_start(shown, stamp_ns, state)
        shown.last_ns = stamp_ns
        self._heard = time.monotonic()
        self._path_due |= shown.trail.offer(
            stamp_ns, lambda: messages.pose(self._frames, stamp_ns, state)
        )
        self._waiting = stamp_ns, state, data
        if self._heard - self._last_shown >= self._period:
            self._show()

    def _on_event(self, event: FlightEvent) -> None:
        first = event.type == FlightEvent.FLIGHT_STARTED
        again = first and self._shown is not None and self._shown.begun
        shown = self._admitted(int(event.flight_id), again)
        if shown is None:
            return
        shown.begun |= first
        self._forward(qos.FLIGHT_EVENT, ns_from_stamp(event.stamp), event)
        if event.type in LABELS:
            text = LABELS[event.type]
            if event.type == FlightEvent.JETTISON and event.index < len(shown.mission.drops):
                text = f"{text}: {shown.mission.jettison_names[event.index]}"
            stamp_ns = ns_from_stamp(event.stamp)
            label = messages.label(self._frames, stamp_ns, shown.labels, event.position, text)
            self._publish(MARKER, label, stamp_ns)
            shown.labels += 1
        if event.type in ENDS:
            shown.over = True
            self._show_the_rest()

    def _on_timer(self) -> None:
        now = time.monotonic()
        if self._waiting is not None and now - self._last_shown >= self._period:
            self._show()
        if self._path_due and now - self._last_path >= PATH_PERIOD:
            self._show_path()

    # ---- publications

    def _publish(self, topic: str, message: Any, stamp_ns: int = 0) -> None:
        self._out[topic].publish(message)
        self._forward(topic, stamp_ns, message)

    def _show_the_start(self, shown: Shown, stamp_ns: int, state: Any) -> None:
        earth = shown.mission.earth()
        self._publish(MARKER, messages.globe(stamp_ns, earth), stamp_ns)
        self._publish(
            qos.TF_STATIC, messages.fixed_frames(self._frames, stamp_ns, state, earth), stamp_ns
        )

    def _show(self) -> None:
        """Show the newest state."""
        shown = self._shown
        if shown is None or self._waiting is None:
            return
        stamp_ns, state, data = self._waiting
        self._waiting = None
        self._last_shown = time.monotonic()
        earth = shown.mission.earth()
        seconds = 0.0 if shown.shown_ns is None else (stamp_ns - shown.shown_ns) / NANOSECONDS
        direction = state["thrust_direction"]
        turn = turn_rate(shown.direction, direction, seconds)
        shown.shown_ns, shown.direction = stamp_ns, direction
        self._publish(
            qos.TF, messages.moving_frames(self._frames, stamp_ns, state, earth), stamp_ns
        )
        self._publish(POSE, messages.pose(self._frames, stamp_ns, state), stamp_ns)
        self._publish(TWIST, messages.twist(self._frames, stamp_ns, state, turn), stamp_ns)
        self._publish(FIX, messages.fix(self._frames, stamp_ns, state, earth), stamp_ns)
        burns = bool(state["thrust"] > 0.0)
        if burns != shown.burns:
            shown.burns = burns
            self._publish(MARKER, messages.arrow(self._frames, stamp_ns, burns), stamp_ns)
        self._forward(qos.VEHICLE_STATE, stamp_ns, data)
        if self._foxglove is not None:
            self._foxglove.broadcast_time(stamp_ns)

    def _show_path(self) -> None:
        shown = self._shown
        if shown is not None and shown.last_ns is not None:
            self._path_due = False
            self._last_path = time.monotonic()
            message = messages.path(self._frames, shown.last_ns, shown.trail.points)
            self._publish(PATH, message, shown.last_ns)

    def _show_the_rest(self) -> None:
        self._show()
        if self._path_due:
            self._show_path()

    # ---- Foxglove

    def _open(self, port: int) -> "FoxgloveServer | None":
        """Start the server with its channels; None without a port."""
        if not port:
            return None
        if (reason := unmet("ares_view", "pages")) is not None:
            raise NodeError(reason)
        from ares_view.standard.foxglove_server import FoxgloveServer

        try:
            server = FoxgloveServer(self.get_fully_qualified_name(), port)
        except RuntimeError as error:
            raise NodeError(f"foxglove_port is {port}, which cannot be opened: {error}") from error
        kinds = {name: (kind, keep) for name, (kind, keep) in FORWARDED.items()}
        for name, (kind, profile) in PUBLISHED.items():
            late = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
            kinds[name] = kind, profile.depth if late else 0
        for name, (kind, keep) in kinds.items():
            package, *_ = kind.__module__.split(".")
            server.add(self.resolve_topic_name(name), f"{package}/msg/{kind.__name__}", keep)
        return server

    def _more_inputs(self) -> list[Any]:
        """Subscribe to what only Foxglove gets: states and commands thinned, the rest complete."""
        kinds = (
            (qos.NAV_STATE, GLIMPSE),
            (qos.THRUST_COMMAND, GLIMPSE),
            (qos.GUIDANCE_STATUS, qos.FLIGHT),
        )
        return [
            *(
                self.create_subscription(
                    FORWARDED[name][0], name, partial(self._on_more, name), profile, raw=True
                )
                for name, profile in kinds
            ),
            self.create_subscription(
                DiagnosticArray, qos.DIAGNOSTICS, self._on_diagnostics, qos.DIAGNOSTIC
            ),
        ]

    def _on_more(self, topic: str, data: bytes) -> None:
        now = time.monotonic()
        try:
            flight_id, stamp_ns = flight_of_cdr(data)[0], stamp_of_cdr(data)
        except struct.error as error:
            raise Unreadable(f"{len(data)} bytes, which name no flight") from error
        if flight_id != self.flight_id or not self.flight_id:
            return
        if topic in self._forwarded:
            if now - self._forwarded[topic] < self._period:
                return
            self._forwarded[topic] = now
        self._forward(topic, stamp_ns, data)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if any(map(is_heartbeat, message.status)):
            # heartbeats are stamped by the wall clock
            return
        if not any(of_another_flight(status, self.flight_id) for status in message.status):
            self._forward(qos.DIAGNOSTICS, ns_from_stamp(message.header.stamp), message)

    def _forward(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Send a message, serialized or not, to Foxglove."""
        if self._foxglove is not None:
            data = message if isinstance(message, bytes) else serialize_message(message)
            self._foxglove.send(self.resolve_topic_name(topic), stamp_ns, data)
