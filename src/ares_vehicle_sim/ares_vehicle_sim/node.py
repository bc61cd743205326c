# SPDX-License-Identifier: Apache-2.0
"""Vehicle simulator node: own /clock and fly in lock-step with guidance."""

import json
import math
import re
import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.executors import Executor
from rclpy.parameter import Parameter as RosParameter
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock

from ares_models.arrays import STEERING
from ares_models.failures import read_failure
from ares_models.mission import MISSION_TEXT, read_mission
from ares_models.passage import AirState, Passage
from ares_models.plans import flies_in_air
from ares_models.software import software
from ares_msgs.msg import FlightEvent, FlightMember, NavState, ThrustCommand, VehicleState
from ares_node.diagnostics import (
    PASSAGE,
    Level,
    Timing,
    is_worth_reporting,
    pace_message,
)
from ares_node.identity import id_text, new_id
from ares_node.key import FORGED
from ares_node.membership import AGREED, FLIGHT_ID, MOST_HEARD, OPEN, Membership, Role, State
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter
from ares_node.qos import (
    CLOCK,
    CLOCK_QOS,
    DIAGNOSTIC,
    EVENTS,
    FLIGHT,
    FLIGHT_EVENT,
    NAV_STATE,
    THRUST_COMMAND,
    TIMING,
    VEHICLE_STATE,
)
from ares_node.run import EXIT_CANNOT_START, EXIT_OK
from ares_node.seal import canonical
from ares_node.states import StateMessage, clock_data
from ares_node.time import NANOSECONDS, ns_from_seconds, ns_from_stamp, stamp_from_ns
from ares_vehicle_sim.arrays import GUIDANCE_BACK, GUIDANCE_LOST
from ares_vehicle_sim.dispersions import Dispersions, read_dispersions
from ares_vehicle_sim.simulator import CommandRefused, Simulator, SimulatorOptions

#: Slowest real-time factor.
MIN_PACE = 1e-3
#: Period of the checks of graph and clock, wall time, s.
WATCH_PERIOD = 0.02
#: Period of the messages on the pace, wall time, s.
PACE_PERIOD = 1.0
#: Period of the lines on missing members before the start, wall time, s.
WAITING_LINE_PERIOD = 10.0
#: Longest preparation of a member, wall time, s.
LONGEST_PREPARATION = 900.0
#: Largest delay that a paced flight catches up, wall time, s; a longer gap stays.
LONGEST_CATCH_UP = 0.5
#: Timeout for acknowledgement of the last messages, wall time, s. A killed reader never
#: acknowledges, and `ares fly` waits 10 s, launch 5 s, for the end of this process.
ACKNOWLEDGE_TIMEOUT = 3.0
#: Number of consecutive lost answers after which the flight does not wait for more.
LINK_LOST_AFTER = 3
#: Ratio of the timeout of an answer to that of the one before, after losses.
PATIENCE_RATIO = 0.2
#: Timeout of a plan in flight, as a multiple of that of an answer.
PLAN_PATIENCE = 10.0
#: Least time for messages between two steps in real time, wall time, s.
LEAST_DELAY = 1e-4
#: Period of the steps on a lost link, in which an answer can still arrive, wall time, s.
LOST_LINK_PERIOD = 0.001
#: Least flight time between reports that differ only in numbers, s.
REPORT_PERIOD = 10.0

PARAMETERS = (
    Parameter(
        "mission",
        "ares_v",
        "Shipped mission's name, or path of a mission file.",
        option="mission",
    ),
    Parameter(
        "navigation_period_s",
        0.1,
        "Flight time between navigation states.",
        unit="s",
        minimum=0.001,
        maximum=10.0,
        option="nav_period",
    ),
    Parameter(
        "pace",
        0.0,
        "Real-time factor; 0 flies as fast as guidance answers. The trajectory is the same.",
        minimum=0.0,
        maximum=1e6,
        at_any_time=True,
        option="pace",
    ),
    Parameter("paused", False, "Hold the flight while it is true.", at_any_time=True),
    Parameter(
        "integration_step_s",
        0.1,
        "Longest step of the integrator.",
        unit="s",
        minimum=0.001,
        maximum=10.0,
    ),
    Parameter(
        "seed",
        0,
        "Seed of dispersions and navigation errors.",
        minimum=0,
        maximum=2**63 - 1,
        option="seed",
    ),
    Parameter(
        "flight", 0, "Number of the flight among those of the seed.", minimum=0, maximum=99_999_999
    ),
    Parameter(
        "dispersions",
        "",
        "Shipped dispersions' name, or path of a file; empty flies the mission exactly.",
        option="dispersions",
    ),
    Parameter(
        "failure",
        "",
        "What fails, as KIND:KEY=NUMBER,... such as engine_out:time=200,thrust_ratio=0.8; empty: "
        "nothing does. See docs/aborts.md.",
        option="failure",
    ),
    Parameter(
        "attitude_rate_limit_deg_s",
        0.0,
        "Fastest turn of the thrust; 0 lets it follow the command at once.",
        unit="deg/s",
        minimum=0.0,
        option="attitude_rate_limit",
    ),
    Parameter(
        "command_timeout_s",
        5.0,
        "Wall time to wait for an answer before flying on with the last good command.",
        unit="s",
        minimum=0.001,
    ),
    Parameter(
        "longest_command_age_s",
        0.0,
        "Longest flight time since the navigation state that a command answers. 0: the vehicle "
        "waits for the answer to each state. Above, with a pace, it flies in real time: after the "
        "first answer it waits for nobody and flies by the newest that it has.",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    ),
    Parameter(
        "start_timeout_s",
        300.0,
        "Wall time to wait for guidance, recorders and judges before giving up, and for guidance "
        "that plans once more; while they still prepare it does not run out.",
        unit="s",
        minimum=0.0,
    ),
    FLIGHT_ID,
    Parameter(
        "expected_recorders",
        0,
        "Recorders that must be ready before the flight starts.",
        minimum=0,
        maximum=16,
    ),
    Parameter(
        "expected_judges",
        0,
        "Judges that must be ready before the flight starts.",
        minimum=0,
        maximum=16,
    ),
    Parameter(
        "exit_when_complete",
        False,
        "End the process after the flight; otherwise it stays until a signal.",
    ),
)


def _why_no_pace(pace: float) -> str:
    """Return the reason to refuse a pace, one line, or ""."""
    if 0.0 < pace < MIN_PACE:
        return f"parameter pace is {pace!r}; expected 0, or {MIN_PACE:g} up"
    return ""


def _check_pace(parameters: list[RosParameter]) -> SetParametersResult:
    paces = [x.value for x in parameters if x.name == "pace" and isinstance(x.value, float)]
    reason = next(filter(None, map(_why_no_pace, paces)), "")
    return SetParametersResult(successful=not reason, reason=reason)


@dataclass
class Deadlines:
    """Count the deadlines of a flight in real time; a state is due when its period begins.

    Attributes:
        states: published navigation states.
        missed: states published after the next was due.
        latest_s: largest delay of a state, wall time, s.
        age_ns: largest age of a command in force, flight time, ns.
    """

    states: int = 0
    missed: int = 0
    latest_s: float = 0.0
    age_ns: int = 0

    def count(self, late_s: float, period_s: float) -> None:
        """Count a published state; times are wall time, s.

        Args:
            late_s: time since the next state was due; negative before.
            period_s: time between two states.
        """
        self.states += 1
        self.missed += late_s > 0.0
        self.latest_s = max(self.latest_s, late_s + period_s)

    def __str__(self) -> str:
        """Format the counts in one line."""
        return (
            f"real time: {self.missed} of {self.states} deadlines missed, the latest state "
            f"{1e3 * self.latest_s:.1f} ms after it was due; commands up to "
            f"{self.age_ns / NANOSECONDS:.9g} s old"
        )


class VehicleSimNode(FlightNode):
    """Publish navigation state, truth, events and the clock; fly the commands.

    The flight starts when a guidance and the expected recorders and judges have agreed on it (see
    FlightMember). If guidance has to plan first, the count is held: guidance gets the first
    navigation state, and the clock stands until it has its plan. After each navigation state the
    node waits for the command that answers it, except in real time.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters; everything else waits for `configure`."""
        super().__init__("vehicle_sim", parameters=PARAMETERS, **kwargs)
        self.add_on_set_parameters_callback(_check_pace)
        self._simulator: Simulator | None = None

    def configure(self) -> None:
        """Read mission and dispersions, compile the plant, create the publishers."""
        values = self.values
        if reason := _why_no_pace(values["pace"]):
            raise NodeError(reason)
        dispersions, texts = Dispersions(), {}
        mission, texts[MISSION_TEXT] = read_mission(values["mission"])
        if values["dispersions"]:
            dispersions, texts["dispersions_text"] = read_dispersions(
                values["dispersions"], mission
            )
        limit = math.radians(values["attitude_rate_limit_deg_s"]) or math.inf
        self._mission_name = mission.name
        flight = (
            mission,
            SimulatorOptions(
                navigation_period_s=values["navigation_period_s"],
                integration_step_s=values["integration_step_s"],
                attitude_rate_limit_rad_s=limit,
            ),
            dispersions,
            values["seed"],
            values["flight"],
            read_failure(values["failure"]) if values["failure"] else None,
        )
        with ExitStack() as failed:
            self._membership = Membership(
                self, Role.VEHICLE_SIM, mission.name, values["flight_id"] or new_id()
            )
            failed.callback(self._membership.close)
            flown = {item.name: values[item.name] for item in PARAMETERS if item is not FLIGHT_ID}
            self._membership.announce_settings(json.dumps({"software": software()} | flown | texts))
            # compile the plant now, by one step of a private flight
            rehearsal = Simulator(*flight)
            rehearsal.advance()
            rehearsal.truth()
            self._simulator = Simulator(*flight)
            failed.pop_all()
        self._passage = Passage() if flies_in_air(mission.arrays().arcs) else None
        self._clock_out = self.create_publisher(Clock, CLOCK, CLOCK_QOS)
        self._nav_out = self.create_publisher(NavState, NAV_STATE, FLIGHT)
        self._truth_out = self.create_publisher(VehicleState, VEHICLE_STATE, FLIGHT)
        self._event_out = self.create_publisher(FlightEvent, FLIGHT_EVENT, EVENTS)
        self._timing_out = self.create_publisher(Timing, TIMING, DIAGNOSTIC)
        self._command_in = self.create_subscription(
            ThrustCommand,
            THRUST_COMMAND,
            self._membership.seals.reader(THRUST_COMMAND, self._on_command),
            FLIGHT,
        )
        self._events_in = self.create_subscription(
            FlightEvent, FLIGHT_EVENT, self._on_event, EVENTS
        )
        self._published_events: set[bytes] = set()
        self._forged = 0
        self._accepted: ThrustCommand | None = None
        self._answered_ns = -1
        self._oldest_ns = ns_from_seconds(values["longest_command_age_s"])
        self._arrived: ThrustCommand | None = None
        self._deadlines = Deadlines()
        self._nav_message = StateMessage(NavState)
        self._truth_message = StateMessage(VehicleState)
        self._steering = np.zeros(1, STEERING)
        self._flying = self._counting = False
        self._planning_since = -math.inf
        self._successor = 0
        self._waiting = self._unanswered = False
        self._unguided = False
        self._link_lost = False
        self._deafness = 0
        self._refused = 0
        self._held = False
        self._paced: Timer | None = None
        self._pace_published_at = -math.inf
        self._lost_in_a_row = 0
        self._last_report: dict[str, int] = {}
        self._warned: set[int] = set()
        self._membership.listen(self._on_member)

    def activate(self) -> None:
        """Wait for the other nodes, then fly."""
        if self._flying or self.simulator.complete:
            over = "is over" if self.simulator.complete else "was stopped and cannot go on"
            raise NodeError(
                f"the flight {over}, at {self.simulator.time_ns / NANOSECONDS:.9g} s; clean up and "
                "configure for a new one"
            )
        self._activated_at = self._waiting_line_at = self._patient_since = time.monotonic()
        self._watch = self.wall_timer(WATCH_PERIOD, self._on_watch)

    def deactivate(self) -> None:
        """Stop; a flight that has begun cannot be resumed."""
        self.destroy_timer(self._watch)
        self._stop_pacing()
        self._waiting = self._held = self._counting = False

    def cleanup(self) -> None:
        """Free the endpoints and the flight."""
        for publisher in (self._clock_out, self._nav_out, self._truth_out, self._event_out):
            self.destroy_publisher(publisher)
        self.destroy_publisher(self._timing_out)
        self.destroy_subscription(self._command_in)
        self.destroy_subscription(self._events_in)
        self._membership.close()
        self._simulator = None

    def adjust(self) -> None:
        """Continue at the new pace from now on, without catching up."""
        self._say_pace()
        if not self._flying:
            return
        self._begin_pace()
        if self._held or self._paced is not None:
            self._held = False
            self._stop_pacing()
            self._step()

    def drain(self, executor: Executor) -> None:
        """Wait until the others have received the last messages."""
        if self._simulator is not None:
            deadline = time.monotonic() + ACKNOWLEDGE_TIMEOUT
            for publisher in (self._nav_out, self._truth_out, self._event_out):
                left = max(0.0, deadline - time.monotonic())
                publisher.wait_for_all_acked(Duration(seconds=left))
            self._membership.wait_until_heard(max(0.0, deadline - time.monotonic()))

    @property
    def simulator(self) -> Simulator:
        """Return the flight, which exists from `configure` to `cleanup`."""
        if self._simulator is None:
            raise NodeError("not configured")
        return self._simulator

    # ---- other members

    def _on_member(self, member: FlightMember) -> None:
        """Handle a member's message: give the flight to the first guidance, report others."""
        if self.done:
            return
        if member.role == Role.VEHICLE_SIM:
            self._on_simulator(member)
        elif member.role == Role.GUIDANCE and member.flight_id == self.flight_id:
            self._on_guidance(member)

    def _on_simulator(self, member: FlightMember) -> None:
        if member.state not in (State.PRESENT, State.READY, State.FLYING):
            return
        if self.simulator.complete:
            # a simulator after the end of the flight is no conflict
            return
        ours = member.flight_id == self.flight_id
        given = bool(self.values["flight_id"]) and not ours
        taken = (State.READY, State.FLYING)
        if self._membership.state in taken or given:
            self._warn_about(
                member, f"another simulator, {member.node}: it has no part in this flight"
            )
        elif member.state in taken or member.member_id < self._membership.member_id:
            # of two waiting simulators only one continues
            self._give_up(f"another simulator already publishes {self._nav_out.topic_name}")

    def _on_guidance(self, member: FlightMember) -> None:
        mine = self._membership
        if member.mission not in ("", self._mission_name):
            self._warn_about(
                member,
                f"{member.node} guides mission {member.mission}, this is {self._mission_name}: "
                "it has no part in this flight",
            )
        elif member.member_id == mine.guidance_id:
            if member.state in (State.LEFT, State.FAILED):
                if self._counting:
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
            self._choose_guidance()

    def _choose_guidance(self) -> None:
        """Accept a guidance if there is none, or if the present one is lost in flight."""
        mine = self._membership
        if mine.guidance_id and not self._link_lost:
            return
        for member in mine.others(Role.GUIDANCE, State.PRESENT):
            if member.mission in ("", self._mission_name) and member.member_id != mine.guidance_id:
                if self._flying:
                    self._report(Level.WARN, f"{member.node} takes over from lost guidance")
                    self._successor = int(member.member_id)
                mine.say(mine.state, guidance_id=int(member.member_id))
                return

    def _on_guidance_gone(self) -> None:
        """Handle the loss of guidance; a flight without pace waits a while for a successor."""
        self._membership.say(self._membership.state, guidance_id=0)
        if self._flying:
            self._note_loss()
            self._answer_deadline = time.monotonic()
            if self.values["pace"] == 0.0:
                self._answer_deadline += self.values["command_timeout_s"]
        self._choose_guidance()

    def _on_guidance_agreed(self, member: FlightMember) -> None:
        """Handle the agreement of the accepted guidance, READY or PLANNING."""
        planning = member.state == State.PLANNING
        self._planning_since = time.monotonic() if planning else -math.inf
        if self._counting and not planning:
            self._lift_off()
        elif self._successor == member.member_id:
            self._successor = 0
            self._on_successor()
        elif self._waiting and not planning:
            # guidance is about to answer
            self._answer_deadline = time.monotonic() + self._patience

    def _waits_for_plan(self, now: float) -> bool:
        """Return whether a flight without pace waits for the plan of a restarted guidance."""
        patience = PLAN_PATIENCE * self.values["command_timeout_s"]
        return now - self._planning_since < patience and self.values["pace"] == 0.0

    def _on_successor(self) -> None:
        """Wait for the answers of a new guidance, from the next state on."""
        self._regain_link(0)
        if self._waiting:
            # it has not received the present state
            self._waiting = False
            self._step()

    def _warn_about(self, member: FlightMember, text: str) -> None:
        """Report a warning about another node once."""
        if member.member_id not in self._warned and len(self._warned) < MOST_HEARD:
            self._warned.add(int(member.member_id))
            self.diagnostics.report(Level.WARN, text, self.simulator.time_ns)

    # ---- wall clock: start, pace, lost answers

    def _on_watch(self) -> None:
        now = time.monotonic()
        if self._counting:
            self._hold_count(now)
            return
        if not self._flying:
            if not self.simulator.complete:
                self._try_to_start(now)
            return
        if now - self._pace_published_at > PACE_PERIOD:
            self._say_pace()
        if self._waiting and now >= self._answer_deadline and not self._waits_for_plan(now):
            self._waiting = False
            self._on_no_answer()
            self._step()

    def _on_no_answer(self) -> None:
        """Shorten the timeout after a lost answer, and lose the link after several.

        Without a guidance the link is lost at once.
        """
        if not self._membership.guidance_id:
            self._lose_link("guidance has left")
            return
        self._lost_in_a_row += 1
        self._report(
            Level.WARN,
            f"no answer within {self._patience:g} s; flying on with the last good command",
        )
        self._note_loss()
        if self._lost_in_a_row == LINK_LOST_AFTER:
            self._lose_link(f"{LINK_LOST_AFTER} answers lost in a row")

    def _on_lost_link(self) -> None:
        if self._waiting:
            self._waiting = False
            self._step()

    def _note_loss(self) -> None:
        """Publish the loss of guidance once; its next answer publishes the return."""
        if not self._unguided:
            self._unguided = True
            self._node_event(GUIDANCE_LOST)

    def _lose_link(self, reason: str) -> None:
        """Continue without waiting for answers; one can still arrive."""
        self._report(Level.ERROR, f"{reason}: flying on without guidance")
        self._link_lost = True
        self._listen_from = self.simulator.sequence + self._deafness
        self.destroy_timer(self._watch)
        self._watch = self.wall_timer(LOST_LINK_PERIOD, self._on_lost_link)
        self._choose_guidance()

    def _regain_link(self, lost_in_a_row: int) -> None:
        """Wait for answers again, with ``lost_in_a_row`` of them counted as lost."""
        self._lost_in_a_row = lost_in_a_row
        if self._link_lost:
            self._link_lost = False
            self.destroy_timer(self._watch)
            self._watch = self.wall_timer(WATCH_PERIOD, self._on_watch)

    def _try_to_start(self, now: float) -> None:
        missing, role = self._missing()
        waited = now - self._activated_at
        preparing = self._membership.preparing(role) and waited < LONGEST_PREPARATION
        if preparing:
            # a member that has just prepared needs time to agree
            self._patient_since = now
        if not missing:
            self._start()
        elif now - self._patient_since > self.values["start_timeout_s"]:
            self._give_up(f"no {missing} on the graph after {waited:.0f} s")
        elif now - self._waiting_line_at > WAITING_LINE_PERIOD:
            self._waiting_line_at = now
            why = ", which still prepares (compiling, the first time)" if preparing else ""
            self.get_logger().info(f"waiting for {missing}{why}")

    def _missing(self) -> tuple[str, Role]:
        """Return the missing member as a text and a role; an empty text if none is missing."""
        mine = self._membership

        def ready(role: Role) -> list[int]:
            members = mine.others(role, *AGREED)
            return [int(m.member_id) for m in members if m.guidance_id == mine.guidance_id]

        if not mine.guidance_id or mine.guidance_id not in ready(Role.GUIDANCE):
            others = {m.mission for m in mine.others(Role.GUIDANCE)} - {"", self._mission_name}
            suffix = f" for mission {self._mission_name}" if others else ""
            return f"guidance{suffix}", Role.GUIDANCE
        for role, expected in (
            (Role.RECORDER, self.values["expected_recorders"]),
            (Role.JUDGE, self.values["expected_judges"]),
        ):
            if len(ready(role)) < expected:
                return role.name.lower(), role
        return "", Role.GUIDANCE

    def _hold_count(self, now: float) -> None:
        """Hold the count for the plan until `start_timeout_s`."""
        waited = now - self._planning_since
        if waited > self.values["start_timeout_s"]:
            self._give_up(f"not flown: guidance has no plan after {waited:.0f} s")
        elif now - self._waiting_line_at > WAITING_LINE_PERIOD:
            self._waiting_line_at = now
            self.get_logger().info("the count is held: guidance plans the flight")

    def _give_up(self, reason: str) -> None:
        if self._counting:
            self._counting = False
            self._membership.say(State.FAILED, reason=reason)
        print(f"{self.get_name()}: {reason}", file=sys.stderr, flush=True)
        self.failure = reason
        self._report(Level.ERROR, reason)
        self.destroy_timer(self._watch)
        self.finish(EXIT_CANNOT_START)

    # ---- the flight

    def _start(self) -> None:
        """Begin the flight, or hold the count until guidance has its plan."""
        if self._planning_since > -math.inf:
            self._counting = True
            self._membership.say(State.READY)
            self._planning_since = self._waiting_line_at = time.monotonic()
            self._publish_measured()
            return
        self._begin()
        self._publish()

    def _begin(self) -> None:
        self._flying = True
        self._membership.say(State.FLYING)
        self._begin_pace()

    def _lift_off(self) -> None:
        """End the count: guidance has its plan and answers the first state."""
        self._counting = False
        self._planning_since = -math.inf
        self._begin()
        self._publish_truth()
        self._await_answer()

    @property
    def _head(self) -> tuple[int, int, int]:
        """Return stamp in ns, flight_id and sequence of a state message."""
        return self.simulator.time_ns, self._membership.flight_id, self.simulator.sequence

    def _publish(self) -> None:
        self._publish_truth()
        if self.simulator.complete:
            self._end()
            return
        if self._real_time and self._accepted is not None:
            self._publish_measured()
            self._fly_on()
            return
        self._await_answer()
        self._publish_measured()

    @property
    def _real_time(self) -> bool:
        """Return whether the vehicle flies in real time, without waiting for answers."""
        return self._oldest_ns > 0 and self.values["pace"] > 0.0

    def _fly_on(self) -> None:
        """Continue in real time by the newest command, however old it is."""
        age = self.simulator.time_ns - self._answered_ns
        self._deadlines.age_ns = max(self._deadlines.age_ns, age)
        if age > self._oldest_ns and not self._link_lost:
            self._note_loss()
            self._lose_link(f"no command younger than {self._oldest_ns / NANOSECONDS:g} s")
        self._step()

    def _publish_measured(self) -> None:
        data = self._nav_message.data(*self._head, self.simulator.measured)
        self._membership.seals.seal(self._nav_message.content(data))
        self._nav_out.publish(data)

    def _await_answer(self) -> None:
        self._waiting = self._unanswered = True
        self._patience = self.values["command_timeout_s"] * PATIENCE_RATIO**self._lost_in_a_row
        self._answer_deadline = time.monotonic() + self._patience

    def _publish_truth(self) -> None:
        """Publish the true state, the clock, and the events up to now."""
        simulator = self.simulator
        head = self._head
        self._clock_out.publish(clock_data(head[0]))
        truth = simulator.truth()
        self._truth_out.publish(self._truth_message.data(*head, truth))
        self._pass_air(truth)
        if simulator.complete and simulator.escaped:
            # before the final event: the judge ignores later reports
            self._report(Level.WARN, simulator.escaped)
        if simulator.complete and self._real_time:
            level = Level.WARN if self._deadlines.missed else Level.OK
            self._report(level, str(self._deadlines))
        for event in simulator.new_events():
            self._say_event(self._event_message(event))

    def _pass_air(self, truth: Any) -> None:
        """Follow the climb through the air; tell its greatest dynamic pressure at the end."""
        passage = self._passage
        if passage is None:
            return
        names = ("altitude", "mass", "dynamic_pressure", "mach")
        now = (float(truth[name]) for name in names)
        passage.add(AirState(self.simulator.time_ns / NANOSECONDS, *now))
        if self.simulator.complete and passage.max_q is not None:
            self._report(
                Level.OK,
                f"greatest dynamic pressure {passage.max_q.dynamic_pressure_pa / 1e3:.2f} kPa "
                f"at {passage.max_q.time_s:.1f} s",
                {PASSAGE: passage.as_text()},
            )

    def _say_event(self, event: FlightEvent) -> None:
        self._published_events.add(canonical(event))
        self._membership.seals.seal(event)
        self._event_out.publish(event)

    def _on_event(self, event: FlightEvent) -> None:
        """Report a forged event of this flight."""
        if event.flight_id == self.flight_id and canonical(event) not in self._published_events:
            self._note_forged(f"an event of type {event.type} at {event.time:.9g} s")

    def _note_forged(self, what: str) -> None:
        """Count a forged message; report the first and every tenfold."""
        self._forged += 1
        if is_worth_reporting(self._forged):
            now = self.simulator.time_ns
            text = f"{FORGED}{what} ({self._forged} so far)"
            self.diagnostics.report(Level.ERROR, text, now)

    def _on_command(self, message: ThrustCommand) -> None:
        if not self._membership.belongs(message.flight_id):
            self._refuse(f"of another flight, {id_text(message.flight_id)}")
            return
        if not (self._flying or self._counting) or self.simulator.complete:
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
            self._on_late_answer()
            return
        if self._counting:
            # the announcement of the plan is still to come
            self._lift_off()
        if not self._unanswered and answered == self._answered_ns:
            if self._accepted and canonical(message) != canonical(self._accepted):
                self._note_forged("two answers to one state in the name of guidance")
            self._refuse("this navigation state has its answer")
            return
        if self._real_time and self._accepted is None:
            # the time of the first answer does not count as flight
            self._begin_pace()
        self._unanswered = False
        self._answered_ns = answered
        self._accepted = message
        self._deafness = 0
        self._regain_link(0)
        if self._unguided:
            self._unguided = False
            self._node_event(GUIDANCE_BACK)
        if self._waiting or not self._real_time:
            self._obey(message)
        else:
            self._arrived = message
        if self._waiting:
            self._waiting = False
            self._step()

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

    def _on_late_answer(self) -> None:
        """Wait for the next answer after a late one on a lost link, ever more rarely."""
        if self._link_lost and self.simulator.sequence >= self._listen_from:
            self._deafness = 2 * self._deafness + 1
            self._regain_link(LINK_LOST_AFTER - 1)

    def _refuse(self, reason: str) -> None:
        """Report a refused command, its reason and the count."""
        self._refused += 1
        self._report(Level.WARN, f"command refused: {reason}", {"commands_refused": self._refused})

    def _begin_pace(self) -> None:
        """Set the reference of the pace to wall clock and flight time now."""
        self._started_at = time.monotonic()
        self._start_ns = self.simulator.time_ns

    def _say_pace(self) -> None:
        """Publish pace and pause for pages, and for the judge, to tell a pause from a hang."""
        self._pace_published_at = time.monotonic()
        values = self.values
        message = pace_message(self, self.flight_id, values["pace"], values["paused"])
        self._timing_out.publish(message)

    def _step(self) -> None:
        if self.values["paused"]:
            self._held = True
            return
        delay = self._delay_for_pace()
        if self._real_time:
            delay = max(delay, LEAST_DELAY)
        if delay > 0.0:
            self._paced = self.wall_timer(delay, self._on_pace)
        else:
            self._advance()

    def _advance(self) -> None:
        try:
            self.simulator.withhold_jettison()
        except CommandRefused as error:
            self._refuse(f"{error}; withheld")
        self.simulator.advance()
        if self._arrived is not None:
            # a command that arrived within the period takes effect at its end
            message, self._arrived = self._arrived, None
            self._obey(message)
        self._publish()

    def _on_pace(self) -> None:
        self._stop_pacing()
        self._advance()

    def _stop_pacing(self) -> None:
        if self._paced is not None:
            self.destroy_timer(self._paced)
            self._paced = None

    def _delay_for_pace(self) -> float:
        pace = self.values["pace"]
        if pace == 0.0:
            return 0.0
        flown = (self.simulator.time_ns - self._start_ns) / NANOSECONDS
        due = self._started_at + (flown + self.values["navigation_period_s"]) / pace
        left = due - time.monotonic()
        if self._real_time:
            self._deadlines.count(-left, self.values["navigation_period_s"] / pace)
        if left < -LONGEST_CATCH_UP:
            # a long gap is not caught up
            self._started_at -= left
            self._report(Level.WARN, f"behind its pace by {-left:.1f} s: not made up for")
            return 0.0
        return left

    def _end(self) -> None:
        self._flying = False
        self._regain_link(0)
        self._membership.say(State.OVER, last_sequence=self.simulator.sequence)
        if self.values["exit_when_complete"]:
            self.finish(EXIT_OK if self.simulator.ended_well else 1)

    def _event_message(self, event: Any) -> FlightEvent:
        return FlightEvent(
            stamp=stamp_from_ns(ns_from_seconds(float(event["time"]))),
            flight_id=self.flight_id,
            time=float(event["time"]),
            type=int(event["type"]),
            index=int(event["index"]),
            position=event["position"],
            velocity=event["velocity"],
            mass=float(event["mass"]),
            heating_rate=float(event["heating_rate"]),
        )

    def _node_event(self, kind: int) -> None:
        """Publish an event of the node at the present state."""
        truth = self.simulator.truth()
        event = {name: truth[name] for name in ("position", "velocity", "mass", "heating_rate")}
        now = self.simulator.time_ns / NANOSECONDS
        self._say_event(
            self._event_message({**event, "time": now, "type": kind, "index": truth["arc"]})
        )

    def _report(
        self, level: Level, message: str, values: Mapping[str, object] | None = None
    ) -> None:
        kind = re.split(r"\d", message, maxsplit=1)[0]
        now = self.simulator.time_ns
        last = self._last_report.get(kind)
        if last is None or now - last >= REPORT_PERIOD * NANOSECONDS:
            self._last_report[kind] = now
            self.diagnostics.report(level, message, now, values)
