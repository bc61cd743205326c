# SPDX-License-Identifier: Apache-2.0
"""Membership in a flight, agreed on before its first navigation state.

ares_msgs/FlightMember describes the protocol. A member makes a `Membership` at the start of its
`configure` and calls `listen` at the end, after its last endpoint: a node that answers its
announcement is then known to receive from all its publishers.
"""

import json
from collections.abc import Callable
from enum import IntEnum
from functools import partial
from operator import attrgetter

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from ares_msgs.msg import FlightMember
from ares_node.diagnostics import Level, is_worth_reporting
from ares_node.identity import MISSION_DIGEST, new_id
from ares_node.key import FORGED
from ares_node.parameters import Parameter
from ares_node.qos import FLIGHT_MEMBER, MEMBER, MEMBERS
from ares_node.seal import Seals

FLIGHT_ID = Parameter(
    "flight_id",
    0,
    "Identity of the flight to take part in; 0: drawn by the simulator, and the others join the "
    "first flight that needs them.",
    minimum=0,
)


class Role(IntEnum):
    """Name the roles of members in a flight."""

    VEHICLE_SIM = FlightMember.VEHICLE_SIM
    GUIDANCE = FlightMember.GUIDANCE
    RECORDER = FlightMember.RECORDER
    JUDGE = FlightMember.JUDGE


class State(IntEnum):
    """Name the states of a member."""

    PREPARING = FlightMember.PREPARING
    PRESENT = FlightMember.PRESENT
    READY = FlightMember.READY
    FLYING = FlightMember.FLYING
    OVER = FlightMember.OVER
    FAILED = FlightMember.FAILED
    LEFT = FlightMember.LEFT
    PLANNING = FlightMember.PLANNING


#: Largest number of members remembered; the oldest is dropped.
MOST_HEARD = 1000

#: States of a simulator with a flight that is open or in the air.
OPEN = (State.PREPARING, State.PRESENT, State.READY, State.FLYING)
#: States in which a guidance has agreed to a flight.
AGREED = (State.READY, State.PLANNING)

#: Returns the content of an announcement, to compare it with others.
_content = attrgetter(
    *("words", "state", "flight_id", "guidance_id", "last_sequence", "reason", "mission", "role")
)


def _mission_digest(member: FlightMember) -> str:
    """Return the digest of a member's mission; "" where its settings do not tell it."""
    try:
        told = json.loads(member.settings or "{}")
    except (ValueError, RecursionError):
        return ""
    return str(told.get(MISSION_DIGEST, "")) if isinstance(told, dict) else ""


def _state_name(member: FlightMember) -> str:
    """Return the name of the state in an announcement."""
    return State(member.state).name if member.state in set(State) else f"state {member.state}"


def _report(node: Node, text: str) -> None:
    diagnostics = getattr(node, "diagnostics", None)
    if diagnostics is not None:
        diagnostics.report(Level.ERROR, text, 0)


class Membership:
    """Announce a node's part in the agreement, and remember the other members.

    Attributes:
        member_id: the node's own identity.
        flight_id: the flight; 0 until one is joined. Set by `say`.
        guidance_id: the accepted guidance of this flight, if known, else 0. Set by `say`.
        state: the node's own state. Set by `say`.
        contradicted: number of forged announcements in this member's name.
        seals: of the node's other messages.
        foreign: number of messages of other flights refused by `belongs`.
    """

    def __init__(
        self,
        node: Node,
        role: Role,
        mission: str = "",
        flight_id: int = 0,
        complain: Callable[[str], None] | None = None,
    ) -> None:
        """Announce that the node prepares.

        Args:
            node: the member.
            role: of the member.
            mission: name of its mission; empty for any.
            flight_id: the flight; 0 joins an announced one.
            complain: called with a line on each forged announcement; None: a report of the
                node, if it has diagnostics.

        Raises:
            FlightKeyError: the environment holds an invalid key.
        """
        self.member_id = new_id()
        self.flight_id = flight_id
        self.guidance_id = 0
        self.state = State.PREPARING
        self.foreign = 0
        self.contradicted = 0
        self._node = node
        self._given = flight_id
        self._heard: dict[int, FlightMember] = {}
        self._announcement = FlightMember(
            flight_id=flight_id,
            member_id=self.member_id,
            role=role,
            state=State.PREPARING,
            mission=mission,
            node=node.get_fully_qualified_name(),
        )
        self._complain = complain or partial(_report, node)
        self.seals = Seals(node, lambda: self.flight_id, self._complain)
        #: own announcements, to recognise forged ones
        self._announced: set[tuple[object, ...]] = set()
        self._out = node.create_publisher(FlightMember, FLIGHT_MEMBER, MEMBER)
        #: publishers of announcements for other members
        self._others_out: list[Publisher] = []
        self._in: Subscription | None = None
        self._publish()

    def announce_settings(self, settings: str) -> None:
        """Attach settings to announcements from `listen` on."""
        self._announcement.settings = settings

    def listen(self, changed: Callable[[FlightMember], None] = lambda _member: None) -> None:
        """Announce that the node is present and subscribe to the others; call it last.

        Args:
            changed: called with each new announcement of another member.
        """
        self._changed = changed
        self.say(State.PRESENT)
        self._in = self._node.create_subscription(
            FlightMember, FLIGHT_MEMBER, self._on_member, MEMBERS
        )

    def close(self) -> None:
        """Announce that the member has left, unless it has failed, and free the endpoints."""
        if self.state is not State.FAILED:
            self.say(State.LEFT)
        if self._in is not None:
            self._node.destroy_subscription(self._in)
        for publisher in (self._out, *self._others_out):
            self._node.destroy_publisher(publisher)
        self.seals.close()

    def other_mission(self, member: FlightMember) -> tuple[str, str] | None:
        """Return how a member's mission and the own one differ; None: they do not.

        Returns:
            Their names; for equal names, each with the digest of its numbers.
        """
        mine = self._announcement
        if "" in (mine.mission, member.mission):
            return None
        if mine.mission != member.mission:
            return str(member.mission), str(mine.mission)
        theirs, own = _mission_digest(member), _mission_digest(mine)
        if theirs == own or "" in (theirs, own):
            return None
        return f"{member.mission} with digest {theirs}", f"{mine.mission} with digest {own}"

    def wait_until_heard(self, seconds: float) -> None:
        """Wait until the others have received the last announcement, at most ``seconds``."""
        self._out.wait_for_all_acked(Duration(seconds=seconds))

    def announce_departure(self, member_id: int) -> None:
        """Announce that another member, whose process has ended, has left."""
        announcement = self._heard.get(member_id)
        if announcement is None or announcement.state == State.LEFT:
            return
        announcement.state = State.LEFT
        announcement.words += 1
        # another publisher: late readers get the last announcement of each publisher
        publisher = self._node.create_publisher(FlightMember, FLIGHT_MEMBER, MEMBER)
        self._others_out.append(publisher)
        publisher.publish(self.seals.sealed(announcement))

    # ---- own announcements

    def _publish(self) -> None:
        self._announcement.words += 1
        self._announced.add(_content(self._announcement))
        self._out.publish(self.seals.sealed(self._announcement))

    def say(
        self,
        state: State,
        *,
        flight_id: int | None = None,
        guidance_id: int | None = None,
        last_sequence: int = 0,
        reason: str = "",
    ) -> None:
        """Change the own state and announce it; arguments that are None keep their values."""
        announcement = self._announcement
        before = (self.state, self.flight_id, self.guidance_id)
        self.state = announcement.state = state
        if flight_id is not None:
            self.flight_id = announcement.flight_id = int(flight_id)
        if guidance_id is not None:
            self.guidance_id = announcement.guidance_id = int(guidance_id)
        announcement.last_sequence = last_sequence
        announcement.reason = reason
        if before != (self.state, self.flight_id, self.guidance_id):
            self._publish()

    # ---- other members

    def _on_member(self, member: FlightMember) -> None:
        known = self._heard.get(int(member.member_id))
        own = member.member_id == self.member_id
        if not self.seals.proves(member):
            # an unknown node without the key, perhaps of another flight, is ignored
            if own or known is not None:
                self.seals.note(f"a word of {member.node}, {_state_name(member)}")
            if own:
                self._publish()
            return
        if own:
            if _content(member) not in self._announced:
                self._contradict(member)
            return
        if self.seals.key and known is not None and member.words <= known.words:
            # a replay of an old announcement
            return
        self._heard[int(member.member_id)] = member
        if len(self._heard) > MOST_HEARD:
            del self._heard[next(iter(self._heard))]
        self._changed(member)

    def _contradict(self, member: FlightMember) -> None:
        """Repeat the own announcement after a forged one in this member's name."""
        self.contradicted += 1
        if is_worth_reporting(self.contradicted):
            self._complain(
                f"{FORGED}a word in the name of {self._announcement.node}, {_state_name(member)}, "
                f"contradicted ({self.contradicted} so far)"
            )
        self._publish()

    def others(self, role: Role, *states: State) -> list[FlightMember]:
        """Return the members of this flight in a role and in given states, in order of arrival."""
        return [
            member
            for member in self._heard.values()
            if member.role == role
            and member.flight_id == self.flight_id
            and (not states or member.state in states)
        ]

    def preparing(self, role: Role) -> bool:
        """Return whether a possible member in this role still prepares."""
        return any(
            member.role == role
            and member.state == State.PREPARING
            and member.flight_id in (0, self.flight_id)
            for member in self._heard.values()
        )

    @property
    def simulator(self) -> FlightMember | None:
        """Return the last announcement of this flight's simulator, or None."""
        simulators = self.others(Role.VEHICLE_SIM) if self.flight_id else []
        return simulators[-1] if simulators else None

    @property
    def guidance(self) -> FlightMember | None:
        """Return the last announcement of the accepted guidance, or None."""
        simulator = self.simulator
        return self._heard.get(int(simulator.guidance_id)) if simulator is not None else None

    def belongs(self, flight_id: int) -> bool:
        """Return whether a message is of this flight; count it if not."""
        if flight_id == self.flight_id and flight_id:
            return True
        self.foreign += 1
        return False

    def join(self, again: bool = False) -> FlightMember | None:
        """Return the simulator of the flight; join a flight first if none was given.

        Args:
            again: leave a flight that was joined, not given, for one that waits for guidance.
        """
        if self.flight_id == 0 or (again and not self._given):
            simulators = [
                member
                for member in self._heard.values()
                if member.role == Role.VEHICLE_SIM and member.state in OPEN and member.flight_id
            ]
            waiting = [member for member in simulators if not member.guidance_id]
            found = waiting or ([] if self.flight_id else simulators)
            if found and found[-1].flight_id != self.flight_id:
                self.say(State.PRESENT, flight_id=int(found[-1].flight_id), guidance_id=0)
        return self.simulator

    def agree(self, guidance_id: int, state: State = State.READY) -> None:
        """Announce that simulator and guidance ``guidance_id`` are received."""
        self.say(state, guidance_id=guidance_id)

    def agree_as_observer(self) -> bool:
        """Agree, as a recorder or judge, once simulator and guidance are received.

        Returns:
            Whether the simulator has a guidance and this member receives both.
        """
        simulator = self.join()
        if simulator is None or not simulator.guidance_id:
            return False
        guidance = int(simulator.guidance_id)
        if guidance not in self._heard:
            return False
        if guidance != self.guidance_id and self.state in (State.PRESENT, State.READY):
            self.agree(guidance)
        return True
