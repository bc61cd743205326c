# SPDX-License-Identifier: Apache-2.0
"""Fly simulator and guidance as started by hand: python -m ares_trials.faults.by_hand.

Neither is given a flight id. A simulator that ends is restarted, as another flight, whose summary
is printed as one JSON object.
"""

import json
import os
import sys

from ares_bringup.crew import Crew, ros_arguments
from ares_bringup.discovery import apply_discovery_settings
from ares_bringup.fly import say_on_standard_error
from ares_bringup.graph import flight_graph
from ares_bringup.inputs import mission_facts
from ares_bringup.keeper import GUIDANCE, SIMULATOR
from ares_bringup.processes import MODULES
from ares_bringup.summary import FlightSummary
from ares_bringup.summary_json import to_json
from ares_node.identity import new_id

MISSION = "ares_v"
NAMESPACE = "/ares"
#: Pace of the first flight, which is interrupted.
PACE = 100.0
LOOK_PERIOD = 0.02


def _start(crew: Crew, name: str, **values: object) -> None:
    crew.start(name, MODULES[name], ros_arguments({"mission": MISSION, **values}, NAMESPACE))


def _watch(crew: Crew, flight_id: int) -> FlightSummary:
    """Watch until the flight or its simulator has ended."""
    summary = FlightSummary(
        mission_facts(MISSION),
        "peg",
        flight_id=flight_id,
        domain_id=int(os.environ["ROS_DOMAIN_ID"]),
    )
    with flight_graph(summary, say_on_standard_error, lambda: True) as (monitor, executor, stop):
        while not (monitor.ended or stop.requested or SIMULATOR not in crew.running()):
            executor.spin_once(timeout_sec=LOOK_PERIOD)
    return summary


def main() -> int:
    """Fly twice."""
    apply_discovery_settings()
    with Crew() as crew:
        _start(crew, GUIDANCE)
        for pace in (PACE, 0.0):
            flight_id = new_id()
            _start(crew, SIMULATOR, flight_id=flight_id, pace=pace, navigation_period_s=1.0)
            summary = _watch(crew, flight_id)
    print(json.dumps(to_json(summary), allow_nan=False))
    return summary.exit_code


if __name__ == "__main__":
    sys.exit(main())
