# SPDX-License-Identifier: Apache-2.0
"""The launch file and its parameters, compared with the nodes. Launch need not be installed."""

import ast
import importlib.util
import os
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from ares_bringup.keeper import KEPT
from ares_bringup.parameter_tables import LAUNCH, offered, tables
from ares_models.mission import MISSION

ROOT = Path(__file__).resolve().parents[1]
BRINGUP = ROOT / "src" / "ares_bringup"
LAUNCH_FILE = BRINGUP / "launch" / "flight.launch.py"
PARAMS_FILE = BRINGUP / "params" / "flight.yaml"

#: Where the executables begin that do not begin in `__main__:main` of their package.
ENTRIES = {
    "judge": "ares_bringup.__main__:judge",
    "view": "ares_view.standard.__main__:main",
    "live": "ares_view.live.__main__:main",
}
#: What every rclpy node has besides its own table.
EVERY_NODE = {"use_sim_time"}


# ---- the launch file, with stand-ins for launch


class Recorded:
    """Stand in for an action or substitution; record its arguments."""

    def __init__(self, *args, **kwargs):
        self.args = args
        self.kwargs = kwargs


class LaunchConfiguration(Recorded):
    def perform(self, context):
        return context.launch_configurations[self.args[0]]


def fake_modules():
    names = {
        "ament_index_python": [],
        "ament_index_python.packages": ["get_package_share_directory"],
        "launch": ["LaunchContext", "LaunchDescription"],
        "launch.actions": [
            "DeclareLaunchArgument",
            "EmitEvent",
            "GroupAction",
            "LogInfo",
            "OpaqueFunction",
            "RegisterEventHandler",
        ],
        "launch.event_handlers": ["OnProcessExit", "OnProcessStart", "OnShutdown"],
        "launch.events": ["matches_action"],
        "launch.events.process": ["ShutdownProcess", "SignalProcess"],
        "launch.substitutions": [],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
    }
    modules = {}
    for name, members in names.items():
        module = ModuleType(name)
        for member in members:
            setattr(module, member, type(member, (Recorded,), {}))
        modules[name] = module
    modules["launch.substitutions"].LaunchConfiguration = LaunchConfiguration
    modules["ament_index_python.packages"].get_package_share_directory = lambda _: str(BRINGUP)
    return modules


@pytest.fixture
def description(monkeypatch, tmp_path):
    monkeypatch.setenv("ARES_BAGS", str(tmp_path))
    monkeypatch.setenv("ROS_DOMAIN_ID", "3")
    for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"):
        monkeypatch.delenv(name, raising=False)
    for name, module in fake_modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    [group] = runpy.run_path(str(LAUNCH_FILE))["generate_launch_description"]().args[0]
    # in a scope of its own
    assert type(group).__name__ == "GroupAction"
    assert group.kwargs.get("scoped", True)
    return group.args[0]


def declared(description):
    return {item.args[0]: item.kwargs for item in description if "description" in item.kwargs}


def actions(description, **given):
    """Return the actions of the launch with these arguments."""
    values = {name: item["default_value"] for name, item in declared(description).items()}
    assert set(given) <= {*values, "ros_namespace"}
    function = next(item for item in description if type(item).__name__ == "OpaqueFunction")
    return function.kwargs["function"](SimpleNamespace(launch_configurations=values | given))


def launched(description, **given):
    """Return the nodes by name, as they would be started with these arguments."""
    return {
        item.kwargs["name"]: item.kwargs
        for item in actions(description, **given)
        if type(item).__name__ == "Node"
    }


def environment(node):
    return node["additional_env"]


def overrides(node):
    return node["parameters"][1]


def test_every_argument_is_described_and_has_a_default(description):
    arguments = declared(description)
    assert set(arguments) == {*(row.name for row in LAUNCH), *offered()}
    for item in arguments.values():
        assert isinstance(item["default_value"], str)
        assert item["default_value"] in (item["choices"] or [item["default_value"]])
    assert Path(arguments["params_file"]["default_value"]) == PARAMS_FILE


def test_the_nodes_exist_and_know_what_they_are_given(description):
    nodes = launched(
        description,
        mission="delta_iii",
        guidance="peg",
        initial_guess="optimizer",
        pace="2",
        seed="3",
        dispersions="standard",
        bag="/some/bag",
        live="true",
    )
    assert set(nodes) == set(tables())
    for name, node in nodes.items():
        setup = (ROOT / "src" / node["package"] / "setup.py").read_text()
        entry = ENTRIES.get(name, f"{node['package']}.__main__:main")
        assert f'"{node["executable"]} = {entry}"' in setup
        rows = {row.name: row for row in tables()[name]}
        for key, value in overrides(node).items():
            if key not in EVERY_NODE:
                assert rows[key].checked(value) == value
    assert overrides(nodes["vehicle_sim"])["pace"] == 2.0
    # the judge ends the launch, not the simulator
    assert overrides(nodes["vehicle_sim"])["exit_when_complete"] is False
    flights = {overrides(nodes[name]).get("flight_id", 0) for name in nodes if name != "optimizer"}
    assert len(flights) == 1
    assert flights.pop() > 0
    assert overrides(nodes["guidance"])["law"] == "peg"
    assert overrides(nodes["recorder"])["bag"] == "/some/bag"
    assert overrides(nodes["recorder"])["seed"] == 3


def test_what_is_not_given_is_left_to_the_parameter_file(description, tmp_path):
    nodes = launched(description)
    members = {"flight_id", "expected_recorders"}
    assert set(overrides(nodes["vehicle_sim"])) == {
        *members,
        "expected_judges",
        "exit_when_complete",
    }
    assert set(overrides(nodes["guidance"])) == {"flight_id", "use_sim_time"}
    assert "optimizer" not in nodes
    recorder = overrides(nodes["recorder"])
    assert recorder["mission"] == overrides(nodes["judge"])["mission"] == "ares_v"
    assert recorder["law"] == "peg"
    assert recorder["bag"] == overrides(nodes["judge"])["bag"]
    assert Path(recorder["bag"]).parent == tmp_path
    assert Path(recorder["bag"]).name.startswith("ares_v_")


@pytest.mark.parametrize(("record", "recorders"), [("true", 1), ("false", 0)])
def test_the_flight_waits_for_the_recorder_if_there_is_one(description, record, recorders):
    nodes = launched(description, record=record)
    assert ("recorder" in nodes) == bool(recorders)
    for name in ("vehicle_sim", "judge"):
        assert overrides(nodes[name])["expected_recorders"] == recorders
    assert overrides(nodes["vehicle_sim"])["expected_judges"] == 1


def test_the_simulator_owns_the_clock(description):
    nodes = launched(description, use_sim_time="true")
    assert "use_sim_time" not in overrides(nodes["vehicle_sim"])
    assert overrides(nodes["guidance"])["use_sim_time"] is True
    assert overrides(nodes["recorder"])["use_sim_time"] is True


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"pace": "fast"}, "parameter pace is 'fast'; expected a number from 0 to 1e+06"),
        ({"pace": "-1"}, "parameter pace is -1.0; expected a number from 0 to 1e+06"),
        ({"seed": "1.5"}, "parameter seed is '1.5'; expected an integer from 0 to 9.22337e+18"),
        ({"restarts": "101"}, "parameter restarts is 101; expected an integer from 0 to 100"),
        ({"domain_id": "233"}, "domain id is '233'; expected an integer from 0 to 232"),
        ({"params_file": "/none"}, "params_file: [Errno 2] No such file or directory: '/none'"),
    ],
)
def test_wrong_input_starts_nothing(description, capsys, given, complaint):
    # and ends nothing else: another launch file may have included this one
    assert actions(description, **given) == []
    assert capsys.readouterr().err == f"ares: {complaint}\n"


def test_a_mission_without_a_plan_starts_nothing(description, capsys, tmp_path):
    weak = tmp_path / "weak.yaml"
    text = MISSION.find("falcon9_gto").read_text()
    weak.write_text(text.replace("thrust_n: 981000.0", "thrust_n: 98100.0"))
    assert actions(description, mission=str(weak)) == []
    said = capsys.readouterr().err
    assert said.startswith("ares: no plan was found: ")
    assert "law peg needs one for what the mission leaves free, " in said


def test_a_flight_has_a_domain_of_its_own(description, monkeypatch):
    def domain(**given):
        [found] = {
            environment(node)["ROS_DOMAIN_ID"] for node in launched(description, **given).values()
        }
        return int(found)

    assert domain() == 3
    assert domain(domain_id="7") == 7
    monkeypatch.delenv("ROS_DOMAIN_ID")
    # each holds its domain as long as the process lives
    assert domain() != domain()
    # flights of different namespaces share one; nobody else has these
    east, west = (f"{side}_{os.getpid()}" for side in ("east", "west"))
    assert domain(namespace=east) == domain(namespace=west)


def test_what_is_set_for_the_nodes_is_set_for_them_alone(description):
    before = dict(os.environ)
    for node in launched(description).values():
        assert environment(node)["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
        assert Path(environment(node)["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()
        assert environment(node)["ARES_LAUNCHER_PID"] == str(os.getpid())
    assert dict(os.environ) == before


def test_nodes_that_take_a_flight_up_again_are_started_again_by_launch(description):
    nodes = launched(description, restarts="2", initial_guess="optimizer")
    kept = {name: node["respawn_max_retries"] for name, node in nodes.items() if "respawn" in node}
    assert kept == dict.fromkeys(KEPT, 2)


def test_a_flight_beside_others_has_names_of_its_own(description):
    shared = launched(description)
    assert {node["namespace"] for node in shared.values()} == {"/ares"}
    assert not any(node["remappings"] for node in shared.values())
    assert overrides(shared["view"])["frame_prefix"] == ""
    own = launched(description, namespace="east")
    for node in own.values():
        assert dict(node["remappings"])["/clock"] == "clock"
        assert node["namespace"] == "/east"
    assert overrides(own["view"])["frame_prefix"] == "east/"
    pushed = launched(description, ros_namespace="/range", namespace="east")
    assert {node["namespace"] for node in pushed.values()} == {"/range/east"}
    assert overrides(pushed["view"])["frame_prefix"] == "range/east/"


# ---- the launch file and launch itself


def test_the_stand_ins_are_all_that_the_launch_file_needs():
    """Check the stand-ins; if launch is installed, it loads the file."""
    imported = {
        (node.module, alias.name)
        for node in ast.walk(ast.parse(LAUNCH_FILE.read_text()))
        if isinstance(node, ast.ImportFrom)
        and node.module.split(".")[0] in ("launch", "launch_ros")
        for alias in node.names
    }
    fakes = fake_modules()
    assert all(hasattr(fakes[module], name) for module, name in imported)
    if importlib.util.find_spec("launch") and importlib.util.find_spec("launch_ros"):
        for module, name in imported:
            assert hasattr(importlib.import_module(module), name)
        assert runpy.run_path(str(LAUNCH_FILE))["generate_launch_description"]
