# SPDX-License-Identifier: Apache-2.0
"""Follow a flight on the graph and serve the page that shows it: the live node."""

import math
import queue
import sys
import threading
import time
import webbrowser
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.exceptions import InvalidServiceNameException
from rclpy.executors import Executor
from rclpy.validate_full_topic_name import validate_full_topic_name

from ares_models.mission import Mission, MissionError, load_mission
from ares_models.passage import Passage
from ares_msgs.msg import FlightEvent, FlightMember, GuidanceStatus, VehicleState
from ares_node import diagnostics, qos
from ares_node.diagnostics import Timing, hardware_id, number_of, timing
from ares_node.membership import FLIGHT_ID, MOST_HEARD, Role, State
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter
from ares_node.states import StateMessage, Unreadable, message_of
from ares_node.time import NANOSECONDS, seconds_from_stamp
from ares_view.live.address import LOOPBACK, AddressError, listen
from ares_view.live.flight_report import NoReport, ReportMaker, command, find_bag
from ares_view.live.server import LiveServer
from ares_view.live.story import Story
from ares_view.told_mission import told_mission

#: Wall time in s between updates of the pages.
UPDATE_PERIOD = 0.05
#: States, and guidance statuses, shown per update at most.
TAKEN = 4
#: Wall time in s over which the rate of the flight is measured.
RATE_PERIOD = 1.0
#: Wall time in s between reports of the number of open pages.
PAGES_PERIOD = 0.25
#: Wall time in s without a state after which another flight may be shown.
QUIET = 2.0
#: Wall time in s without an open page before the process ends; a reload takes less.
PAGES_LEFT = 3.0
#: Wall time in s for the pages to receive the last message.
GOODBYE = 1.0

LEVELS = {DiagnosticStatus.WARN: "WARN", DiagnosticStatus.ERROR: "ERROR"}
LAWS = {
    GuidanceStatus.LAW_PEG: "peg",
    GuidanceStatus.LAW_PEG_THESIS: "peg_thesis",
    GuidanceStatus.LAW_IGM: "igm",
    GuidanceStatus.LAW_OPTIMAL: "optimal",
}

PARAMETERS = (
    FLIGHT_ID,
    Parameter(
        "mission", "", "Mission that is flown: name, or path; empty: as announced by the flight."
    ),
    Parameter(
        "bag", "", "Bag of the flight, for its report, or a folder of bags with it; empty: none."
    ),
    Parameter("end_with_pages", False, "End when the flight is over and no page is open."),
    Parameter("host", LOOPBACK, "Address to serve on; beyond this machine with a token."),
    Parameter("port", 0, "Port to serve on; 0: a free one.", minimum=0, maximum=65535),
    Parameter("open_browser", False, "Open the page."),
)


class LiveNode(FlightNode):
    """Show one flight on a page and forward the reader's commands.

    It is no member of the flight: no node waits for it, and nothing it publishes is recorded.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters."""
        super().__init__("live", parameters=PARAMETERS, **kwargs)

    def configure(self) -> None:
        """Serve the page; create the endpoints."""
        values = self.values
        self._mission: Mission | None = None
        try:
            if values["mission"]:
                self._mission = load_mission(values["mission"])
            listener = listen(values["host"], values["port"])
        except (MissionError, AddressError) as error:
            raise NodeError(str(error)) from error
        self._story = Story()
        self._shown = values["flight_id"]
        if self._shown:
            self._story.begin(self._shown, self._mission)
        self._states: deque[bytes] = deque(maxlen=4096)
        self._statuses: deque[bytes] = deque(maxlen=4096)
        layout = StateMessage(VehicleState)
        self._read, self._fields = layout.read, layout.fields
        self._last_sequence = -1
        self._simulators: dict[int, FlightMember] = {}
        self._recorders: dict[int, FlightMember] = {}
        self._looked_for_report = False
        self._seen_at = -math.inf
        self._setter: Client | None = None
        self._commands: queue.SimpleQueue[tuple[str, float, Callable[[str], None]]]
        self._commands = queue.SimpleQueue()
        self._rate_from: tuple[float, float] | None = None
        self._pages_said_at = -math.inf
        self._server = LiveServer(listener, self._story, lambda *said: self._commands.put(said))
        print(f"live: {self._server.access.url}", file=sys.stderr, flush=True)
        self._timing_out = self.create_publisher(Timing, qos.TIMING, qos.DIAGNOSTIC)
        self._inputs = [
            self.create_subscription(kind, topic, take, profile, raw=profile is qos.LATEST)
            for kind, topic, take, profile in (
                (VehicleState, qos.VEHICLE_STATE, self._on_state, qos.LATEST),
                (GuidanceStatus, qos.GUIDANCE_STATUS, self._on_status, qos.LATEST),
                (FlightEvent, qos.FLIGHT_EVENT, self._on_event, qos.EVENTS),
                (DiagnosticArray, qos.DIAGNOSTICS, self._on_diagnostics, qos.DIAGNOSTIC),
                (Timing, qos.TIMING, self._on_timing, qos.DIAGNOSTIC),
                (FlightMember, qos.FLIGHT_MEMBER, self._on_member, qos.MEMBERS),
            )
        ]

    def activate(self) -> None:
        """Start updating the page; open it."""
        self._looks = self.wall_timer(UPDATE_PERIOD, self._on_look)
        if self.values["open_browser"]:
            url = self._server.access.url
            # in a thread, since it may wait for the browser
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()

    def deactivate(self) -> None:
        """Stop updating the page; it keeps what it shows."""
        self.destroy_timer(self._looks)

    def cleanup(self) -> None:
        """Send the pages their last message; free port and endpoints."""
        self._server.close(GOODBYE)
        for endpoint in self._inputs:
            self.destroy_subscription(endpoint)
        self.destroy_publisher(self._timing_out)
        self._forget_setter()

    def drain(self, executor: Executor) -> None:
        """Show the last messages."""
        self._on_look()

    @property
    def flight_id(self) -> int:
        """Return the identity of the flight shown; 0 before any."""
        return getattr(self, "_shown", 0)

    # ---- choice of the flight

    def _on_member(self, member: FlightMember) -> None:
        if not member.flight_id or member.role not in (Role.VEHICLE_SIM, Role.RECORDER):
            return
        recorder = member.role == Role.RECORDER
        heard = self._recorders if recorder else self._simulators
        heard[int(member.flight_id)] = member
        if len(heard) > MOST_HEARD:
            del heard[next(iter(heard))]
        if recorder:
            return
        if member.flight_id == self._shown and not self._story.mission_known:
            # a node that joins in flight may receive states first
            mission, note = self._mission_of(self._shown)
            if mission is None:
                self._story.update(note=note)
            else:
                self._story.learn(mission)
        if member.state in (State.PRESENT, State.READY, State.FLYING):
            self._turn_to(int(member.flight_id))
        elif member.flight_id == self._shown:
            self._forget_setter()

    def _turn_to(self, flight_id: int) -> bool:
        """Return whether a flight is shown; switch to it if the one shown is over or silent."""
        if flight_id == self._shown or self.values["flight_id"]:
            return flight_id == self._shown
        age = self._story.age()
        if self._shown and not (self._story.ended or age is None or age > QUIET):
            return False
        self._begin(flight_id)
        return True

    def _begin(self, flight_id: int) -> None:
        self._shown = flight_id
        self._last_sequence = -1
        self._rate_from = None
        self._looked_for_report = False
        self._server.report = None
        self._story.begin(flight_id, *self._mission_of(flight_id))
        self._forget_setter()

    def _mission_of(self, flight_id: int) -> tuple[Mission | None, str]:
        """Return the mission: the given one, else the announced one; or None and the reason."""
        if self._mission is not None:
            return self._mission, ""
        simulator = self._simulators.get(flight_id)
        try:
            if simulator is None:
                raise MissionError("the mission", ["was not told"])
            return told_mission(simulator), ""
        except MissionError as error:
            return None, f"Names and limits are not known: {error}."

    # ---- subscriptions

    def _on_state(self, data: bytes) -> None:
        self._states.append(data)

    def _on_status(self, data: bytes) -> None:
        self._statuses.append(data)

    def _on_event(self, event: FlightEvent) -> None:
        if self._turn_to(int(event.flight_id)):
            self._story.add_event(event.type, event.index, event.time, event.mass)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id != hardware_id(self._shown):
                continue
            said = {item.key: item.value for item in status.values}
            if passage := Passage.from_text(said.get(diagnostics.PASSAGE, "")):
                self._story.set_passage(passage)
            level = LEVELS.get(status.level)
            if level:
                node = status.name.rsplit("/", maxsplit=1)[-1]
                moment = seconds_from_stamp(message.header.stamp)
                self._story.add_complaint(moment, level, node, status.message)

    def _on_timing(self, status: Timing) -> None:
        if status.hardware_id != hardware_id(self._shown):
            return
        said = {item.key: item.value for item in status.values}
        pace = number_of(said, diagnostics.PACE)
        if pace is not None:
            true = str(True)
            self._story.update(
                pace=pace,
                paused=said.get(diagnostics.PAUSED) == true,
                replayed=said.get(diagnostics.REPLAYED) == true,
            )
            self._control(said.get(diagnostics.NODE, ""))
        if diagnostics.VERDICT in said:
            self._story.update(
                verdict=said[diagnostics.VERDICT],
                good=said.get(diagnostics.GOOD) == str(True),
                shortcomings=said.get(diagnostics.SHORTCOMINGS, "").splitlines(),
                exit_status=said.get(diagnostics.EXIT_STATUS, ""),
            )

    def _on_look(self) -> None:
        """Show queued messages and send the news to the pages."""
        self._take_states()
        self._take_statuses()
        self._obey()
        if self._bag_is_closed() and not self._looked_for_report:
            self._looked_for_report = True
            self._look_for_report()
        now = time.monotonic()
        self._end_unseen(now)
        if now - self._pages_said_at > PAGES_PERIOD and self._last_sequence < 0:
            # the launcher may wait for the first page
            self._pages_said_at = now
            words = {diagnostics.PAGES: self._server.pages}
            self._timing_out.publish(timing(self, self._shown, words))
        self._server.notify()

    # ---- end of the flight

    def _bag_is_closed(self) -> bool:
        """Return True when the flight is over and its recorder has finished."""
        if self._story.judged or not self._story.ended:
            return self._story.judged
        recorder = self._recorders.get(self._shown)
        return recorder is None or recorder.state in (State.OVER, State.FAILED, State.LEFT)

    def _look_for_report(self) -> None:
        """Find the bag, from which the server makes the report on demand."""
        flown = self._shown in self._simulators
        where = self.values["bag"]
        try:
            if flown and self._shown not in self._recorders:
                raise NoReport("There is no report: the flight was flown without a bag.")
            if not where:
                raise NoReport("There is no report here: this page knows of no bag.")
            bag = find_bag(Path(where), self._shown)
        except NoReport as error:
            self._story.update(no_report=str(error))
        else:
            self._server.report = ReportMaker(bag)
            self._story.update(report=command(bag))

    def _end_unseen(self, now: float) -> None:
        """End the process when the flight is over and no page is open, if so configured."""
        if not self._server.unseen:
            self._seen_at = now
        # a replay has neither judge nor simulator
        over = self._story.judged or (self._story.ended and self._shown not in self._simulators)
        if self.values["end_with_pages"] and over and now - self._seen_at > PAGES_LEFT:
            self.finish()

    def _take_states(self) -> None:
        taken: list[tuple[float, int, Any]] = []
        for stamp, flight_id, sequence, record in _readable(_some(self._states), self._read):
            if not self._turn_to(flight_id):
                continue
            if sequence <= self._last_sequence:
                # the flight starts again: a replay
                self._begin(flight_id)
                taken.clear()
            self._last_sequence = sequence
            taken.append((stamp / NANOSECONDS, sequence, record))
        if not taken:
            return
        records = np.array([record for *_, record in taken])
        columns = {name: records[name] for name in self._fields}
        columns["time"] = np.array([moment for moment, *_ in taken])
        columns["sequence"] = np.array([sequence for _, sequence, _ in taken])
        self._story.add_states(columns)
        self._measure_rate(taken[-1][0])

    def _measure_rate(self, moment: float) -> None:
        now = time.monotonic()
        if self._rate_from is None:
            self._rate_from = now, moment
        elif now - self._rate_from[0] > RATE_PERIOD:
            rate = (moment - self._rate_from[1]) / (now - self._rate_from[0])
            self._story.update(rate=round(rate, 2))
            self._rate_from = now, moment

    def _take_statuses(self) -> None:
        for status in _readable(_some(self._statuses), _status_of):
            if status.flight_id != self._shown:
                continue
            row = {
                "time_s": seconds_from_stamp(status.stamp),
                "time_to_go_s": status.time_to_go,
                "cutoff_s": status.cutoff_time,
                "iterations": status.iterations,
            }
            self._story.add_status(
                row,
                status.predicted_position,
                status.predicted_velocity,
                boosts=status.phase == GuidanceStatus.PHASE_BOOST,
            )
            self._story.update(law=LAWS.get(status.law, f"law {status.law}"))

    # ---- commands

    def _control(self, node: str) -> None:
        """Connect to the parameters of the node that reports the pace, while the flight lasts."""
        name = f"{node}/set_parameters"
        try:
            validate_full_topic_name(name, is_service=True)
        except InvalidServiceNameException:
            return
        if self._setter is not None and self._setter.srv_name != name:
            self._forget_setter()
        if self._setter is None and not self._story.ended:
            self._setter = self.create_client(SetParameters, name)
            self._story.set_controllable(True)

    def _forget_setter(self) -> None:
        self._story.set_controllable(False)
        if self._setter is not None:
            self.destroy_client(self._setter)
            self._setter = None

    def _obey(self) -> None:
        while not self._commands.empty():
            name, value, refuse = self._commands.get()
            if self._setter is None or not self._setter.service_is_ready():
                refuse("nobody here obeys: this flight sets its own pace")
                continue
            request = SetParameters.Request(parameters=_wanted(name, value))
            answer = self._setter.call_async(request)
            answer.add_done_callback(lambda done, refuse=refuse: _pass_on(done.result(), refuse))


def _some(waiting: deque[bytes]) -> list[bytes]:
    """Empty a queue; return at most TAKEN of its messages, evenly spread, with first and last."""
    count = len(waiting)
    came = [waiting.popleft() for _ in range(count)]
    if count <= TAKEN:
        return came
    return [came[k] for k in np.linspace(0, count - 1, TAKEN).round().astype(int)]


def _status_of(data: bytes) -> Any:
    return message_of(data, GuidanceStatus)


def _readable(waiting: list[bytes], read: Callable[[bytes], Any]) -> Iterator[Any]:
    """Yield the readable messages; skip the others."""
    for data in waiting:
        with suppress(Unreadable):
            yield read(data)


def _wanted(name: str, value: float) -> list[ParameterMessage]:
    """Return the parameters that a command sets."""
    if name == "pace":
        wanted = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        return [ParameterMessage(name=diagnostics.PACE, value=wanted)]
    wanted = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=name == "pause")
    return [ParameterMessage(name=diagnostics.PAUSED, value=wanted)]


def _pass_on(answer: SetParameters.Response, refuse: Callable[[str], None]) -> None:
    for result in answer.results:
        if not result.successful:
            refuse(result.reason)
