# SPDX-License-Identifier: Apache-2.0
"""Flight in lock-step with guidance, or in real time: steps, commands, lost answers."""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.timer import Timer

from ares_models.arrays import STEERING
from ares_models.passage import AirState, Passage
from ares_msgs.msg import FlightEvent, ThrustCommand
from ares_node.diagnostics import PASSAGE, Level, is_worth_reporting
from ares_node.identity import id_text
from ares_node.key import FORGED
from ares_node.membership import Membership, State
from ares_node.node import FlightNode
from ares_node.qos import EVENTS, FLIGHT, FLIGHT_EVENT, THRUST_COMMAND
from ares_node.run import EXIT_OK
from ares_node.seal import canonical
from ares_node.time import NANOSECONDS, ns_from_seconds, ns_from_stamp
from ares_vehicle_sim.arrays import GUIDANCE_BACK, GUIDANCE_LOST
from ares_vehicle_sim.link import LINK_LOST_AFTER, GuidanceLink
from ares_vehicle_sim.messages import FlightPublishers
from ares_vehicle_sim.pace import FlightPace
from ares_vehicle_sim.simulator import CommandRefused, Simulator

#: Period of the checks of graph and clock, wall time, s.
WATCH_PERIOD = 0.02
#: Period of the messages on the pace, wall time, s.
PACE_PERIOD = 1.0
#: Period of the steps on a lost link, in which an answer can still arrive, wall time, s.
LOST_LINK_PERIOD = 0.001


class LockStep:
    """Publish each navigation state, wait for its command, fly by it to the next.

    Attributes:
        simulator: the flight.
        messages: publishers of the flight.
        link: to guidance.
        pace: of the flight.
        report: called with level, text and perhaps values.
        counting: the count is held: guidance has the first state and plans.
        flying: the flight has begun and is not over.
        paused: the next step waits for the end of a pause.
        on_ground: called with the wall time, s, at each check before the flight.
        on_lost: called when the link is lost.
    """

    on_ground: Callable[[float], None]
    on_lost: Callable[[], None]

    def __init__(
        self,
        node: FlightNode,
        membership: Membership,
        simulator: Simulator,
        passage: Passage | None,
        report: Callable[..., None],
    ) -> None:
        """Create the endpoints; ``passage`` follows the climb through the air, if there is one."""
        self._node = node
        self._values = values = node.values
        self._membership = membership
        self._passage = passage
        self._told_passage: tuple[AirState | None, ...] = ()
        self.simulator = simulator
        self.report = report
        self.messages = FlightPublishers(node, membership, simulator)
        take = membership.seals.reader(THRUST_COMMAND, self.on_command)
        self._command_in = node.create_subscription(ThrustCommand, THRUST_COMMAND, take, FLIGHT)
        self._events_in = node.create_subscription(
            FlightEvent, FLIGHT_EVENT, self._on_event, EVENTS
        )
        self.link = GuidanceLink(values["command_timeout_s"])
        self.pace = FlightPace(values["navigation_period_s"])
        self.flying = self.counting = self.paused = False
        self._steering = np.zeros(1, STEERING)
        self._accepted: ThrustCommand | None = None
        self._answered_ns = -1
        self._oldest_ns = ns_from_seconds(values["longest_command_age_s"])
        self._arrived: ThrustCommand | None = None
        self._unanswered = False
        self._refused = self._forged = 0
        self._watch: Timer | None = None
        self._paced: Timer | None = None
        self._pace_published_at = -math.inf

    def close(self) -> None:
        """Free the endpoints."""
        self.messages.close()
        self._node.destroy_subscription(self._command_in)
        self._node.destroy_subscription(self._events_in)

    # ---- begin and end

    def watch(self, period: float = WATCH_PERIOD) -> None:
        """Begin the periodic checks; periods are wall time, s."""
        self._watch = self._node.wall_timer(period, self.on_watch)

    def end_watch(self) -> None:
        """End the periodic checks; before the node is active there are none."""
        if self._watch is not None:
            self._node.destroy_timer(self._watch)
            self._watch = None

    def on_watch(self) -> None:
        """Check who is missing before the flight, whether an answer is overdue in it."""
        now = time.monotonic()
        if not self.flying:
            self.on_ground(now)
            return
        if now - self._pace_published_at > PACE_PERIOD:
            self._say_pace()
        if self.link.lost:
            self.go_on()
        elif self.link.is_overdue(now, self._values["pace"] > 0.0):
            self.link.waiting = False
            self._on_no_answer()
            self._step()

    def stop(self) -> None:
        """Stop for good."""
        self.end_watch()
        self._stop_pacing()
        self.link.waiting = self.paused = self.counting = False

    def hold_count(self) -> None:
        """Publish the first state alone, from which guidance plans."""
        self.counting = True
        self._membership.say(State.READY)
        self.messages.publish_measured()

    def lift_off(self) -> None:
        """End the count: guidance has its plan and answers the first state."""
        self.counting = False
        self.link.planning_since = -math.inf
        self._fly()
        self._publish_truth()
        self._await_answer()

    def begin(self) -> None:
        """Begin the flight."""
        self._fly()
        self._publish()

    def _fly(self) -> None:
        self.flying = True
        self._membership.say(State.FLYING)
        self._begin_pace()

    def _end(self) -> None:
        self.flying = False
        self.regain_link()
        self._membership.say(State.OVER, last_sequence=self.simulator.sequence)
        if self._values["exit_when_complete"]:
            self._node.finish(EXIT_OK if self.simulator.ended_well else 1)

    # ---- steps

    def _publish(self) -> None:
        self._publish_truth()
        if self.simulator.complete:
            self._end()
            return
        if self._real_time and self._accepted is not None:
            self.messages.publish_measured()
            self._fly_on()
            return
        self._await_answer()
        self.messages.publish_measured()

    @property
    def _real_time(self) -> bool:
        """Return whether the vehicle flies in real time, without waiting for answers."""
        return self._oldest_ns > 0 and self._values["pace"] > 0.0

    def _fly_on(self) -> None:
        """Continue in real time by the newest command, however old it is."""
        age = self.simulator.time_ns - self._answered_ns
        self.pace.deadlines.note_age(age)
        if age > self._oldest_ns and not self.link.lost:
            self.note_loss()
            self._lose_link(f"no command younger than {self._oldest_ns / NANOSECONDS:g} s")
        self._step()

    def _await_answer(self) -> None:
        self._unanswered = True
        self.link.wait(time.monotonic())

    def _publish_truth(self) -> None:
        """Publish the true state, the clock, and the events up to now."""
        simulator = self.simulator
        self._pass_air(self.messages.publish_truth())
        if simulator.complete:
            # before the final event: the judge ignores later reports
            for line in filter(None, (simulator.escaped, *simulator.overloads)):
                self.report(Level.WARN, line)
        if simulator.complete and self._real_time:
            level = Level.WARN if self.pace.deadlines.missed else Level.OK
            self.report(level, str(self.pace.deadlines))
        for event in simulator.new_events():
            self.messages.publish_event(event)

    def _pass_air(self, truth: Any) -> None:
        """Follow the climb through the air; tell of it once above, and at the end if it is new."""
        passage = self._passage
        if passage is None:
            return
        names = ("altitude", "mass", "dynamic_pressure", "mach")
        now = (float(truth[name]) for name in names)
        passage.add(AirState(self.simulator.time_ns / NANOSECONDS, *now))
        over = self.simulator.complete or passage.left_s is not None
        found = passage.mach_1, passage.max_q
        if over and passage.max_q is not None and found != self._told_passage:
            self._told_passage = found
            self.report(
                Level.OK,
                f"greatest dynamic pressure {passage.max_q.dynamic_pressure_pa / 1e3:.2f} kPa "
                f"at {passage.max_q.time_s:.1f} s",
                {PASSAGE: passage.as_text()},
            )

    def go_on(self) -> None:
        """Make the step that waits for an answer, if one does."""
        if self.link.waiting:
            self.link.waiting = False
            self._step()

    def _step(self) -> None:
        if self._values["paused"]:
            self.paused = True
            return
        delay, factor = 0.0, self._values["pace"]
        if factor > 0.0:
            now, time_ns = time.monotonic(), self.simulator.time_ns
            delay, gap = self.pace.delay(now, time_ns, factor, self._real_time)
            if gap:
                self.report(Level.WARN, gap)
        if delay > 0.0:
            self._paced = self._node.wall_timer(delay, self._on_pace)
        else:
            self._advance()

    def _advance(self) -> None:
        try:
            self.simulator.withhold_jettison()
        except CommandRefused as error:
            self._refuse(f"{error}; withheld")
        self.simulator.advance(each_period=self._values["pace"] > 0.0)
        if self._arrived is not None:
            # a command that arrived within the period takes effect at its end
            message, self._arrived = self._arrived, None
            self._obey(message)
        self._publish()

    # ---- pace

    def change_pace(self) -> None:
        """Continue at the new pace from now on, without catching up."""
        self._say_pace()
        if not self.flying:
            return
        self._begin_pace()
        if self.paused or self._paced is not None:
            self.paused = False
            self._stop_pacing()
            self._step()

    def _begin_pace(self) -> None:
        """Set the reference of the pace to wall clock and flight time now."""
        self.pace.begin(time.monotonic(), self.simulator.time_ns)

    def _say_pace(self) -> None:
        self._pace_published_at = time.monotonic()
        self.messages.publish_pace(self._values["pace"], self._values["paused"])

    def _on_pace(self) -> None:
        self._stop_pacing()
        self._advance()

    def _stop_pacing(self) -> None:
        if self._paced is not None:
            self._node.destroy_timer(self._paced)
            self._paced = None

    # ---- commands

    def on_command(self, message: ThrustCommand) -> None:
        """Fly by a command that answers the present state, or, in real time, a recent one."""
        if not self._membership.belongs(message.flight_id):
            self._refuse(f"of another flight, {id_text(message.flight_id)}")
            return
        if not (self.flying or self.counting) or self.simulator.complete:
            return
        # without a guidance no identity, not even 0, is accepted
        if message.guidance_id != self._membership.guidance_id or not message.guidance_id:
            self._refuse(f"of a guidance without part, {id_text(message.guidance_id)}")
            return
        answered = ns_from_stamp(message.nav_stamp)
        age = self.simulator.time_ns - answered
        if not 0 <= age <= self._oldest_ns or answered < self._answered_ns:
            if age < 0:
                self._note_forged("a command that answers a state which was not said yet")
            self._refuse(
                f"nav_stamp is {answered / NANOSECONDS:.9g} s; expected "
                f"{self.simulator.time_ns / NANOSECONDS:.9g} s"
            )
            if self.link.heeds_late_answer(self.simulator.sequence):
                self.regain_link(LINK_LOST_AFTER - 1)
            return
        if self.counting:
            # the announcement of the plan is still to come
            self.lift_off()
        if not self._unanswered and answered == self._answered_ns:
            if self._accepted and canonical(message) != canonical(self._accepted):
                self._note_forged("two answers to one state in the name of guidance")
            self._refuse("this navigation state has its answer")
            return
        self._accept(message, answered)

    def _accept(self, message: ThrustCommand, answered_ns: int) -> None:
        if self._real_time and self._accepted is None:
            # the time of the first answer does not count as flight
            self._begin_pace()
        self._unanswered = False
        self._answered_ns = answered_ns
        self._accepted = message
        self.link.deafness = 0
        self.regain_link()
        if self.link.unguided:
            self.link.unguided = False
            self.messages.publish_node_event(GUIDANCE_BACK)
        if self.link.waiting or not self._real_time:
            self._obey(message)
        else:
            self._arrived = message
        self.go_on()

    def _obey(self, message: ThrustCommand) -> None:
        """Put a command in force from the present state on."""
        steering = self._steering
        for name in ("reference_time", "direction", "direction_rate", "cutoff_time"):
            steering[name] = getattr(message, name)
        steering["jettison"] = message.jettison
        steering["jettison_time"] = message.jettison_time
        steering["arc_end_times"] = math.nan
        steering["arc_end_times"][0, : len(message.arc_end_times)] = message.arc_end_times
        try:
            self.simulator.command(steering)
        except CommandRefused as error:
            self._refuse(f"{error}; flying on with the last good one")

    def _refuse(self, reason: str) -> None:
        """Report a refused command, its reason and the count."""
        self._refused += 1
        self.report(Level.WARN, f"command refused: {reason}", {"commands_refused": self._refused})

    def _on_event(self, event: FlightEvent) -> None:
        """Report a forged event of this flight."""
        if self.messages.is_forged(event):
            self._note_forged(f"an event of type {event.type} at {event.time:.9g} s")

    def _note_forged(self, what: str) -> None:
        """Count a forged message; report the first and every tenfold."""
        self._forged += 1
        if is_worth_reporting(self._forged):
            text = f"{FORGED}{what} ({self._forged} so far)"
            self._node.diagnostics.report(Level.ERROR, text, self.simulator.time_ns)

    # ---- lost answers

    def _on_no_answer(self) -> None:
        """Shorten the timeout after a lost answer, and lose the link after several.

        Without a guidance the link is lost at once.
        """
        if not self._membership.guidance_id:
            self._lose_link("guidance has left")
            return
        self.link.lost_in_a_row += 1
        text = f"no answer within {self.link.patience_s:g} s; flying on with the last good command"
        self.report(Level.WARN, text)
        self.note_loss()
        if self.link.lost_in_a_row == LINK_LOST_AFTER:
            self._lose_link(f"{LINK_LOST_AFTER} answers lost in a row")

    def note_loss(self) -> None:
        """Publish the loss of guidance once; its next answer publishes the return."""
        if not self.link.unguided:
            self.link.unguided = True
            self.messages.publish_node_event(GUIDANCE_LOST)

    def _lose_link(self, reason: str) -> None:
        """Continue without waiting for answers; one can still arrive."""
        self.report(Level.ERROR, f"{reason}: flying on without guidance")
        self.link.lose(self.simulator.sequence)
        self.end_watch()
        self.watch(LOST_LINK_PERIOD)
        self.on_lost()

    def regain_link(self, lost_in_a_row: int = 0) -> None:
        """Wait for answers again, with ``lost_in_a_row`` of them counted as lost."""
        if self.link.regain(lost_in_a_row):
            self.end_watch()
            self.watch()
