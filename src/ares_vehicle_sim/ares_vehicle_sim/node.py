# SPDX-License-Identifier: Apache-2.0
"""Vehicle simulator node: own /clock and fly in lock-step with guidance."""

import json
import math
import re
import time
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import Executor
from rclpy.parameter import Parameter as RosParameter

from ares_models.failures import read_failure
from ares_models.mission import MISSION_TEXT, Mission, read_mission
from ares_models.passage import Passage
from ares_models.plans import flies_in_air
from ares_models.software import software
from ares_node.diagnostics import Level
from ares_node.identity import MISSION_DIGEST, new_id
from ares_node.membership import FLIGHT_ID, Membership, Role
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import MISSION, Parameter
from ares_node.time import NANOSECONDS
from ares_vehicle_sim.dispersions import Dispersions, read_dispersions
from ares_vehicle_sim.lock_step import LockStep
from ares_vehicle_sim.members import OtherMembers
from ares_vehicle_sim.pace import why_no_pace
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions

#: Timeout for acknowledgement of the last messages, wall time, s. A killed reader never
#: acknowledges, and `ares fly` waits 10 s, launch 5 s, for the end of this process.
ACKNOWLEDGE_TIMEOUT = 3.0
#: Least flight time between reports that differ only in numbers, s.
REPORT_PERIOD = 10.0

PARAMETERS = (
    MISSION,
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


def _check_pace(parameters: list[RosParameter]) -> SetParametersResult:
    paces = [x.value for x in parameters if x.name == "pace" and isinstance(x.value, float)]
    reason = next(filter(None, map(why_no_pace, paces)), "")
    return SetParametersResult(successful=not reason, reason=reason)


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
        if reason := why_no_pace(values["pace"]):
            raise NodeError(reason)
        mission, flown, texts = self._read_flight()
        with ExitStack() as failed:
            self._membership = Membership(
                self, Role.VEHICLE_SIM, mission.name, values["flight_id"] or new_id()
            )
            failed.callback(self._membership.close)
            about = {"software": software(), MISSION_DIGEST: mission.digest}
            settings = {row.name: values[row.name] for row in PARAMETERS if row is not FLIGHT_ID}
            self._membership.announce_settings(json.dumps(about | settings | texts))
            # compile the plant now, by one step of a private flight
            rehearsal = Simulator(*flown)
            rehearsal.advance()
            rehearsal.truth()
            self._simulator = Simulator(*flown)
            failed.pop_all()
        passage = Passage() if flies_in_air(mission.arrays().arcs) else None
        self._last_report: dict[str, int] = {}
        self._flight = LockStep(self, self._membership, self._simulator, passage, self._report)
        self._members = OtherMembers(self, self._membership, self._flight)
        self._membership.listen(self._members.hear)

    def _read_flight(self) -> tuple[Mission, tuple[Any, ...], dict[str, str]]:
        """Return the mission, the arguments of its simulator, and the texts of the files."""
        values = self.values
        dispersions, texts = Dispersions(), {}
        mission, texts[MISSION_TEXT] = read_mission(values["mission"])
        if values["dispersions"]:
            dispersions, texts["dispersions_text"] = read_dispersions(
                values["dispersions"], mission
            )
        options = SimulatorOptions(
            navigation_period_s=values["navigation_period_s"],
            integration_step_s=values["integration_step_s"],
            attitude_rate_limit_rad_s=math.radians(values["attitude_rate_limit_deg_s"]) or math.inf,
        )
        failure = read_failure(values["failure"]) if values["failure"] else None
        flown = (mission, options, dispersions, values["seed"], values["flight"], failure)
        return mission, flown, texts

    def activate(self) -> None:
        """Wait for the other nodes, then fly."""
        if self._flight.flying or self.simulator.complete:
            over = "is over" if self.simulator.complete else "was stopped and cannot go on"
            raise NodeError(
                f"the flight {over}, at {self.simulator.time_ns / NANOSECONDS:.9g} s; clean up and "
                "configure for a new one"
            )
        self._members.activate()
        self._flight.watch()

    def deactivate(self) -> None:
        """Stop; a flight that has begun cannot be resumed."""
        self._flight.stop()

    def cleanup(self) -> None:
        """Free the endpoints and the flight."""
        self._flight.close()
        self._membership.close()
        self._simulator = None

    def adjust(self) -> None:
        """Continue at the new pace from now on, without catching up."""
        self._flight.change_pace()

    def drain(self, executor: Executor) -> None:
        """Wait until the others have received the last messages."""
        if self._simulator is not None:
            deadline = time.monotonic() + ACKNOWLEDGE_TIMEOUT
            self._flight.messages.wait_until_heard(deadline)
            self._membership.wait_until_heard(max(0.0, deadline - time.monotonic()))

    @property
    def simulator(self) -> Simulator:
        """Return the flight, which exists from `configure` to `cleanup`."""
        if self._simulator is None:
            raise NodeError("not configured")
        return self._simulator

    def _report(
        self, level: Level, message: str, values: Mapping[str, object] | None = None
    ) -> None:
        kind = re.split(r"\d", message, maxsplit=1)[0]
        now = self.simulator.time_ns
        last = self._last_report.get(kind)
        if last is None or now - last >= REPORT_PERIOD * NANOSECONDS:
            self._last_report[kind] = now
            self.diagnostics.report(level, message, now, values)
