# SPDX-License-Identifier: Apache-2.0
"""Who takes part in a flight: agreed on before its first navigation state.

The protocol is that of ares_msgs/FlightMember. A node that takes part makes a `Membership` at
the beginning of its `configure` and calls `listen` at the end of it, after its last endpoint:
whoever then answers its word is known to hear all its publishers.
"""

from collections.abc import Callable
from enum import IntEnum
from functools import partial

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from ares_msgs.msg import FlightMember
from ares_node.diagnostics import Level, worth_saying
from ares_node.identity import new_id
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
    """What a member does in a flight."""

    VEHICLE_SIM = FlightMember.VEHICLE_SIM
    GUIDANCE = FlightMember.GUIDANCE
    RECORDER = FlightMember.RECORDER
    JUDGE = FlightMember.JUDGE


class State(IntEnum):
    """How far a member has come."""

    PREPARING = FlightMember.PREPARING
    PRESENT = FlightMember.PRESENT
    READY = FlightMember.READY
    FLYING = FlightMember.FLYING
    OVER = FlightMember.OVER
    FAILED = FlightMember.FAILED
    LEFT = FlightMember.LEFT
    PLANNING = FlightMember.PLANNING


#: Members that are remembered; of more, those that spoke last.
MOST_HEARD = 1000

#: States in which a simulator has a flight to give away or in the air.
OPEN = (State.PREPARING, State.PRESENT, State.READY, State.FLYING)
#: States in which a guidance has agreed to a flight.
AGREED = (State.READY, State.PLANNING)


def _content(word: FlightMember) -> tuple[object, ...]:
    """Return all that a word says, to compare it with others."""
    return (
        word.words,
        word.state,
        word.flight_id,
        word.guidance_id,
        word.last_sequence,
        word.reason,
        word.mission,
        word.role,
    )


def _state_name(word: FlightMember) -> str:
    """The state in a word, for people."""
    return State(word.state).name if word.state in set(State) else f"state {word.state}"


def _report(node: Node, text: str) -> None:
    diagnostics = getattr(node, "diagnostics", None)
    if diagnostics is not None:
        diagnostics.report(Level.ERROR, text, 0)


class Membership:
    """One node's part in the agreement, and what it has heard of the others.

    Attributes:
        member_id: the node's own identity.
        flight_id: the flight; 0 until one is joined. Set by `say`, as are the next two.
        guidance_id: the guidance that flies this flight, as far as known; else 0.
        state: the node's own state.
        contradicted: words of others in this member's name.
        seals: of what the node says besides, and of what it hears.
        foreign: messages of other flights that `belongs` has refused.
    """

    def __init__(
        self,
        node: Node,
        role: Role,
        mission: str = "",
        flight_id: int = 0,
        complain: Callable[[str], None] | None = None,
    ) -> None:
        """Say that the node prepares.

        Args:
            node: the node that takes part.
            role: what it does.
            mission: name of its mission; empty for any.
            flight_id: the flight; 0 joins one that is heard of.
            complain: gets a line on words of others in names that are not theirs; None: a report
                of the node, if it makes reports.

        Raises:
            FlightKeyError: the environment holds a key that is none.
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
        self._word = FlightMember(
            flight_id=flight_id,
            member_id=self.member_id,
            role=role,
            state=State.PREPARING,
            mission=mission,
            node=node.get_fully_qualified_name(),
        )
        self._complain = complain or partial(_report, node)
        self.seals = Seals(node, lambda: self.flight_id, self._complain)
        #: what was said, to tell it from what others say in this name
        self._said: set[tuple[object, ...]] = set()
        self._out = node.create_publisher(FlightMember, FLIGHT_MEMBER, MEMBER)
        #: by which the last word of others was said
        self._others_out: list[Publisher] = []
        self._in: Subscription | None = None
        self._publish()

    def tell_settings(self, settings: str) -> None:
        """What the member flies by, for its word from `listen` on."""
        self._word.settings = settings

    def listen(self, changed: Callable[[FlightMember], None] = lambda _member: None) -> None:
        """Say that the node is there, and hear the others; the last endpoint to be made.

        Args:
            changed: called with the word of another member when it has said something new.
        """
        self._changed = changed
        self.say(State.PRESENT)
        self._in = self._node.create_subscription(
            FlightMember, FLIGHT_MEMBER, self._on_member, MEMBERS
        )

    def close(self) -> None:
        """Take part no more; that it failed is its last word."""
        if self.state is not State.FAILED:
            self.say(State.LEFT)
        if self._in is not None:
            self._node.destroy_subscription(self._in)
        for publisher in (self._out, *self._others_out):
            self._node.destroy_publisher(publisher)
        self.seals.close()

    def wait_until_heard(self, seconds: float) -> None:
        """Let the others get the own word, for so long at most."""
        self._out.wait_for_all_acked(Duration(seconds=seconds))

    def speak_for(self, member_id: int) -> None:
        """Say for another member, whose process is no more, that it takes part no more."""
        word = self._heard.get(member_id)
        if word is None or word.state == State.LEFT:
            return
        word.state = State.LEFT
        word.words += 1
        # not the own publisher: who comes later gets the last word of each
        publisher = self._node.create_publisher(FlightMember, FLIGHT_MEMBER, MEMBER)
        self._others_out.append(publisher)
        publisher.publish(self.seals.sealed(word))

    # ---- the own word

    def _publish(self) -> None:
        self._word.words += 1
        self._said.add(_content(self._word))
        self._out.publish(self.seals.sealed(self._word))

    def say(
        self,
        state: State,
        *,
        flight_id: int | None = None,
        guidance_id: int | None = None,
        last_sequence: int = 0,
        reason: str = "",
    ) -> None:
        """Change the own word and tell the others; what is not given stays."""
        word = self._word
        before = (self.state, self.flight_id, self.guidance_id)
        self.state = word.state = state
        if flight_id is not None:
            self.flight_id = word.flight_id = int(flight_id)
        if guidance_id is not None:
            self.guidance_id = word.guidance_id = int(guidance_id)
        word.last_sequence = last_sequence
        word.reason = reason
        if before != (self.state, self.flight_id, self.guidance_id):
            self._publish()

    # ---- the others

    def _on_member(self, member: FlightMember) -> None:
        known = self._heard.get(int(member.member_id))
        own = member.member_id == self.member_id
        if not self.seals.proves(member):
            # a stranger, who may have his own business here, has no part in this flight
            if own or known is not None:
                self.seals.note(f"a word of {member.node}, {_state_name(member)}")
            if own:
                self._publish()
            return
        if own:
            if _content(member) not in self._said:
                self._contradict(member)
            return
        if self.seals.key and known is not None and member.words <= known.words:
            # said before, and now by somebody else
            return
        self._heard[int(member.member_id)] = member
        if len(self._heard) > MOST_HEARD:
            del self._heard[next(iter(self._heard))]
        self._changed(member)

    def _contradict(self, member: FlightMember) -> None:
        """Say the own word again: somebody else has said another in this name."""
        self.contradicted += 1
        if worth_saying(self.contradicted):
            self._complain(
                f"{FORGED}a word in the name of {self._word.node}, {_state_name(member)}, "
                f"contradicted ({self.contradicted} so far)"
            )
        self._publish()

    def others(self, role: Role, *states: State) -> list[FlightMember]:
        """Members of this flight in a role and in one of some states, in order of arrival."""
        return [
            member
            for member in self._heard.values()
            if member.role == role
            and member.flight_id == self.flight_id
            and (not states or member.state in states)
        ]

    def preparing(self, role: Role) -> bool:
        """Whether somebody who may come to take this role still prepares."""
        return any(
            member.role == role
            and member.state == State.PREPARING
            and member.flight_id in (0, self.flight_id)
            for member in self._heard.values()
        )

    @property
    def simulator(self) -> FlightMember | None:
        """The last word of the simulator of this flight; None if there is none."""
        simulators = self.others(Role.VEHICLE_SIM) if self.flight_id else []
        return simulators[-1] if simulators else None

    @property
    def guidance(self) -> FlightMember | None:
        """The last word of the guidance that the simulator has accepted; None if there is none."""
        simulator = self.simulator
        return self._heard.get(int(simulator.guidance_id)) if simulator is not None else None

    def belongs(self, flight_id: int) -> bool:
        """Whether a message is of this flight; counts it if not."""
        if flight_id == self.flight_id and flight_id:
            return True
        self.foreign += 1
        return False

    def join(self, again: bool = False) -> FlightMember | None:
        """The simulator of the flight; joins a flight first if none was given.

        Args:
            again: leave the flight that was joined, not given, for one that waits for guidance.
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
        """Say that simulator and guidance are heard, and which guidance that is."""
        self.say(state, guidance_id=guidance_id)

    def witness(self) -> bool:
        """What recorder and judge do when somebody has spoken: agree once they hear all.

        Returns:
            Whether a simulator has a guidance, and this member hears both.
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
