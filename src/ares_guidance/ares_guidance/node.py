# SPDX-License-Identifier: Apache-2.0
"""Guidance node: answer every navigation state with a thrust command."""

import math
import time
from contextlib import ExitStack
from dataclasses import fields
from typing import Any

from rclpy.client import Client
from rclpy.serialization import deserialize_message
from rclpy.task import Future

from ares_guidance import arrays as layout
from ares_guidance.findings import SAFE_ORBIT, aims_at_safe_orbit, describe, describe_avoiding
from ares_guidance.law import why_no_plan
from ares_guidance.laws import FindsNoWay, check_law, rehearse
from ares_guidance.messages import ANALYTIC, ANSWER_TAKEN, ASKED_AT_NS, Answers
from ares_guidance.registry import law_names
from ares_guidance.settings import BOOST_STEERINGS, HEATING_SOURCES, LawSettings
from ares_models.mission import load_mission
from ares_msgs.msg import FlightMember, GuidanceStatus, NavState, ThrustCommand
from ares_msgs.srv import SolveTrajectory
from ares_node import qos
from ares_node.diagnostics import LONGEST_CYCLE_MS, Level, Timing, is_worth_reporting, timing
from ares_node.identity import id_text
from ares_node.membership import AGREED, FLIGHT_ID, OPEN, Membership, Role, State
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import MISSION, Parameter
from ares_node.time import NANOSECONDS

ERROR_TEXTS = {
    GuidanceStatus.NOT_CONVERGED: "no convergence within the iterations allowed",
    GuidanceStatus.STEERING_JUMP: "solution refused: it turns the thrust too far",
    GuidanceStatus.TIME_TO_GO_JUMP: "solution refused: it moves the cut-off too far",
    GuidanceStatus.PROPELLANT_SHORT: "the target needs more propellant than is left",
    GuidanceStatus.TARGET_UNREACHABLE: "no plane of the target's inclination through the "
    "predicted cut-off",
}

REFUSAL_TEXTS = {
    layout.REFUSED_IMPLAUSIBLE: "not finite, or not of this mission",
    layout.REFUSED_TIME: "its time does not go on",
    layout.REFUSED_FROZEN: "it stands still",
    layout.REFUSED_SEQUENCE: "arcs or jettisons go back",
    layout.REFUSED_POSITION: "the position is not where it should be",
    layout.REFUSED_VELOCITY: "the velocity is not what was sensed",
    layout.REFUSED_MASS: "the mass is not what was burnt",
    layout.REFUSED_DRIFT: "it drifts",
}

MONITOR_TEXTS = {
    layout.MONITOR_DIRECTION: "it cannot be flown",
    layout.MONITOR_TIME_TO_GO: "its time to go is negative",
    layout.MONITOR_JETTISON: "it drops a part above the heating limit",
    layout.MONITOR_DEPLETION: "it cuts off after the propellant is gone",
    layout.MONITOR_WORK: "its cycle took more iterations than any can need",
    layout.MONITOR_STEERING_RATE: "it turns the thrust too fast",
}

PARAMETERS = (
    MISSION,
    Parameter(
        "law",
        "peg",
        "Guidance law.",
        choices=tuple(law_names()),
        option="guidance",
        registered=True,
    ),
    FLIGHT_ID,
    Parameter(
        "heating_source",
        "measured",
        "What times the jettison: the measured heating, or the on-board atmosphere alone.",
        choices=tuple(HEATING_SOURCES),
        option="heating_source",
    ),
    Parameter(
        "boost_steering",
        "programme",
        "Steering in the air: programme, the planned attitude over the speed; replan, the optimum "
        "solved anew in each cycle, by law optimal.",
        choices=tuple(BOOST_STEERINGS),
        option="boost_steering",
    ),
    Parameter(
        "initial_guess",
        "none",
        "Where the law starts: none, the navigation state alone; optimizer or analytic, what the "
        "service solve_trajectory answers in time, by its own method or by that one. Law "
        "peg_thesis starts from no less than analytic; a law that needs a plan of a mission's "
        "free arcs from optimizer.",
        choices=("none", "optimizer", ANALYTIC),
        option="initial_guess",
    ),
    Parameter(
        "optimizer_timeout_s",
        2.0,
        "Wall time to wait for the optimizer before starting without it.",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    ),
    Parameter(
        "plan_timeout_s",
        120.0,
        "Wall time to wait for the optimizer's plan of a mission's free arcs before the flight is "
        "refused.",
        unit="s",
        minimum=0.001,
        maximum=3600.0,
    ),
) + tuple(
    Parameter(item.name, item.default, **item.metadata)
    for item in fields(LawSettings)
    if item.metadata
)

#: Polling period for the optimizer's answer, wall time, s.
WATCH_PERIOD = 0.02
#: Polling period for flights to join, and silence after which a flight joined without a given
#: flight_id counts as gone; wall time, s.
JOIN_PERIOD = 0.5
GONE_AFTER = 5.0


def _join_texts(texts: dict[int, str], bits: int) -> str:
    """Join the texts of the bits that are set."""
    return "; ".join(text for bit, text in texts.items() if bits & bit)


class GuidanceNode(FlightNode):
    """Run a guidance law on each navigation state; time is taken from the stamps only."""

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters; everything else waits for `configure`."""
        super().__init__("guidance", parameters=PARAMETERS, **kwargs)

    def configure(self) -> None:
        """Read the mission, compile the law, create the endpoints."""
        values = self.values
        mission = load_mission(values["mission"])
        self._mission = mission
        with ExitStack() as failed:
            self._membership = Membership(self, Role.GUIDANCE, mission.name, values["flight_id"])
            failed.callback(self._membership.close)
            flown = {item.name: values[item.name] for item in PARAMETERS if item is not FLIGHT_ID}
            try:
                self._answers = answers = Answers(mission, flown)
                self._law = answers.law
                self._membership.announce_settings(answers.settings())
                # compile before the simulator waits for an answer
                prepare = rehearse if self._law.lacks_plan else check_law
                prepare(values["law"], answers.arrays, mission.start().navigation())
            except ValueError as error:
                raise NodeError(mission.with_names(str(error))) from error
            failed.pop_all()
        self._command_out = self.create_publisher(ThrustCommand, qos.THRUST_COMMAND, qos.FLIGHT)
        self._status_out = self.create_publisher(GuidanceStatus, qos.GUIDANCE_STATUS, qos.FLIGHT)
        self._timing_out = self.create_publisher(Timing, qos.TIMING, qos.DIAGNOSTIC)
        self._nav_in = self.create_subscription(
            NavState,
            qos.NAV_STATE,
            self._membership.seals.reader(
                qos.NAV_STATE,
                self._on_nav_state,
                lambda data: self._answers.read(data)[1],
                answers.content,
            ),
            qos.FLIGHT,
            raw=True,
        )
        self._wants_guess = answers.wants_guess
        # create the client only if needed: it lists the service on the graph
        self._optimizer: Client | None = None
        if self._wants_guess:
            self._optimizer = self.create_client(SolveTrajectory, qos.SOLVE_TRAJECTORY)
        self._guess: Future | None = None
        self._held_back: bytes | None = None
        self._ask_from = -math.inf
        #: stamp in ns and sequence number of the last accepted state
        self._last: tuple[int, int] | None = None
        self._longest_cycle_s = 0.0
        self._published_longest_cycle = False
        self._heard_at = -math.inf
        self._warned: set[int] = set()
        self._looked_since: float | None = None
        self._active = False
        self._statuses = 0
        self._forget()
        self._membership.listen(self._on_member)

    def activate(self) -> None:
        """Start answering."""
        self._active = True
        self._watch = self.wall_timer(WATCH_PERIOD, self._on_watch)
        self._joining = self.wall_timer(JOIN_PERIOD, self._join)
        self._join()

    def deactivate(self) -> None:
        """Stop answering; keep the last state for a later `activate`."""
        self._active = False
        self.destroy_timer(self._watch)
        self.destroy_timer(self._joining)

    def cleanup(self) -> None:
        """Free the endpoints."""
        self.destroy_publisher(self._command_out)
        self.destroy_publisher(self._status_out)
        self.destroy_subscription(self._nav_in)
        if self._optimizer is not None:
            self.destroy_client(self._optimizer)
        self._membership.close()

    def _forget(self) -> None:
        self._law.reset()
        if self._law.lacks_plan and self._active:
            # its plan was for the rest of another flight
            self._wants_guess = True
            self._guess = None
            self._looked_since = None
            self._ask_from = -math.inf
            self._watch.reset()
        self._reported = int(GuidanceStatus.NONE)
        self._findings = 0
        self._reported_safe = False
        self._avoiding = 0
        self._without_jettison = False
        self._fallen_back = False
        self._late = 0
        self._refused = 0
        self._refused_before: int | None = None
        #: stamp of the first state accepted after refused ones, ns
        self._good_from: int | None = None
        self._acquired = 0
        self._violated = 0
        self._violations = 0

    # ---- membership in a flight

    def _on_member(self, member: FlightMember) -> None:
        if member.role == Role.VEHICLE_SIM and self._active:
            self._join()

    def _join(self) -> None:
        """Join a flight, or report the reason for not joining."""
        mine = self._membership
        silent = time.monotonic() - self._heard_at > GONE_AFTER
        # no navigation states arrive while it plans: the simulator holds the count
        gone = silent and mine.state is not State.PLANNING
        simulator = mine.simulator
        if simulator is not None and simulator.state == State.OVER and self._guiding:
            mine.say(State.OVER, last_sequence=self._statuses)
        before = mine.flight_id
        simulator = mine.join(again=simulator is None or simulator.state not in OPEN or gone)
        if simulator is None:
            return
        if mine.flight_id != before:
            self._last = None
            self._statuses = 0
            self._forget()
        if other := mine.other_mission(simulator):
            theirs, own = other
            edited = simulator.mission == self._mission.name
            self._tell_once(
                f"flight {id_text(mine.flight_id)} flies mission {theirs}, this guidance is for "
                f"{own}: it has no part in it",
                Level.ERROR if edited else Level.WARN,
            )
        elif simulator.guidance_id == mine.member_id:
            # another node may have announced the end in this member's or the simulator's name
            again = mine.state is State.OVER and simulator.state in OPEN
            if mine.state is State.PRESENT or again:
                plans = self._law.lacks_plan
                mine.agree(mine.member_id, State.PLANNING if plans else State.READY)
                self._answer_held_back()
        elif not simulator.guidance_id:
            if mine.state in AGREED and simulator.state in OPEN:
                # the simulator no longer counts on this guidance
                mine.say(State.PRESENT)
        else:
            mine.say(State.PRESENT)
            self._tell_once(
                f"flight {id_text(mine.flight_id)} has another guidance: this one has no part in it"
            )

    @property
    def _guiding(self) -> bool:
        return self._membership.state in AGREED

    def _tell_once(self, text: str, level: Level = Level.WARN) -> None:
        """Report why it has no part in a flight, once per flight."""
        if self._membership.flight_id not in self._warned:
            self._warned.add(self._membership.flight_id)
            self.diagnostics.report(level, text, 0)

    def _on_watch(self) -> None:
        self._answer_held_back()
        if not self._wants_guess:
            self._watch.cancel()

    def _answer_held_back(self) -> None:
        data = self._held_back
        if data is not None and self._guiding:
            now, _, sequence, measured = self._answers.read(data)
            if self._ready(now, data):
                self._held_back = None
                self._answer(now, sequence, measured)

    def _on_nav_state(self, data: bytes) -> None:
        now, flight_id, sequence, measured = self._answers.read(data)
        if not self._membership.belongs(flight_id):
            if self._membership.foreign == 1:
                flight = id_text(flight_id)
                text = f"navigation states of another flight, {flight}: not answered"
                self.diagnostics.report(Level.WARN, text, now)
            return
        self._heard_at = time.monotonic()
        if self._active and self._guiding and self._ready(now, data):
            self._answer(now, sequence, measured)
        else:
            self._held_back = data

    # ---- the optimizer's guess

    def _ready(self, now: int, data: bytes) -> bool:
        """Return whether the law may start: its guess has arrived, timed out or is not needed."""
        if not self._wants_guess:
            return True
        waited = time.monotonic() - self._asked_at if self._guess else 0.0
        limit = self._answers.time_limit
        if self._guess is None:
            optimizer = self._optimizer
            if time.monotonic() < self._ask_from:
                return False
            if optimizer is not None and optimizer.service_is_ready():
                self._ask(optimizer, data)
                return False
            if not self._patient():
                self._without_guess("no such service on the graph", now)
            return not self._wants_guess
        if self._guess.done():
            self._use_guess(self._guess.result(), now)
        elif waited > limit:
            self._guess.cancel()
            self._without_guess(f"no answer within {waited:.1f} s", now)
        return not self._wants_guess

    def _patient(self) -> bool:
        """Return whether to wait longer for the optimizer's service to appear."""
        if self._looked_since is None:
            self._looked_since = time.monotonic()
        return time.monotonic() - self._looked_since < self._answers.time_limit

    def _ask(self, optimizer: Client, data: bytes) -> None:
        request = self._answers.request(deserialize_message(data, NavState))
        self._asked_at = time.monotonic()
        self._asked = self._answers.read(data)[0]
        self._guess = optimizer.call_async(request)

    def _use_guess(self, answer: Any, now: int) -> None:
        if answer is None or answer.error_code != SolveTrajectory.Response.NONE:
            reason = answer.message if answer else "the call failed"
            self._without_guess(reason or f"error {answer.error_code}", now)
            return
        try:
            if not self._flies:
                self._answers.check_start(answer)
            told = self._answers.start_from(answer)
        except FindsNoWay as error:
            self._refuse(str(error), now)
            return
        except ValueError as error:
            self._without_guess(f"unusable answer: {error}", now)
            return
        self._wants_guess = False
        about = {"method": answer.method, ASKED_AT_NS: self._asked, **told}
        self.diagnostics.report(Level.OK, ANSWER_TAKEN, now, about)
        self._end_planning()

    @property
    def _flies(self) -> bool:
        """Return whether the simulator flies, so that an engine may be lit."""
        simulator = self._membership.simulator
        return simulator is not None and simulator.state == State.FLYING

    def _refuse(self, text: str, now: int) -> None:
        """Refuse the flight before ignition, with the reason."""
        text = self._mission.with_names(text)
        self._guess = None
        self._looked_since = None
        self.diagnostics.report(Level.ERROR, text, now)
        self._membership.say(State.FAILED, reason=text)

    def _end_planning(self) -> None:
        """Announce READY: the simulator need not hold the count any longer."""
        if self._membership.state is State.PLANNING:
            self._heard_at = time.monotonic()
            self._membership.say(State.READY)

    def _without_guess(self, reason: str, now: int) -> None:
        if self._law.lacks_plan:
            if not self._flies:
                self._refuse(why_no_plan(self._law.kind.name, self._answers.arrays, reason), now)
                return
            self._guess = None
            self._looked_since = None
            text = f"optimizer: {reason}; law {self._law.kind.name} needs its plan: asking again"
            self.diagnostics.report(Level.ERROR, text, now)
            self._ask_from = time.monotonic() + self.values["optimizer_timeout_s"]
            self._end_planning()
            return
        self._wants_guess = False
        instead = "starting from the navigation state alone"
        if self._law.kind.needs_trajectory:
            instead = f"law {self._law.kind.name} cannot start without it: flying peg"
        self.diagnostics.report(Level.WARN, f"optimizer: {reason}; {instead}", now)

    # ---- the flight

    def _answer(self, now: int, sequence: int, measured: Any) -> None:
        if self._last is not None and now < self._last[0] and sequence <= self._last[1]:
            # with a later number it is a newer state: its stamp or the last one is wrong
            if sequence > 0:
                self._pass_over(now)
                return
            text = "the flight begins again: starting again from nothing"
            self.diagnostics.report(Level.WARN, text, now)
            self._forget()
        answers = self._answers
        answers.identity = (self._membership.flight_id, self._membership.member_id)
        begun = time.perf_counter()
        due = answers.step(now, measured)
        if not self._law.state["navigation"]["row"]:
            # neither the stamp nor the number of a refused state can be trusted
            self._last = now, sequence
        if due:
            self._longest_cycle_s = max(self._longest_cycle_s, time.perf_counter() - begun)
        if self._law.steered:
            command = answers.command()
            self._membership.seals.seal(command)
            self._command_out.publish(command)
        if due:
            self._status_out.publish(answers.status())
            self._statuses += 1
        self._report(now, due)

    def _pass_over(self, now: int) -> None:
        """Count a late state, which arrived after a newer one, and do not answer it."""
        self._late += 1
        if is_worth_reporting(self._late):
            text = "navigation state older than one before it: not answered"
            self.diagnostics.report(Level.WARN, text, now, {"late": self._late})

    def _report_navigation(self, now: int) -> None:
        """Report the first refusal of navigation, and its recovery after one good cycle."""
        watch = self._law.state["navigation"]
        if int(watch["acquired"]) != self._acquired:
            self._acquired = int(watch["acquired"])
            text = "navigation acquired anew: it agrees with itself, not the past"
            self.diagnostics.report(Level.WARN, text, now)
        refused = int(watch["refused"])
        if refused > self._refused:
            if self._refused_before is None:
                self._refused_before = self._refused
                reasons = _join_texts(REFUSAL_TEXTS, int(watch["reasons"]))
                text = f"navigation refused, the last solution is held: {reasons}"
                self.diagnostics.report(Level.WARN, text, now)
            self._refused = refused
            self._good_from = None
        elif self._refused_before is None:
            return
        elif self._good_from is None:
            self._good_from = now
        elif now - self._good_from >= self.values["cycle_period_s"] * NANOSECONDS:
            count = self._refused - self._refused_before
            self._refused_before = None
            self.diagnostics.report(
                Level.OK, "navigation good again", now, {"refused": count, "in_all": refused}
            )

    def _report_monitors(self, now: int) -> None:
        """Report each newly violated rule, and the number of violations at every tenfold."""
        monitors = self._law.state["monitors"]
        violations, violated = int(monitors["violations"]), int(monitors["violated"])
        more = violations > self._violations and is_worth_reporting(violations)
        if violated != self._violated or more:
            reasons = _join_texts(MONITOR_TEXTS, int(monitors["flags"]))
            text = f"answer not let out, the last good one is held: {reasons}"
            self.diagnostics.report(Level.ERROR, text, now, {"violations": violations})
        self._violations, self._violated = violations, violated

    def _report(self, now: int, due: bool) -> None:
        state = self._law.state
        ends = self._law.phase in (GuidanceStatus.PHASE_HOLD, GuidanceStatus.PHASE_CUTOFF)
        if ends and not self._published_longest_cycle:
            # later cycles only refine the cut-off
            self._published_longest_cycle = True
            milliseconds = f"{1e3 * self._longest_cycle_s:.6g}"
            self._timing_out.publish(
                timing(self, self._membership.flight_id, {LONGEST_CYCLE_MS: milliseconds})
            )
        self._report_failures(now)
        self._report_navigation(now)
        self._report_monitors(now)
        if due:
            # between cycles, and in a coast before its burn is aimed, it is of the leg before
            self._report_error(now)
        kind = self._law.kind
        solved = state["law"] in (kind.code, 0)
        if solved == self._fallen_back and not kind.needs_trajectory:
            self._fallen_back = not solved
            level, text = (
                (Level.OK, f"solution of law {kind.name} again")
                if solved
                else self._answers.fallback_report()
            )
            self.diagnostics.report(level, text, now)
        without = self._answers.jettison_after_cutoff
        if without != self._without_jettison:
            self._without_jettison = without
            if without:
                text = "the heating limit is not met before cut-off: planning without the jettison"
                self.diagnostics.report(Level.WARN, text, now)

    def _report_error(self, now: int) -> None:
        """Report each new error of a cycle, and the first cycle without one."""
        error = self._answers.reported_error
        if error not in (self._reported, GuidanceStatus.NAVIGATION_INVALID):
            self._reported = error
            if error == GuidanceStatus.NONE:
                self.diagnostics.report(Level.OK, "solution good again", now)
            else:
                stale = {"stale_cycles": int(self._law.state["stale_cycles"])}
                self.diagnostics.report(Level.WARN, ERROR_TEXTS[error], now, stale)

    def _report_failures(self, now: int) -> None:
        state = self._law.state
        found = state["found"]
        if int(found["count"]) != self._findings:
            self._findings = int(found["count"])
            text = describe(found, self._mission.arc_names, self._mission.jettison_names)
            self.diagnostics.report(Level.WARN, text, now, {"ratio": float(found["ratio"])})
        safe = aims_at_safe_orbit(state)
        if safe and not self._reported_safe:
            self.diagnostics.report(Level.WARN, SAFE_ORBIT, now)
        self._reported_safe = safe
        mode = int(state["avoid"]["mode"])
        if mode != self._avoiding and (
            text := describe_avoiding(state["avoid"], self._mission.area_names)
        ):
            self.diagnostics.report(Level.WARN, text, now)
        self._avoiding = mode
