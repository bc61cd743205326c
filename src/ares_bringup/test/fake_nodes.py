# SPDX-License-Identifier: Apache-2.0
"""Stand-ins for the nodes of a flight, without physics, to test the process layout.

    python -m fake_nodes NAME --ros-args ...    with NAME vehicle_sim, guidance or recorder

$FAKE_<NAME> sets the node's behaviour:
    refuse   cannot be configured
    crash    raises in flight
    hang     ignores SIGTERM
    kill     kills itself with SIGKILL in flight
    exit1    ends with status 1 in flight
    slow     (simulator) never ends the flight
    coast    (simulator) coasts in the middle, where it says nothing but its flight time
    stand    (simulator) the same, but its flight time stands
    quiet    (guidance) says nothing from the middle on
    miss     (simulator) ends far from the target

The simulator ends the flight only after the others have reached their faults, however slow the
machine: each writes its process id to a file of its name in $FAKE_MARKS; one that kills
or ends itself must be dead as well.
"""

import math
import os
import signal
from pathlib import Path
from typing import Any

from ares_msgs.msg import FlightEvent, GuidanceStatus
from ares_node.diagnostics import FLIGHT_TIME_S, Timing, pace_message
from ares_node.membership import FLIGHT_ID
from ares_node.node import FlightNode, NodeError
from ares_node.parameters import Parameter
from ares_node.qos import DIAGNOSTIC, EVENTS, FLIGHT, FLIGHT_EVENT, GUIDANCE_STATUS, TIMING
from ares_node.run import run_node
from ares_node.time import stamp_from_seconds

#: Behaviours that end a node.
ENDINGS = ("kill", "exit1")
RADIUS = 6.6e6
SPEED = 7700.0
#: Steps of 0.02 s of the flight: it begins, faults happen, it ends.
BEGIN, FAULT, END = 1, 30, 60
#: Length of the coast, in steps.
COAST = 250
#: Readers of flight_event when all are there: monitor, guidance and recorder.
READERS = 3

TABLES = {
    "vehicle_sim": {
        "mission": "",
        "pace": 0.0,
        "seed": 0,
        "flight": 0,
        "dispersions": "",
        "navigation_period_s": 0.1,
        "integration_step_s": 0.1,
        "attitude_rate_limit_deg_s": 0.0,
        "start_timeout_s": 30.0,
        "expected_recorders": 0,
        "expected_judges": 0,
    },
    "guidance": {
        "mission": "",
        "law": "",
        "initial_guess": "",
        "cycle_period_s": 1.0,
        "hold_time_s": 5.0,
        "heating_source": "",
    },
    "recorder": {"bag": "", "mission": "", "law": "", "seed": 0},
}


class FakeNode(FlightNode):
    """Count time and fail as set."""

    def __init__(self, name: str, **kwargs: Any) -> None:
        table = [Parameter(key, value, "") for key, value in TABLES[name].items()]
        table.append(FLIGHT_ID)
        super().__init__(name, parameters=table, **kwargs)
        self.role = name
        self.behaviour = os.environ.get(f"FAKE_{name.upper()}", "")
        self.step = self.coasted = 0

    def configure(self) -> None:
        if self.behaviour == "refuse":
            raise NodeError("refused, as it was told")
        self.flying = False
        if self.role == "vehicle_sim":
            self.out = self.create_publisher(FlightEvent, FLIGHT_EVENT, EVENTS)
            self.timing_out = self.create_publisher(Timing, TIMING, DIAGNOSTIC)
        else:
            self.create_subscription(FlightEvent, FLIGHT_EVENT, self.on_event, EVENTS)
        if self.role == "guidance":
            self.out = self.create_publisher(GuidanceStatus, GUIDANCE_STATUS, FLIGHT)
        if self.role == "recorder":
            Path(self.values["bag"]).mkdir()
        self.create_timer(0.02, self.tick)

    def on_event(self, message: FlightEvent) -> None:
        self.flying = True

    def tick(self) -> None:
        if self.role == "vehicle_sim" and self.out.get_subscription_count() >= READERS:
            self.flying = True
        heard = self.role != "guidance" or self.out.get_subscription_count() > 0
        if not self.flying or not heard:
            return
        if (
            self.role == "vehicle_sim"
            and self.step == END - 1
            and not others_came_to_their_faults()
        ):
            return
        if self.step == FAULT and self.coasted < COAST and self.behaviour in ("coast", "stand"):
            self.coast()
            return
        self.step += 1
        if self.step == FAULT:
            (marks() / self.role).write_text(str(os.getpid()))
            if self.behaviour == "crash":
                raise RuntimeError("crashed, as it was told")
            if self.behaviour == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            if self.behaviour == "exit1":
                self.finish(1)
            if self.behaviour == "hang":
                for number in (signal.SIGTERM, signal.SIGINT):
                    signal.signal(number, signal.SIG_IGN)
        if self.role == "vehicle_sim":
            self.fly()
        elif self.role == "guidance" and not (self.behaviour == "quiet" and self.step > FAULT):
            self.guide()

    def fly(self) -> None:
        if self.step == BEGIN:
            self.event(FlightEvent.FLIGHT_STARTED, 0)
        elif self.step == FAULT:
            self.event(FlightEvent.JETTISON, 0)
        elif self.step == END and self.behaviour != "slow":
            self.event(FlightEvent.CUTOFF, 0)
            self.event(FlightEvent.FLIGHT_COMPLETE, 0)

    def coast(self) -> None:
        self.coasted += self.behaviour == "coast"
        facts = {FLIGHT_TIME_S: self.step + self.coasted}
        self.timing_out.publish(pace_message(self, self.values["flight_id"], 0.0, False, facts))

    def event(self, kind: int, index: int) -> None:
        speed = SPEED + (10.0 if self.behaviour == "miss" else 0.0)
        inclination = math.radians(28.5)
        self.out.publish(
            FlightEvent(
                flight_id=self.values["flight_id"],
                stamp=stamp_from_seconds(float(self.step)),
                time=float(self.step),
                type=kind,
                index=index,
                position=[RADIUS, 0.0, 0.0],
                velocity=[0.0, speed * math.cos(inclination), speed * math.sin(inclination)],
                mass=1000.0 - self.step,
            )
        )

    def guide(self) -> None:
        inclination = math.radians(28.5)
        self.out.publish(
            GuidanceStatus(
                flight_id=self.values["flight_id"],
                stamp=stamp_from_seconds(float(self.step)),
                cycle=self.step,
                law=GuidanceStatus.LAW_PEG,
                converged=self.step > 2,
                total_iterations=10 * self.step,
                cutoff_time=float(END),
                predicted_position=[RADIUS, 0.0, 0.0],
                predicted_velocity=[
                    0.0,
                    SPEED * math.cos(inclination),
                    SPEED * math.sin(inclination),
                ],
            )
        )


def marks() -> Path:
    """Return the folder of the nodes' files."""
    return Path(os.environ["FAKE_MARKS"])


def others_came_to_their_faults() -> bool:
    """Tell whether guidance and recorder have reached their faults."""
    return all(
        is_dead(name) if os.environ.get(f"FAKE_{name.upper()}") in ENDINGS else mark(name)
        for name in ("guidance", "recorder")
    )


def mark(name: str) -> str:
    """Return the process id that a node wrote at its fault; "" before."""
    path = marks() / name
    return path.read_text() if path.exists() else ""


def is_dead(name: str) -> bool:
    """Tell whether a node has ended itself, even if its parent has not yet reaped it."""
    if not (pid := mark(name)):
        return False
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
        threads = list(Path(f"/proc/{pid}/task").iterdir())
    except OSError:
        return True
    # the parent is notified when the last thread has ended
    return status.rpartition(")")[2].split()[0] == "Z" and len(threads) == 1


def main(name: str) -> int:
    """Run the node as a process."""
    return run_node(lambda **kwargs: FakeNode(name, **kwargs), name=name)
