# SPDX-License-Identifier: Apache-2.0
"""docs/your_node.md: its nodes as printed, with each other and with ours."""

import re
from pathlib import Path

import numpy as np
import pytest

from ares_bringup.verbs.graph import NODES
from ares_guidance.node import GuidanceNode
from ares_models.judge import End, judge
from ares_models.mission import load_mission
from ares_msgs.msg import FlightEvent
from ares_node.membership import Role, State
from ares_vehicle_sim.node import VehicleSimNode

PAGE = (Path(__file__).parent.parent / "docs" / "your_node.md").read_text()


@pytest.fixture(scope="module")
def printed():
    """Return the classes of the page by name."""
    names = {"__name__": "page"}
    for program in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(program, "docs/your_node.md", "exec"), names)
    return names


@pytest.fixture
def mission(tmp_path):
    """Write the page's mission file."""
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path / "kick.yaml"
    path.write_text(text)
    return path


def test_its_commands_name_nodes_and_programs_that_there_are():
    nodes = re.findall(r"^\./ares node (\w+)", PAGE, re.MULTILINE)
    assert nodes == ["sim", "guidance"]
    assert set(nodes) <= set(NODES)
    run = re.findall(r"^\./ares exec python (\S+)", PAGE, re.MULTILINE)
    assert run == re.findall(r"`(\w+\.py)`:\n\n```python", PAGE)


def vehicle(graph, printed, mission):
    """Make the page's simulator as its last line does."""
    start = load_mission(str(mission)).start()
    return graph.add(
        printed["Simulator"](
            "kick", start.time_s, start.position, start.velocity, context=graph.context
        )
    )


def fly(graph):
    """Spin to the end; return the last event."""
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    assert [e.type for e in graph.events].count(FlightEvent.CUTOFF) == 1
    assert [state.sequence for state in graph.states] == list(range(len(graph.states)))
    graph.spin(
        lambda: any(m.role == Role.VEHICLE_SIM and m.state == State.OVER for m in graph.members)
    )
    return graph.events[-1]


def round_speed(event):
    return np.sqrt(3.986004418e14 / np.linalg.norm(event.position))


def test_the_vehicle_of_the_page_is_flown_to_its_target_by_guidance(graph, printed, mission):
    graph.start(GuidanceNode, mission=str(mission))
    vehicle(graph, printed, mission)
    end = fly(graph)
    flown = load_mission(str(mission)).arrays()
    place = flown.environment[0]
    reached = judge(
        end.position, end.velocity, flown.target[0], place["mu"], place["equatorial_radius"]
    )
    assert reached.end is End.TARGET


def test_the_guidance_of_the_page_flies_the_simulator(graph, printed, mission):
    graph.add(printed["Guidance"](context=graph.context))
    graph.start(VehicleSimNode, mission=str(mission))
    end = fly(graph)
    assert np.linalg.norm(end.velocity) == pytest.approx(round_speed(end), abs=0.5)
    assert not graph.reports


def test_both_of_the_page_fly_with_each_other(graph, printed, mission):
    graph.add(printed["Guidance"](context=graph.context))
    vehicle(graph, printed, mission)
    end = fly(graph)
    assert np.linalg.norm(end.velocity) == pytest.approx(round_speed(end), abs=0.5)
    assert 8000.0 < end.mass < 10_000.0
