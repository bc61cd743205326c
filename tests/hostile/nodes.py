# SPDX-License-Identifier: Apache-2.0
"""Every message callback of every node, called as by the middleware, without a network.

An input is the number of a callback and the CDR of a message for it.
"""

import contextlib
import io
import json
import math
import shutil
import socket
import tempfile
from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rich.console import Console

from ares_bags.recorder import RecorderNode
from ares_bags.verify import verify
from ares_bringup.facts import facts_of
from ares_bringup.monitor import FlightMonitor
from ares_bringup.report import console, print_summary
from ares_bringup.summary import FlightSummary
from ares_bringup.summary_json import to_json
from ares_bringup.terminal import TerminalView
from ares_guidance.node import GuidanceNode
from ares_models.kernels.steering import UNIT_TOLERANCE
from ares_models.mission import load_mission
from ares_msgs.msg import (
    FlightEvent,
    FlightMember,
    GuidanceStatus,
    NavState,
    ThrustCommand,
    VehicleState,
)
from ares_node.diagnostics import (
    FLIGHT_TIME_S,
    GOOD,
    LONGEST_CYCLE_MS,
    NODE,
    PACE,
    PAGES,
    PAUSED,
    VERDICT,
    Timing,
    hardware_id,
)
from ares_node.domains import claimed_domain
from ares_node.node import FlightNode
from ares_node.time import stamp_from_ns
from ares_vehicle_sim.node import VehicleSimNode
from ares_vehicle_sim.simulator import CommandRefused, Simulator
from ares_view.live.node import LiveNode
from ares_view.live.story import Seen
from ares_view.standard.node import ViewNode
from hostile.messages import heard, hostile, hostile_raw
from hostile.target import Broken, Target, check, one_line

FLIGHT = 0x1234
#: Members of the flight that are not the node that is fuzzed.
SIMULATOR_ID, GUIDANCE_ID = 77, 78
MISSION = "ares_v"


@dataclass(frozen=True)
class Call:
    """Hold a callback: its message class, its mode, and fields that usually keep their values."""

    kind: Any
    good: Callable[[], Any]
    call: Callable[[Any], None]
    raw: bool = False
    kept: Sequence[str] = ("flight_id", "hardware_id")


class NodeTarget(Target):
    """Call a node's callbacks, and check the node at intervals."""

    stateful = True
    #: Inputs between looks.
    look_every = 64

    def __init__(self) -> None:
        self._held = ExitStack()
        self.calls: list[Call] = []
        self._count = 0
        self._node: Any = None

    def begin(self) -> None:
        self.end()
        domain = self._held.enter_context(claimed_domain())
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self._held.callback(self.context.try_shutdown)
        self.folder = Path(tempfile.mkdtemp(prefix="ares-fuzz-"))
        self._held.callback(shutil.rmtree, self.folder, True)
        self._count = 0
        self.calls = list(self.set_up())

    def end(self) -> None:
        self._held.close()
        self._held = ExitStack()

    def node(self, kind: Callable[..., FlightNode], **parameters: object) -> Any:
        """Start a node; return it active."""
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = kind(context=self.context, parameter_overrides=overrides)
        self._held.callback(node.destroy_node)
        self._held.callback(node.stop)
        if not node.start():
            raise RuntimeError(node.failure)
        return node

    def _hear(self, member: FlightMember) -> None:
        # a node that starts anew has another membership
        self._node._membership._on_member(member)

    @abstractmethod
    def set_up(self) -> Sequence[Call]:
        """Make the node; what can be called."""

    def look(self) -> None:
        """Run the node's timers and check its state."""

    def make(self, random: Random) -> bytes:
        number = random.randrange(len(self.calls))
        chosen = self.calls[number]
        maker = hostile_raw if chosen.raw else hostile
        return bytes([number]) + maker(chosen.good(), random, chosen.kept)

    def run(self, data: bytes) -> str:
        chosen = self.calls[data[0] % len(self.calls)] if data else self.calls[0]
        message: Any = data[1:] if chosen.raw else heard(chosen.kind, data[1:])
        if message is None:
            return "no message"
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            chosen.call(message)
            self._count += 1
            if self._count % self.look_every == 0:
                self.look()
        check("Traceback" not in said.getvalue(), f"a traceback: {said.getvalue()[-300:]!r}")
        return chosen.kind.__name__


# ---- good messages


def _member(role: int, state: int, member_id: int, **more: Any) -> FlightMember:
    return FlightMember(
        flight_id=FLIGHT,
        member_id=member_id,
        role=role,
        state=state,
        mission=MISSION,
        node="/ares/other",
        **more,
    )


def _event() -> FlightEvent:
    return FlightEvent(
        stamp=stamp_from_ns(200 * 10**9),
        flight_id=FLIGHT,
        time=200.0,
        type=FlightEvent.JETTISON,
        position=[6.5e6, 1e5, 1e5],
        velocity=[10.0, 7e3, 100.0],
        mass=3e5,
        heating_rate=1e3,
    )


def _diagnostics() -> DiagnosticArray:
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN,
        name="ares/guidance",
        message="a warning",
        hardware_id=hardware_id(FLIGHT),
        values=[KeyValue(key="n", value="1")],
    )
    array = DiagnosticArray(status=[status])
    array.header.stamp = stamp_from_ns(200 * 10**9)
    return array


_TIMINGS = (
    {PACE: "1.0", PAUSED: "False", NODE: "/ares/vehicle_sim"},
    {PACE: "0.0", PAUSED: "False", FLIGHT_TIME_S: "nan"},
    {PACE: "", NODE: "no name"},
    {PACE: "nan", PAUSED: "x", NODE: ""},
    {VERDICT: "good", GOOD: "True"},
    {VERDICT: "bad"},
    {LONGEST_CYCLE_MS: "1.5"},
    {LONGEST_CYCLE_MS: "much"},
    {PAGES: "1"},
    {PAGES: "1.5"},
)


def _timing(random: Random) -> Timing:
    values = [KeyValue(key=key, value=value) for key, value in random.choice(_TIMINGS).items()]
    return Timing(name="vehicle_sim", hardware_id=hardware_id(FLIGHT), values=values)


class Flight:
    """Make states and commands of a real flight, one after the other."""

    def __init__(self) -> None:
        self._random = Random(1)
        self._simulator = Simulator(load_mission(MISSION))
        self._sequence = 0

    def nav_state(self) -> NavState:
        nav = self._simulator.navigation
        self._sequence += 1
        return NavState(
            stamp=stamp_from_ns(self._simulator.time_ns + self._sequence * 10**8),
            flight_id=FLIGHT,
            sequence=self._sequence,
            position=nav["position"],
            velocity=nav["velocity"],
            mass=float(nav["mass"]),
            sensed_delta_v=nav["sensed_delta_v"],
            heating_rate=float(nav["heating_rate"]),
            arc=int(nav["arc"]),
            arc_start_time=float(nav["arc_start_time"]),
            jettisoned=int(nav["jettisoned"]),
        )

    def vehicle_state(self) -> VehicleState:
        truth = self._simulator.truth()
        self._sequence += 1
        state = VehicleState(
            stamp=stamp_from_ns(self._simulator.time_ns + self._sequence * 10**8),
            flight_id=FLIGHT,
            sequence=self._sequence,
        )
        for name in truth.dtype.names:
            if hasattr(state, name):
                value = truth[name]
                kind = state.get_fields_and_field_types()[name]
                whole = kind.startswith(("uint", "int"))
                setattr(state, name, value if value.shape else (int if whole else float)(value))
        return state

    def status(self) -> GuidanceStatus:
        return GuidanceStatus(
            stamp=stamp_from_ns(200 * 10**9),
            flight_id=FLIGHT,
            guidance_id=GUIDANCE_ID,
            cycle=3,
            law=1,
            phase=2,
            converged=True,
            iterations=3,
            time_to_go=300.0,
            cutoff_time=500.0,
            predicted_position=[6.6e6, 1e5, 1e5],
            predicted_velocity=[10.0, 7.8e3, 10.0],
        )

    def command(self) -> ThrustCommand:
        return ThrustCommand(
            stamp=stamp_from_ns(200 * 10**9),
            flight_id=FLIGHT,
            guidance_id=GUIDANCE_ID,
            nav_stamp=stamp_from_ns(200 * 10**9),
            reference_time=200.0,
            direction=[0.0, 1.0, 0.0],
            cutoff_time=500.0,
        )

    def timing(self) -> Timing:
        return _timing(self._random)

    def member(self) -> FlightMember:
        random = self._random
        # a flight that is over is seldom: it ends what else is tried
        state = random.randint(1, 4) if random.random() < 0.97 else random.randint(5, 7)
        return _member(random.randint(1, 4), state, random.choice((SIMULATOR_ID, GUIDANCE_ID)))


# ---- the nodes


class SimulatorCallbacks(NodeTarget):
    """Send commands and announcements to the simulator, before, during and after a flight."""

    name = "simulator"
    share = 15.0

    def set_up(self) -> Sequence[Call]:
        self._node = self.node(VehicleSimNode, flight_id=FLIGHT, mission=MISSION)
        self._flight = Flight()
        self._join()
        return (
            Call(
                ThrustCommand,
                self._command,
                self._hear_command,
                kept=("flight_id", "guidance_id", "nav_stamp"),
            ),
            Call(FlightMember, self._flight.member, self._hear),
        )

    def _join(self) -> None:
        for state in (FlightMember.PRESENT, FlightMember.READY):
            word = _member(FlightMember.GUIDANCE, state, GUIDANCE_ID, guidance_id=GUIDANCE_ID)
            self._node._membership._on_member(word)
        self._node._flight.on_watch()

    def _hear_command(self, command: ThrustCommand) -> None:
        # a node that starts anew has another flight
        self._node._flight.on_command(command)

    def _command(self) -> ThrustCommand:
        simulator = self._node.simulator
        now = stamp_from_ns(simulator.time_ns)
        return ThrustCommand(
            stamp=now,
            flight_id=FLIGHT,
            guidance_id=self._node._membership.guidance_id,
            nav_stamp=now,
            reference_time=simulator.time_ns / 1e9,
            direction=[0.0, 1.0, 0.0],
            direction_rate=[0.0, 1e-4, 0.0],
            cutoff_time=simulator.time_ns / 1e9 + 300.0,
            jettison=0,
            jettison_time=simulator.time_ns / 1e9 + 100.0,
        )

    def look(self) -> None:
        simulator = self._node.simulator
        truth = simulator.truth()
        for name in ("position", "velocity", "mass"):
            check(math.isfinite(float(sum(map(abs, [*truth[name].flat])))), f"{name} {truth[name]}")
        if self._node.done:
            # another simulator was there first
            self.begin()
        elif simulator.complete:
            self._node.trigger_deactivate()
            self._node.trigger_cleanup()
            check(self._node.start(), f"no new flight: {self._node.failure}")
            self._join()
        else:
            self._node._flight.on_watch()


class GuidanceCallbacks(NodeTarget):
    """Send navigation states and announcements to guidance, before and during a flight."""

    name = "guidance"
    share = 16.0

    def set_up(self) -> Sequence[Call]:
        self._node = self.node(GuidanceNode, mission=MISSION, flight_id=FLIGHT)
        self._flight = Flight()
        self._agree()
        return (
            Call(
                NavState,
                self._flight.nav_state,
                self._node._nav_in.callback,
                raw=True,
                kept=("flight_id", "sequence"),
            ),
            Call(FlightMember, self._flight.member, self._hear),
        )

    def _agree(self) -> None:
        mine = self._node._membership.member_id
        word = _member(
            FlightMember.VEHICLE_SIM, FlightMember.FLYING, SIMULATOR_ID, guidance_id=mine
        )
        self._node._membership._on_member(word)

    def look(self) -> None:
        self._node._on_watch()
        self._node._join()
        self._agree()
        law = self._node._law
        length = math.hypot(*law.steering[0]["direction"])
        if law.steered and not abs(length - 1.0) < UNIT_TOLERANCE:
            # made of a state that no vehicle is in: nobody may fly it
            with contextlib.suppress(CommandRefused):
                Simulator(load_mission(MISSION)).command(law.steering)
                raise Broken(f"a direction of length {length} is flown")


class Recording(NodeTarget):
    """Send raw messages to the recorder; its bag must be whole."""

    name = "recorder"
    share = 12.0

    def set_up(self) -> Sequence[Call]:
        self._bag = self.folder / "flight"
        # announced messages would be awaited, but never come here
        self._held.enter_context(patch("ares_bags.recorder.DRAIN_LIMIT", 0.01))
        self._held.enter_context(patch("ares_bags.recorder.QUIET_TIME", 0.0))
        self._node = self.node(RecorderNode, bag=str(self._bag), flight_id=FLIGHT)
        self._flight = Flight()
        goods = {
            "nav_state": (NavState, self._flight.nav_state),
            "vehicle_state": (VehicleState, self._flight.vehicle_state),
            "guidance_status": (GuidanceStatus, self._flight.status),
            "thrust_command": (ThrustCommand, self._flight.command),
            "flight_event": (FlightEvent, _event),
            "diagnostics": (DiagnosticArray, _diagnostics),
        }
        calls = [Call(FlightMember, self._flight.member, self._hear)]
        for subscription in self._node._inputs:
            found = goods.get(subscription.topic_name.rsplit("/", maxsplit=1)[-1])
            if found:
                calls.append(Call(*found, subscription.callback, raw=True))
        return calls

    def look(self) -> None:
        if self._node._writer is not None and self._count < 4096:
            return
        # the flight is over, or said to be
        counts = dict(self._node.message_counts)
        self._node.drain_and_close()
        if counts:
            found = verify(self._bag, decode=False)
            check(found.findings == [], f"the bag is damaged: {found.findings}")
            check(found.messages == sum(counts.values()), "the bag has other messages")
            shutil.rmtree(self._bag)
        self.begin()


#: Targets of each kind: a state, elements, a Keplerian orbit.
_JUDGED = (MISSION, "geostationary_burn", "delta_iii")


def _must_be_a_line(text: str) -> None:
    one_line(text)


class Judging(NodeTarget):
    """Send events, status, diagnostics, timing, announcements to the judge; print its summary."""

    name = "judge"
    share = 12.0
    look_every = 1024

    def set_up(self) -> Sequence[Call]:
        self._summaries = []
        monitors = []
        for mission in _JUDGED:
            node = Node("judge", namespace="ares", context=self.context)
            self._held.callback(node.destroy_node)
            self._summaries.append(
                FlightSummary(facts_of(load_mission(mission)), "peg", None, FLIGHT)
            )
            monitors.append(FlightMonitor(node, self._summaries[-1], _must_be_a_line))
            self._held.callback(monitors[-1].leave)
        self._flight = Flight()

        def call(kind: Any, good: Callable[[], Any], name: str) -> Call:
            def all_hear(message: Any) -> None:
                for monitor in monitors:
                    getattr(monitor, name)(message)

            return Call(kind, good, all_hear)

        def member(word: FlightMember) -> None:
            for monitor in monitors:
                monitor._membership._on_member(word)

        return (
            call(FlightEvent, _event, "_on_event"),
            call(GuidanceStatus, self._flight.status, "_on_status"),
            call(DiagnosticArray, _diagnostics, "_on_diagnostics"),
            call(Timing, self._flight.timing, "_on_timing"),
            Call(FlightMember, self._flight.member, member),
        )

    def look(self) -> None:
        for summary in self._summaries:
            with contextlib.redirect_stdout(io.StringIO()):
                print_summary(summary, console())
            json.dumps(to_json(summary), allow_nan=False)
            one_line(summary.verdict)
            end = summary.end
            if end is not None and summary.exit_code == 0:
                values = (*end.position, *end.velocity, end.mass)
                check(all(map(math.isfinite, values)), f"arrived at {values}")


class Viewing(NodeTarget):
    """Send states, events, announcements and diagnostics to the view."""

    name = "view"
    share = 10.0

    def set_up(self) -> Sequence[Call]:
        self._node = self.view()
        self._flight = flight = Flight()
        goods = {
            "vehicle_state": (VehicleState, flight.vehicle_state, True),
            "nav_state": (NavState, flight.nav_state, True),
            "thrust_command": (ThrustCommand, flight.command, True),
            "guidance_status": (GuidanceStatus, flight.status, True),
            "flight_event": (FlightEvent, _event, False),
            "flight_member": (FlightMember, flight.member, False),
            "diagnostics": (DiagnosticArray, _diagnostics, False),
        }
        calls = []
        for subscription in self._node._inputs:
            kind, good, raw = goods[subscription.topic_name.rsplit("/", maxsplit=1)[-1]]
            calls.append(Call(kind, good, subscription.callback, raw=raw))
        return calls

    def view(self) -> Any:
        """Start the view node."""
        return self.node(ViewNode, mission=MISSION)

    def look(self) -> None:
        self._node._last_shown = self._node._last_path = -math.inf
        self._node._on_timer()


class Forwarding(Viewing):
    """Send the same to a view with a Foxglove server."""

    name = "view for Foxglove"
    share = 3.0

    def view(self) -> Any:
        with socket.socket() as made:
            made.bind(("127.0.0.1", 0))
            port = made.getsockname()[1]
        return self.node(ViewNode, mission=MISSION, foxglove_port=port, rate_hz=50.0)


class OnTerminal(NodeTarget):
    """Send states to the terminal view, and to the judge what else it shows."""

    name = "terminal"
    share = 0.8
    look_every = 1

    def set_up(self) -> Sequence[Call]:
        self._node = node = Node("judge", namespace="ares", context=self.context)
        self._held.callback(node.destroy_node)
        self._summary = FlightSummary(facts_of(load_mission(MISSION)), "peg", None, FLIGHT)
        self._monitor = monitor = FlightMonitor(node, self._summary, _must_be_a_line)
        self._held.callback(monitor.leave)
        out = Console(file=io.StringIO(), force_terminal=True, width=80)
        view = self._held.enter_context(TerminalView(out))
        view.show(monitor)
        self._view = view
        self._flight = Flight()
        begun = _event()
        begun.type = FlightEvent.FLIGHT_STARTED
        monitor._on_event(begun)
        assert view._input is not None
        return (
            Call(VehicleState, self._flight.vehicle_state, view._input.callback, raw=True),
            Call(FlightEvent, _event, monitor._on_event),
            Call(GuidanceStatus, self._flight.status, monitor._on_status),
        )

    def look(self) -> None:
        self._view.show(self._monitor)


class LivePage(NodeTarget):
    """Send states, status, events, announcements, diagnostics and timing to the live page."""

    name = "live page"
    share = 12.0

    def set_up(self) -> Sequence[Call]:
        with contextlib.redirect_stderr(io.StringIO()):
            self._node = self.node(LiveNode)
        self._flight = Flight()
        node = self._node
        return (
            Call(VehicleState, self._flight.vehicle_state, node._on_state, raw=True),
            Call(GuidanceStatus, self._flight.status, node._on_status, raw=True),
            Call(FlightEvent, _event, node._on_event),
            Call(DiagnosticArray, _diagnostics, node._on_diagnostics),
            Call(Timing, self._flight.timing, node._on_timing),
            Call(FlightMember, self._flight.member, node._on_member),
        )

    def look(self) -> None:
        self._node._on_look()
        message, _ = self._node._story.news(Seen())
        json.dumps(message, allow_nan=False)
