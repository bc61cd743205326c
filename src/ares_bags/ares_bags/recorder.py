# SPDX-License-Identifier: Apache-2.0
"""The recorder node: every flight message to a bag, as it was sent."""

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
from ares_node.diagnostics import Level, of_another_flight
from ares_node.heartbeat import is_heartbeat
from ares_node.identity import id_text
from ares_node.membership import AGREED, FLIGHT_ID, Membership, Role, State
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter
from ares_node.qos import (
    DIAGNOSTICS,
    FLIGHT_EVENT,
    GUIDANCE_STATUS,
    NAV_STATE,
    RECORDER,
    RECORDER_EVENTS,
    THRUST_COMMAND,
    VEHICLE_STATE,
)
from ares_node.states import Unreadable, message_of

#: Types of the topics that need not be spelt out.
TYPES = {
    NAV_STATE: "ares_msgs/msg/NavState",
    VEHICLE_STATE: "ares_msgs/msg/VehicleState",
    THRUST_COMMAND: "ares_msgs/msg/ThrustCommand",
    GUIDANCE_STATUS: "ares_msgs/msg/GuidanceStatus",
    FLIGHT_EVENT: "ares_msgs/msg/FlightEvent",
    DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
}

#: Wall time in s without a message after which the queues count as empty.
QUIET_TIME = 0.2
#: Wall time in s after which draining ends although messages still come, or states are missing.
DRAIN_LIMIT = 5.0
#: Wall time in s that guidance has to say how many statuses it has sent when the flight is over.
LAST_WORD_TIME = 1.0
#: Topics whose messages are numbered without gaps.
NUMBERED = (NAV_STATE, VEHICLE_STATE)

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
    """A discovered or requested profile in rosbag2's words."""
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
    """Writes the messages of one flight to a bag, raw, with flight time as log time.

    The bag is closed when the flight is over. A write error ends the bag, not the flight: it
    is reported once on /diagnostics and on standard error, `error` says what happened, and the
    process will exit with status 1. So it is with messages that did not arrive: navigation
    states are numbered, and guidance says how many statuses it has sent. So it is, too, with a
    bag that has to be closed while the flight goes on.

    Attributes:
        error: why the bag is incomplete, one line; None if it is not.
        lost: messages that came after the write error.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters; the bag is created by `configure`."""
        super().__init__("recorder", parameters=PARAMETERS, **kwargs)
        self._writer: BagWriter | None = None
        self._inputs: list[Subscription] = []
        self._begin()

    def _begin(self) -> None:
        """Nothing has been received for this bag."""
        self.error: str | None = None
        self.lost = 0
        self._counts: dict[str, int] = {}
        self._latest = 0
        self._received = 0
        self._expected: dict[str, int] = {}
        self._statuses: Counter[int] = Counter()
        self._ending: Timer | None = None
        self._missing = 0
        #: the bag was closed while the flight went on, which may end before this process does
        self._cut_off = False
        #: the simulator holds the count, or has refused the flight
        self._unbegun = False
        self._held_back: list[Callable[[], None]] = []

    @property
    def message_counts(self) -> dict[str, int]:
        """Messages in the bag by full topic name; only topics that had any."""
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
                self.values["bag"],
                custom_data,
                flush_interval_s=self.values["flush_interval_s"],
            )
        except BagError as error:
            raise NodeError(str(error)) from error
        self._begin()
        self._membership = Membership(self, Role.RECORDER, flight_id=self.values["flight_id"])

    def activate(self) -> None:
        """Subscribe."""
        if self._writer is None:
            raise NodeError(
                f"bag {self.values['bag']} is closed; clean up, set parameter bag to a new folder "
                "and configure"
            )
        for name, (type_name, kind) in self._types.items():
            qos = RECORDER_EVENTS if name == FLIGHT_EVENT else RECORDER
            full_name = self.resolve_topic_name(name)
            take = partial(self._take, full_name, type_name, qos, self._filter(name, kind))
            # gaps in numbers tell more than the middleware does
            lost = None if name in NUMBERED else self._on_lost
            self._inputs.append(
                self.create_subscription(
                    kind,
                    name,
                    take,
                    qos,
                    raw=True,
                    event_callbacks=SubscriptionEventCallbacks(message_lost=lost),
                )
            )
        # messages that came last before a pause must not wait for the next one
        self._timer = self.wall_timer(self.values["flush_interval_s"], self._on_timer)
        self._membership.listen(self._on_member)

    def deactivate(self) -> None:
        """Take what is still in the queues and close the bag."""
        self.drain_and_close()

    def cleanup(self) -> None:
        """Close a bag that was never recorded to."""
        self.drain_and_close()
        self._membership.close()

    def abandon(self) -> None:
        """Close a bag whose recorder was interrupted while it started."""
        if self._writer is not None:
            self._writer.close()

    def drain(self, executor: Executor) -> None:
        """See `drain_and_close`."""
        self.drain_and_close(executor)

    def drain_and_close(self, executor: Executor | None = None) -> None:
        """Take messages until none has come for 0.2 s (5 s at most), then close the bag.

        Where simulator and guidance have said how many messages there were, all of them are waited
        for.
        Does nothing if the bag is closed already.

        Args:
            executor: spun while waiting, so that other nodes on it can go on; must not be
                spinning now. None takes from the queues directly and may be used in a
                callback.
        """
        if self._writer is None:
            return
        begin = quiet_since = time.monotonic()
        received = self._received
        while self._inputs:
            if executor is None:
                self._take_all()
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
        """Topic name, type name and class of one entry of `topics`."""
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

    def _take_all(self) -> None:
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
            self._take_held_back()
        simulator = self._membership.simulator
        if simulator is not None and simulator.state != State.LEFT:
            self._unbegun = simulator.state in (State.READY, State.FAILED)
        if simulator is None or simulator.state != State.OVER or self._writer is None:
            return
        if any(next_one > int(simulator.last_sequence) + 1 for next_one in self._expected.values()):
            # more has come than that: not the simulator's own word
            return
        guidance = self._membership.guidance
        if guidance is None or guidance.state not in AGREED:
            self.drain_and_close()
        elif self._ending is None:
            # it may be dead and never say how many statuses there were
            self._ending = self.wall_timer(LAST_WORD_TIME, self.drain_and_close)

    def _note_members(self) -> None:
        """Keep what the simulator flies, and what each guidance that was accepted flies by."""
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
        """What simulator and guidance have said to have sent and that has not come yet."""
        mine = self._membership
        simulator, guidance = mine.simulator, mine.guidance
        if simulator is None or simulator.state != State.OVER:
            return 0
        # the last state of the truth is the end of the flight, which has no navigation state
        last = int(simulator.last_sequence)
        sent = {NAV_STATE: last, VEHICLE_STATE: last + 1}
        states = sum(sent[name] - next_one for name, next_one in self._expected.items())
        if guidance is None or guidance.state != State.OVER or GUIDANCE_STATUS not in self._types:
            return states
        return states + int(guidance.last_sequence) - self._statuses[int(guidance.member_id)]

    def _filter(self, name: str, kind: Any) -> Callable[[bytes], bool]:
        """What tells the messages of this flight, and counts the numbered ones."""
        if name == DIAGNOSTICS:
            return self._is_our_report
        if not names_its_flight(kind):
            return lambda _data: True
        if name in NUMBERED:
            self._expected[name] = 0
            return partial(self._is_our_state, name)
        if name == GUIDANCE_STATUS:
            return self._is_our_status
        return lambda data: self._is_ours(flight_of_cdr(data)[0])

    def _is_ours(self, flight_id: int) -> bool:
        if not self._membership.flight_id:
            self._membership.say(self._membership.state, flight_id=flight_id)
            self._take_held_back()
        return self._membership.belongs(flight_id)

    def _take_held_back(self) -> None:
        """Take the events that came before the flight was known; others' are left out."""
        held, self._held_back = self._held_back, []
        for take in held:
            take()

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
            # a bag says of a flight what is the same on every machine
            return False
        foreign = any(of_another_flight(report, self._membership.flight_id) for report in reports)
        self._membership.foreign += foreign
        return not foreign

    def _take(
        self,
        name: str,
        type_name: str,
        requested: QoSProfile,
        is_ours: Callable[[bytes], bool],
        data: bytes,
    ) -> None:
        if not self._membership.flight_id and requested is RECORDER_EVENTS:
            # those of a flight before come to a late reader too: they are no flight to join
            arguments = (name, type_name, requested, is_ours, data)
            self._held_back.append(lambda: self._take(*arguments))
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
            # somebody else's report, stamped by another clock
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

        A message can come before its publisher is known; what was asked for then stands in
        the form in which discovery tells it, so that the bag is the same either way.
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
            # a flight that never began leaves no bag
            self._writer.discard()
        self._try(lambda writer: writer.close())
        if self._writer is not None:
            self._counts = self._writer.counts
        self._writer = None
        self._membership.say(State.FAILED if self.error else State.OVER, reason=self.error or "")

    def _note_the_flight(self) -> None:
        """Say in the bag which flight it holds, and what is missing in it."""
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
