# SPDX-License-Identifier: Apache-2.0
"""Record every message of a flight in a bag, as it was sent: the recorder node."""

import os
import platform
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import Executor
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from ares_bags.errors import BagError
from ares_bags.layout import WALL_CLOCK_NS, stamp_of_cdr
from ares_bags.schema import Qos, Topic
from ares_bags.types import (
    flight_of_cdr,
    guidance_of_cdr,
    message_class,
    names_its_flight,
    starts_with_stamp,
)
from ares_bags.writer import (
    DATE_KEY,
    GUIDANCE_KEY,
    INCOMPLETE_KEY,
    MACHINE_KEY,
    SIMULATOR_KEY,
    BagWriter,
)
from ares_msgs.msg import FlightMember
from ares_node import qos
from ares_node.diagnostics import Level, of_another_flight
from ares_node.heartbeat import is_heartbeat
from ares_node.identity import id_text
from ares_node.membership import AGREED, FLIGHT_ID, Membership, Role, State
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter
from ares_node.states import Unreadable, message_of

#: Types of the topics that the parameter `topics` may name without their type.
TYPES = {
    qos.NAV_STATE: "ares_msgs/msg/NavState",
    qos.VEHICLE_STATE: "ares_msgs/msg/VehicleState",
    qos.THRUST_COMMAND: "ares_msgs/msg/ThrustCommand",
    qos.GUIDANCE_STATUS: "ares_msgs/msg/GuidanceStatus",
    qos.FLIGHT_EVENT: "ares_msgs/msg/FlightEvent",
    qos.DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
}

#: Wall time in s without a message after which the queues count as empty.
QUIET_TIME = 0.2
#: Wall time in s after which draining ends even if messages still arrive or states are missing.
DRAIN_LIMIT = 5.0
#: Wall time in s after the flight for guidance to announce the number of statuses it has sent.
LAST_WORD_TIME = 1.0
#: Topics whose sequence numbers have no gaps.
NUMBERED = (qos.NAV_STATE, qos.VEHICLE_STATE)

PARAMETERS = (
    Parameter("bag", "", "Folder of the new bag; it must not exist."),
    Parameter(
        "topics",
        tuple(TYPES),
        "Topics to record; one of another type is written name:package/msg/Name.",
    ),
    Parameter(
        "flush_interval_s",
        0.5,
        "Wall time between flushes; a killed recorder loses at most this much.",
        unit="s",
        minimum=0.01,
        maximum=60.0,
    ),
    FLIGHT_ID,
    Parameter("mission", "", "Mission name for the bag's custom data."),
    Parameter("law", "", "Guidance law for the bag's custom data."),
    Parameter("seed", 0, "Seed of the flight for the bag's custom data.", minimum=0),
)


def qos_of(profile: QoSProfile) -> Qos:
    """Convert a discovered or requested profile to rosbag2's terms."""
    known = profile.history in (HistoryPolicy.KEEP_LAST, HistoryPolicy.KEEP_ALL)
    return Qos(
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        history=profile.history.name.lower() if known else "unknown",
        depth=profile.depth if known else 0,
        liveliness=profile.liveliness.name.lower(),
        deadline_ns=profile.deadline.nanoseconds,
        lifespan_ns=profile.lifespan.nanoseconds,
        liveliness_lease_ns=profile.liveliness_lease_duration.nanoseconds,
    )


class RecorderNode(FlightNode):
    """Write the messages of one flight to a bag, serialized, with flight time as log time.

    The bag is closed when the flight is over. A write error ends the bag, not the flight: it is
    reported once on /diagnostics and on standard error, `error` holds its text, and the process
    exits with status 1. The same holds if messages were lost (navigation states are numbered, and
    guidance announces how many statuses it has sent), or if the bag is closed while the flight goes
    on.

    Attributes:
        error: why the bag is incomplete, one line; None if it is complete.
        lost: messages that were unreadable, or received after the write error.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters; the bag is created by `configure`."""
        super().__init__("recorder", parameters=PARAMETERS, **kwargs)
        self._writer: BagWriter | None = None
        self._inputs: list[Subscription] = []
        self._begin()

    def _begin(self) -> None:
        """Reset the counts of received messages for a new bag."""
        self.error: str | None = None
        self.lost = 0
        self._counts: dict[str, int] = {}
        self._latest = 0
        self._received = 0
        self._expected: dict[str, int] = {}
        self._statuses: Counter[int] = Counter()
        self._ending: Timer | None = None
        self._missing = 0
        #: the bag was closed while the flight went on
        self._cut_off = False
        #: the simulator has not started the flight, or has refused it
        self._unbegun = False
        self._held_back: list[Callable[[], None]] = []

    @property
    def message_counts(self) -> dict[str, int]:
        """Return the messages in the bag by full topic name; topics without any are left out."""
        counts = self._counts if self._writer is None else self._writer.counts
        return {topic: count for topic, count in counts.items() if count}

    def configure(self) -> None:
        """Look up the types and create the bag."""
        if not self.values["bag"]:
            raise NodeError("parameter bag is ''; expected the folder of a new bag")
        self._types = dict(self._typed(entry) for entry in self.values["topics"])
        custom_data = {name: str(self.values[name]) for name in ("mission", "law", "seed")}
        custom_data[DATE_KEY] = datetime.now(UTC).isoformat(timespec="seconds")
        custom_data[MACHINE_KEY] = (
            f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
        )
        try:
            self._writer = BagWriter(
                self.values["bag"], custom_data, flush_interval_s=self.values["flush_interval_s"]
            )
        except BagError as error:
            raise NodeError(str(error)) from error
        self._begin()
        self._membership = Membership(self, Role.RECORDER, flight_id=self.values["flight_id"])

    def activate(self) -> None:
        """Subscribe to the topics and to the announcements of members."""
        if self._writer is None:
            raise NodeError(
                f"bag {self.values['bag']} is closed; clean up, set parameter bag to a new folder "
                "and configure"
            )
        for name, (type_name, kind) in self._types.items():
            requested = qos.RECORDER_EVENTS if name == qos.FLIGHT_EVENT else qos.RECORDER
            full_name = self.resolve_topic_name(name)
            record = partial(
                self._record, full_name, type_name, requested, self._filter(name, kind)
            )
            # gaps in sequence numbers are a better measure of loss than the middleware's events
            lost = None if name in NUMBERED else self._on_lost
            self._inputs.append(
                self.create_subscription(
                    kind,
                    name,
                    record,
                    requested,
                    raw=True,
                    event_callbacks=SubscriptionEventCallbacks(message_lost=lost),
                )
            )
        # without a timer, the last messages before a pause would be flushed after it
        self._timer = self.wall_timer(self.values["flush_interval_s"], self._on_timer)
        self._membership.listen(self._on_member)

    def deactivate(self) -> None:
        """Record the messages still queued and close the bag."""
        self.drain_and_close()

    def cleanup(self) -> None:
        """Close the bag if it was never activated, and leave the flight."""
        self.drain_and_close()
        self._membership.close()

    def abandon(self) -> None:
        """Close the bag if the recorder is interrupted during start-up."""
        if self._writer is not None:
            self._writer.close()

    def drain(self, executor: Executor) -> None:
        """Drain the queues and close the bag; see `drain_and_close`."""
        self.drain_and_close(executor)

    def drain_and_close(self, executor: Executor | None = None) -> None:
        """Record messages until none arrives for 0.2 s (5 s at most), then close the bag.

        Wait for all messages that simulator and guidance have announced. Do nothing if the bag is
        closed.

        Args:
            executor: spun while waiting, so that other nodes on it can continue; must not be
                spinning now. None reads the queues directly and is safe in a callback.
        """
        if self._writer is None:
            return
        begin = quiet_since = time.monotonic()
        received = self._received
        while self._inputs:
            if executor is None:
                self._record_queued()
            else:
                executor.spin_once(timeout_sec=0.02)
            now = time.monotonic()
            if self._received != received:
                received = self._received
                quiet_since = now
            quiet = now - quiet_since >= QUIET_TIME
            if quiet and not self._outstanding():
                break
            if now - begin >= DRAIN_LIMIT:
                simulator = self._membership.simulator
                self._cut_off = (
                    not quiet and simulator is not None and simulator.state == State.FLYING
                )
                break
            if executor is None:
                time.sleep(0.005)
        self._close()

    def _typed(self, entry: str) -> tuple[str, tuple[str, Any]]:
        """Return topic name, type name and class of one entry of `topics`."""
        name, separator, type_name = entry.partition(":")
        type_name = type_name if separator else TYPES.get(name, "")
        if not name or not type_name:
            known = ", ".join(TYPES)
            raise NodeError(
                f"parameter topics has {entry!r}; expected one of {known}, or name:package/msg/Name"
            )
        try:
            kind = message_class(type_name)
        except BagError as error:
            raise NodeError(f"parameter topics has {entry!r}: {error}") from error
        if not starts_with_stamp(kind):
            raise NodeError(
                f"parameter topics has {entry!r}; expected a type that begins with a stamp"
            )
        return name, (type_name, kind)

    def _record_queued(self) -> None:
        for subscription in self._inputs:
            with subscription.handle:
                while taken := subscription.handle.take_message(subscription.msg_type, True):
                    subscription.callback(taken[0])

    # ---- the flight

    def _on_member(self, _member: FlightMember) -> None:
        agreed = self._membership.agree_as_observer()
        self._note_members()
        if agreed:
            self._try(lambda writer: writer.note())
        if self._membership.flight_id:
            self._record_held_back()
        simulator = self._membership.simulator
        if simulator is not None and simulator.state != State.LEFT:
            self._unbegun = simulator.state in (State.READY, State.FAILED)
        if simulator is None or simulator.state != State.OVER or self._writer is None:
            return
        if any(next_one > int(simulator.last_sequence) + 1 for next_one in self._expected.values()):
            # more states have arrived than announced: the announcement is not the simulator's
            return
        guidance = self._membership.guidance
        if guidance is None or guidance.state not in AGREED:
            self.drain_and_close()
        elif self._ending is None:
            # guidance may be dead and never announce its number of statuses
            self._ending = self.wall_timer(LAST_WORD_TIME, self.drain_and_close)

    def _note_members(self) -> None:
        """Store the settings of the simulator and of each accepted guidance in the custom data."""
        simulator, guidance = self._membership.simulator, self._membership.guidance
        if self._writer is None:
            return
        if simulator is not None and simulator.settings:
            self._writer.custom_data[SIMULATOR_KEY] = str(simulator.settings)
        if guidance is not None and guidance.settings:
            key = GUIDANCE_KEY + id_text(int(guidance.member_id))
            self._writer.custom_data[key] = str(guidance.settings)

    def _on_lost(self, info: Any) -> None:
        self._missing += info.total_count_change

    def _outstanding(self) -> int:
        """Return the number of announced messages that have not arrived."""
        mine = self._membership
        simulator, guidance = mine.simulator, mine.guidance
        if simulator is None or simulator.state != State.OVER:
            return 0
        # the last state of the truth is the end of the flight, which has no navigation state
        last = int(simulator.last_sequence)
        sent = {qos.NAV_STATE: last, qos.VEHICLE_STATE: last + 1}
        states = sum(sent[name] - next_one for name, next_one in self._expected.items())
        if (
            guidance is None
            or guidance.state != State.OVER
            or qos.GUIDANCE_STATUS not in self._types
        ):
            return states
        return states + int(guidance.last_sequence) - self._statuses[int(guidance.member_id)]

    def _filter(self, name: str, kind: Any) -> Callable[[bytes], bool]:
        """Return a predicate for this flight's messages on a topic; it counts the numbered ones."""
        if name == qos.DIAGNOSTICS:
            return self._is_our_report
        if not names_its_flight(kind):
            return lambda _data: True
        if name in NUMBERED:
            self._expected[name] = 0
            return partial(self._is_our_state, name)
        if name == qos.GUIDANCE_STATUS:
            return self._is_our_status
        return lambda data: self._is_ours(flight_of_cdr(data)[0])

    def _is_ours(self, flight_id: int) -> bool:
        if not self._membership.flight_id:
            self._membership.say(self._membership.state, flight_id=flight_id)
            self._record_held_back()
        return self._membership.belongs(flight_id)

    def _record_held_back(self) -> None:
        """Record the events received before the flight was known; drop those of other flights."""
        held, self._held_back = self._held_back, []
        for record in held:
            record()

    def _is_our_state(self, name: str, data: bytes) -> bool:
        flight_id, sequence = flight_of_cdr(data)
        if not self._is_ours(flight_id):
            return False
        self._missing += max(sequence - self._expected[name], 0)
        self._expected[name] = sequence + 1
        return True

    def _is_our_status(self, data: bytes) -> bool:
        if not self._is_ours(flight_of_cdr(data)[0]):
            return False
        self._statuses[guidance_of_cdr(data)] += 1
        return True

    def _is_our_report(self, data: bytes) -> bool:
        reports = message_of(data, DiagnosticArray).status
        if any(map(is_heartbeat, reports)):
            # heartbeats depend on the machine; a bag does not
            return False
        foreign = any(of_another_flight(report, self._membership.flight_id) for report in reports)
        self._membership.foreign += foreign
        return not foreign

    def _record(
        self,
        name: str,
        type_name: str,
        requested: QoSProfile,
        is_ours: Callable[[bytes], bool],
        data: bytes,
    ) -> None:
        if not self._membership.flight_id and requested is qos.RECORDER_EVENTS:
            # a late reader also gets events of an earlier flight, which must not be joined
            arguments = (name, type_name, requested, is_ours, data)
            self._held_back.append(lambda: self._record(*arguments))
            return
        try:
            stamp = stamp_of_cdr(data)
            if not is_ours(data):
                return
        except (struct.error, Unreadable):
            self.lost += 1
            return
        self._received += 1
        writer = self._writer
        if writer is None or writer.error is not None:
            self.lost += 1
            return
        if 0 <= stamp < WALL_CLOCK_NS:
            if stamp > self._latest:
                self._latest = stamp
        else:
            # a report of another node, stamped by the wall clock
            stamp = self._latest
        if name not in writer.counts:
            self._add_topic(writer, name, type_name, requested)
        try:
            writer.write(name, stamp, data)
        except BagError as error:
            self._report(error)

    def _add_topic(
        self, writer: BagWriter, name: str, type_name: str, requested: QoSProfile
    ) -> None:
        """Announce a topic with the QoS that its publishers offer at its first message.

        A message can arrive before its publisher is discovered; the requested QoS is then stored in
        the form of a discovered one, so that the bag is the same either way.
        """
        publishers = self.get_publishers_info_by_topic(name)
        offered = {qos_of(publisher.qos_profile) for publisher in publishers}
        asked = Qos(requested.reliability.name.lower(), requested.durability.name.lower())
        profiles = sorted(offered or {asked}, key=repr)
        writer.add_topic(Topic.installed(name, type_name, tuple(profiles)))

    def _on_timer(self) -> None:
        self._try(lambda writer: writer.flush())

    def _close(self) -> None:
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        if self._inputs:
            self.destroy_timer(self._timer)
        if self._ending is not None:
            self.destroy_timer(self._ending)
            self._ending = None
        self._inputs.clear()
        self._note_the_flight()
        if self._writer is not None and (self._unbegun or not self._received):
            # a flight that never started leaves no bag
            self._writer.discard()
        self._try(lambda writer: writer.close())
        if self._writer is not None:
            self._counts = self._writer.counts
        self._writer = None
        self._membership.say(State.FAILED if self.error else State.OVER, reason=self.error or "")

    def _note_the_flight(self) -> None:
        """Store the flight's identity, foreign messages and losses in the custom data."""
        writer, mine = self._writer, self._membership
        if writer is None or writer.error is not None:
            return
        if mine.flight_id:
            writer.custom_data["flight_id"] = id_text(mine.flight_id)
        if mine.foreign:
            writer.custom_data["foreign_messages"] = str(mine.foreign)
        missing = self._missing + self._outstanding()
        if missing or self._cut_off:
            reason = f"{missing} messages did not arrive" if missing else "the flight went on"
            writer.custom_data[INCOMPLETE_KEY] = reason
            self._report(BagError(f"bag {self.values['bag']} is incomplete: {reason}"))

    def _try(self, work: Callable[[BagWriter], None]) -> None:
        if self._writer is not None and self._writer.error is None:
            try:
                work(self._writer)
            except BagError as error:
                self._report(error)

    def _report(self, error: BagError) -> None:
        self.error = str(error)
        self.exit_code = 1
        print(f"{self.get_name()}: {error}", file=sys.stderr, flush=True)
        self.diagnostics.report(Level.ERROR, str(error), self._latest)
