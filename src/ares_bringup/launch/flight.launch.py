"""One flight under `ros2 launch`: simulator, guidance and recorder, each a process.

    ros2 launch ares_bringup flight.launch.py mission:=ares_v pace:=1.0

An argument that is left empty leaves its parameter to the parameter file. The launch ends
when the simulator does.
"""

from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
    TimerAction,
)
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from ares_bringup.bag_paths import new_bag
from ares_bringup.discovery import discovery_settings
from ares_bringup.params_file import node_values

SWITCH = ["true", "false"]
LEVELS = ["debug", "info", "warn", "error", "fatal"]

#: Exit status of a node that could not start.
CANNOT_START = 2

#: Wall time in s after which the others can end without a traceback: they are up by then.
GRACE = 3.0

#: Wall time in s for the recorder to close its bag before it gets SIGTERM.
RECORDER_STOP_TIMEOUT = "30"


def arguments() -> list[DeclareLaunchArgument]:
    params = Path(get_package_share_directory("ares_bringup")) / "params" / "flight.yaml"
    return [
        DeclareLaunchArgument(
            "namespace", default_value="ares", description="Namespace of all nodes and topics."
        ),
        DeclareLaunchArgument(
            "params_file",
            default_value=str(params),
            description="Parameter file of the three nodes.",
        ),
        DeclareLaunchArgument(
            "use_sim_time",
            default_value="false",
            choices=SWITCH,
            description="Guidance and recorder stamp their log lines with flight time. "
            "Nothing else depends on it: the flight runs on the stamps of its messages.",
        ),
        DeclareLaunchArgument(
            "mission",
            default_value="",
            description="Shipped mission's name, or absolute path of a mission file.",
        ),
        DeclareLaunchArgument("guidance", default_value="", description="Guidance law."),
        DeclareLaunchArgument(
            "initial_guess",
            default_value="",
            description="Where guidance starts: none, or optimizer or analytic, which start the "
            "optimizer too and ask it.",
        ),
        DeclareLaunchArgument(
            "pace",
            default_value="",
            description="Real-time factor; 0 flies as fast as guidance answers.",
        ),
        DeclareLaunchArgument(
            "seed", default_value="", description="Seed of dispersions and navigation errors."
        ),
        DeclareLaunchArgument(
            "dispersions",
            default_value="",
            description="Shipped dispersions' name, or absolute path of a file.",
        ),
        DeclareLaunchArgument(
            "record", default_value="true", choices=SWITCH, description="Record a bag."
        ),
        DeclareLaunchArgument(
            "bag",
            default_value="",
            description="Folder of the new bag; empty takes a new name in the folder of bags "
            "($ARES_BAGS, or `bags` of the workspace).",
        ),
        DeclareLaunchArgument(
            "exit_when_complete",
            default_value="true",
            choices=SWITCH,
            description="End everything when the flight is over.",
        ),
        DeclareLaunchArgument(
            "log_level", default_value="info", choices=LEVELS, description="Log level of all nodes."
        ),
    ]


def end_if_not_started(event: ProcessExited, _context: LaunchContext) -> list[Any]:
    """A node that could not start ends the launch; one lost in flight does not."""
    if event.returncode == CANNOT_START:
        end = Shutdown(reason=f"{event.process_name} could not start")
        return [TimerAction(period=GRACE, actions=[end])]
    return []


def nodes(context: LaunchContext) -> list[Any]:
    given = {
        name: LaunchConfiguration(name).perform(context)
        for name in ("mission", "guidance", "initial_guess")
        + ("pace", "seed", "dispersions", "bag")
    }
    switches = {
        name: LaunchConfiguration(name).perform(context) == "true"
        for name in ("use_sim_time", "record", "exit_when_complete")
    }
    values: dict[str, Any] = {name: text for name, text in given.items() if text}
    try:
        if given["pace"]:
            values["pace"] = float(given["pace"])
        if given["seed"]:
            values["seed"] = int(given["seed"])
    except ValueError as error:
        raise RuntimeError(f"pace and seed: expected numbers; {error}") from error
    if "guidance" in values:
        values["law"] = values.pop("guidance")
    params_file = LaunchConfiguration("params_file").perform(context)
    flown = {**node_values(params_file, "guidance"), **node_values(params_file, "vehicle_sim")}
    flown |= values
    recorders = {"expected_recorders": int(switches["record"])}

    def node(package: str, name: str, taken: tuple[str, ...], **more: Any) -> dict[str, Any]:
        overrides = {key: values[key] for key in taken if key in values}
        return {
            "package": package,
            "executable": name,
            "name": name,
            "namespace": LaunchConfiguration("namespace"),
            "parameters": [LaunchConfiguration("params_file"), {**overrides, **more}],
            "arguments": ["--ros-args", "--log-level", LaunchConfiguration("log_level")],
            "output": "screen",
        }

    clock = {"use_sim_time": switches["use_sim_time"]}
    started: list[Any] = [
        Node(
            **node(
                "ares_vehicle_sim",
                "vehicle_sim",
                ("mission", "pace", "seed", "dispersions"),
                exit_when_complete=switches["exit_when_complete"],
                **recorders,
            ),
            on_exit=Shutdown(reason="the simulator has ended"),
        ),
        Node(
            **node(
                "ares_guidance",
                "guidance",
                ("mission", "law", "initial_guess"),
                **recorders,
                **clock,
            ),
            on_exit=end_if_not_started,
        ),
    ]
    if flown.get("initial_guess", "none") != "none" or flown.get("law") == "peg_thesis":
        started.append(Node(**node("ares_optimizer", "optimizer", ("mission",), **clock)))
    if switches["record"]:
        bag = values.get("bag") or str(new_bag(Path(str(flown.get("mission", "flight"))).stem))
        about = {name: flown[name] for name in ("mission", "law", "seed") if name in flown}
        started += [
            LogInfo(msg=f"recording to {bag}"),
            Node(
                **node("ares_bags", "recorder", (), bag=bag, **about, **clock),
                on_exit=end_if_not_started,
                sigterm_timeout=RECORDER_STOP_TIMEOUT,
            ),
        ]
    return started


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            *arguments(),
            *(SetEnvironmentVariable(*item) for item in discovery_settings().items()),
            OpaqueFunction(function=nodes),
        ]
    )
