# SPDX-License-Identifier: Apache-2.0
"""Other members of a flight: the count until all are there, guidance, its loss and successor."""

import math
import sys
import time

from ares_msgs.msg import FlightMember
from ares_node.diagnostics import Level
from ares_node.membership import AGREED, MOST_HEARD, OPEN, Membership, Role, State
from ares_node.node import FlightNode
from ares_node.run import EXIT_CANNOT_START
from ares_vehicle_sim.lock_step import LockStep

#: Period of the lines on missing members before the start, wall time, s.
WAITING_LINE_PERIOD = 10.0
#: Longest preparation of a member, wall time, s.
LONGEST_PREPARATION = 900.0


class OtherMembers:
    """Begin the flight when all members agree, and give it to the first guidance.

    Attributes:
        activated_at: begin of the wait for members, wall time, s.
    """

    def __init__(self, node: FlightNode, membership: Membership, flight: LockStep) -> None:
        """Begin without others."""
        self._node = node
        self._mine = membership
        self._flight = flight
        self._link = flight.link
        self._successor = 0
        self._warned: set[int] = set()
        flight.on_ground, flight.on_lost = self.count, self.choose_guidance

    # ---- the count

    def activate(self) -> None:
        """Begin to wait for members."""
        self.activated_at = self._waiting_line_at = self._patient_since = time.monotonic()

    def count(self, now: float) -> None:
        """Begin the flight, hold the count for the plan, or give up; ``now`` is wall time, s."""
        if self._flight.counting:
            self._hold(now)
        elif not self._flight.simulator.complete:
            self._try_to_start(now)

    def _try_to_start(self, now: float) -> None:
        missing, role = self.missing()
        waited = now - self.activated_at
        preparing = self._mine.preparing(role) and waited < LONGEST_PREPARATION
        if preparing:
            # a member that has just prepared needs time to agree
            self._patient_since = now
        if not missing:
            self._start()
        elif now - self._patient_since > self._node.values["start_timeout_s"]:
            self._give_up(f"no {missing} on the graph after {waited:.0f} s")
        else:
            why = ", which still prepares (compiling, the first time)" if preparing else ""
            self._log_waiting(f"waiting for {missing}{why}", now)

    def _start(self) -> None:
        """Begin the flight, or hold the count until guidance has its plan."""
        if self._link.planning_since > -math.inf:
            self._link.planning_since = self._waiting_line_at = time.monotonic()
            self._flight.hold_count()
        else:
            self._flight.begin()

    def _hold(self, now: float) -> None:
        """Hold the count for the plan until `start_timeout_s`."""
        waited = now - self._link.planning_since
        if waited > self._node.values["start_timeout_s"]:
            self._give_up(f"not flown: guidance has no plan after {waited:.0f} s")
        else:
            self._log_waiting("the count is held: guidance plans the flight", now)

    def _log_waiting(self, line: str, now: float) -> None:
        if now - self._waiting_line_at > WAITING_LINE_PERIOD:
            self._waiting_line_at = now
            self._node.get_logger().info(line)

    def missing(self) -> tuple[str, Role]:
        """Return the missing member as a text and a role; an empty text if none is missing."""
        mine = self._mine

        def ready(role: Role) -> list[int]:
            members = mine.others(role, *AGREED)
            return [int(m.member_id) for m in members if m.guidance_id == mine.guidance_id]

        if not mine.guidance_id or mine.guidance_id not in ready(Role.GUIDANCE):
            others = filter(None, map(mine.other_mission, mine.others(Role.GUIDANCE)))
            suffix = next((f" for mission {own}" for _, own in others), "")
            return f"guidance{suffix}", Role.GUIDANCE
        for role, expected in (
            (Role.RECORDER, self._node.values["expected_recorders"]),
            (Role.JUDGE, self._node.values["expected_judges"]),
        ):
            if len(ready(role)) < expected:
                return role.name.lower(), role
        return "", Role.GUIDANCE

    def _give_up(self, reason: str) -> None:
        if self._flight.counting:
            self._flight.counting = False
            self._mine.say(State.FAILED, reason=reason)
        print(f"{self._node.get_name()}: {reason}", file=sys.stderr, flush=True)
        self._node.failure = reason
        self._flight.report(Level.ERROR, reason)
        self._flight.end_watch()
        self._node.finish(EXIT_CANNOT_START)

    # ---- announcements

    def hear(self, member: FlightMember) -> None:
        """Handle a member's message: give the flight to the first guidance, report others."""
        if self._node.done:
            return
        if member.role == Role.VEHICLE_SIM:
            self._on_simulator(member)
        elif member.role == Role.GUIDANCE and member.flight_id == self._mine.flight_id:
            self._on_guidance(member)

    def _on_simulator(self, member: FlightMember) -> None:
        if member.state not in (State.PRESENT, State.READY, State.FLYING):
            return
        if self._flight.simulator.complete:
            # a simulator after the end of the flight is no conflict
            return
        ours = member.flight_id == self._mine.flight_id
        given = bool(self._node.values["flight_id"]) and not ours
        taken = (State.READY, State.FLYING)
        if self._mine.state in taken or given:
            self._warn_about(
                member, f"another simulator, {member.node}: it has no part in this flight"
            )
        elif member.state in taken or member.member_id < self._mine.member_id:
            # of two waiting simulators only one continues
            self._give_up(f"another simulator already publishes {self._flight.messages.nav_topic}")

    def _on_guidance(self, member: FlightMember) -> None:
        mine = self._mine
        if other := mine.other_mission(member):
            theirs, own = other
            self._warn_about(
                member,
                f"{member.node} guides mission {theirs}, this is {own}: it has no part in this "
                "flight",
            )
        elif member.member_id == mine.guidance_id:
            if member.state in (State.LEFT, State.FAILED):
                if self._flight.counting:
                    why = member.reason or f"{member.node} has left while it planned"
                    self._give_up(f"not flown: {why}")
                elif mine.state in OPEN:
                    self._on_guidance_gone()
            elif member.state in AGREED:
                self._on_guidance_agreed(member)
        elif member.state == State.PRESENT:
            if mine.guidance_id:
                self._warn_about(
                    member, f"a second guidance, {member.node}: it has no part in this flight"
                )
            self.choose_guidance()

    def choose_guidance(self) -> None:
        """Accept a guidance if there is none, or if the present one is lost in flight."""
        mine = self._mine
        if mine.guidance_id and not self._link.lost:
            return
        for member in mine.others(Role.GUIDANCE, State.PRESENT):
            if not mine.other_mission(member) and member.member_id != mine.guidance_id:
                if self._flight.flying:
                    text = f"{member.node} takes over from lost guidance"
                    self._flight.report(Level.WARN, text)
                    self._successor = int(member.member_id)
                mine.say(mine.state, guidance_id=int(member.member_id))
                return

    def _on_guidance_gone(self) -> None:
        """Handle the loss of guidance; a flight without pace waits a while for a successor."""
        self._mine.say(self._mine.state, guidance_id=0)
        if self._flight.flying:
            self._flight.note_loss()
            self._link.deadline = time.monotonic()
            if self._node.values["pace"] == 0.0:
                self._link.deadline += self._link.timeout_s
        self.choose_guidance()

    def _on_guidance_agreed(self, member: FlightMember) -> None:
        """Handle the agreement of the accepted guidance, READY or PLANNING."""
        planning = member.state == State.PLANNING
        self._link.planning_since = time.monotonic() if planning else -math.inf
        if self._flight.counting and not planning:
            self._flight.lift_off()
        elif self._successor == member.member_id:
            self._successor = 0
            # it has not received the present state: wait for its answers from the next on
            self._flight.regain_link()
            self._flight.go_on()
        elif self._link.waiting and not planning:
            # guidance is about to answer
            self._link.deadline = time.monotonic() + self._link.patience_s

    def _warn_about(self, member: FlightMember, text: str) -> None:
        """Report a warning about another node once."""
        if member.member_id not in self._warned and len(self._warned) < MOST_HEARD:
            self._warned.add(int(member.member_id))
            self._node.diagnostics.report(Level.WARN, text, self._flight.simulator.time_ns)
