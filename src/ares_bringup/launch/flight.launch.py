# SPDX-License-Identifier: Apache-2.0
"""Launch one flight with `ros2 launch`: simulator, guidance, recorder and judge, a process each.

    ros2 launch ares_bringup flight.launch.py mission:=ares_v pace:=1.0

An empty argument leaves its parameter to the parameter file. When the judge has given its verdict,
the processes of the flight end. The launch ends with them, with the exit status of `ares fly`,
unless another launch file has included this one: its own processes continue then.
"""

import os
import signal
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    GroupAction,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessExit, OnProcessStart, OnShutdown
from launch.events import matches_action
from launch.events.process import ShutdownProcess, SignalProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from ares_bringup.audience import LIVE
from ares_bringup.bag_paths import new_bag
from ares_bringup.discovery import check_protection, discovery_settings
from ares_bringup.fly import (
    absolute_namespace,
    check_inputs,
    needs_plan,
    needs_trajectory,
)
from ares_bringup.keeper import (
    GUIDANCE,
    JUDGE,
    KEPT,
    OPTIMIZER,
    RECORDER,
    SIMULATOR,
    VIEW,
    Keeper,
)
from ares_bringup.launch_verdict import LaunchVerdict, end_launch_with, is_launched_itself
from ares_bringup.options import (
    MAX_RESTARTS,
    PEG,
    RESTARTS,
    CannotStart,
    FlyOptions,
    domain_id,
)
from ares_bringup.params_file import node_values
from ares_bringup.rehearsal import rehearse
from ares_node.domains import claim_domain
from ares_node.identity import id_text, new_id
from ares_node.names import own_frames, own_names
from ares_node.parent import LAUNCHER

SWITCH = ["true", "false"]
LEVELS = ["debug", "info", "warn", "error", "fatal"]

#: Default ROS domain; a flight uses it if no other flight does.
DEFAULT_DOMAIN = 0

#: Wall time in s before a restart, in which the judge can end a flight that had not begun.
RESTART_DELAY = 1.0

#: Wall time in s for a node to end, and the recorder to close its bag, before it gets SIGTERM
#: again; long enough for a busy machine.
STOP_TIMEOUT = "20"


def arguments() -> list[DeclareLaunchArgument]:
    params = Path(get_package_share_directory("ares_bringup")) / "params" / "flight.yaml"
    return [
        DeclareLaunchArgument(
            "namespace", default_value="ares", description="Namespace of all nodes and topics."
        ),
        DeclareLaunchArgument(
            "domain_id",
            default_value="",
            description="ROS domain; empty takes $ROS_DOMAIN_ID, else 0 if no other flight has "
            "this namespace there, else one that is free.",
        ),
        DeclareLaunchArgument(
            "params_file",
            default_value=str(params),
            description="Parameter file of the nodes.",
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
            "failure",
            default_value="",
            description="What fails in flight: KIND:KEY=VALUE,...; empty for nothing.",
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
            "view",
            default_value="true",
            choices=SWITCH,
            description="Show the flight in standard messages too, for RViz and maps.",
        ),
        DeclareLaunchArgument(
            "live",
            default_value="false",
            choices=SWITCH,
            description="Serve a page that follows the flight; its address is printed.",
        ),
        DeclareLaunchArgument(
            "foxglove_port",
            default_value="",
            description="Port of this machine where Foxglove and Lichtblick get what view shows; "
            "0: none.",
        ),
        DeclareLaunchArgument(
            "restarts",
            default_value=str(RESTARTS),
            description="How often guidance, optimizer and view are each restarted if they end in "
            "flight.",
        ),
        DeclareLaunchArgument(
            "exit_when_complete",
            default_value="true",
            choices=SWITCH,
            description="End the processes of the flight when it is over.",
        ),
        DeclareLaunchArgument(
            "log_level", default_value="info", choices=LEVELS, description="Log level of all nodes."
        ),
    ]


class Flight:
    """Build the launch actions of a flight and react to the ends of its processes."""

    def __init__(self, context: LaunchContext) -> None:
        self.given = {
            name: LaunchConfiguration(name).perform(context)
            for name in ("mission", "guidance", "initial_guess", "pace", "seed", "dispersions")
            + ("failure", "foxglove_port", "bag", "namespace", "domain_id", "params_file")
            + ("log_level", "restarts")
        }
        self.switches = {
            name: LaunchConfiguration(name).perform(context) == "true"
            for name in ("use_sim_time", "record", "view", "live", "exit_when_complete")
        }
        #: Namespace pushed by the file that includes this one.
        self.pushed_namespace = context.launch_configurations.get("ros_namespace", "")
        self.verdict = LaunchVerdict(self.switches["exit_when_complete"])
        self.nodes: dict[str, Node] = {}

    def start(self) -> list[Any]:
        """Return the actions that start the flight.

        Raises:
            CannotStart: an argument is invalid; one line.
        """
        check_protection()
        values = self._values()
        files = self.given["params_file"]
        try:
            flown = {**node_values(files, GUIDANCE), **node_values(files, SIMULATOR), **values}
        except (OSError, ValueError) as error:
            raise CannotStart(f"params_file: {error}") from error
        record = self.switches["record"]
        mission = str(flown.get("mission", "ares_v"))
        bag = values.get("bag") or str(new_bag(Path(mission).stem)) if record else ""
        self.namespace = self._namespace()
        check_inputs(flown, bag)
        expected = rehearse(flown)
        self.restarts = self._restarts()
        self.verdict.keeper = Keeper(self.restarts)
        self.environment = {
            **discovery_settings(),
            "ROS_DOMAIN_ID": str(self._domain()),
            LAUNCHER: str(os.getpid()),
        }
        identity = {"flight_id": new_id()}
        about = {name: flown[name] for name in ("mission", "law") if name in flown}
        self._add(
            "ares_vehicle_sim",
            SIMULATOR,
            _of(values, "mission", "pace", "seed", "dispersions", "failure"),
            **identity,
            exit_when_complete=False,
            expected_recorders=int(record),
            expected_judges=1,
        )
        self._add(
            "ares_guidance",
            GUIDANCE,
            _of(values, "mission", "law", "initial_guess"),
            **identity,
            **self._clock(),
        )
        self._add(
            "ares_bringup",
            JUDGE,
            about,
            **identity,
            bag=bag,
            pace=float(flown.get("pace", 0.0)),
            expected_recorders=int(record),
        )
        law = str(flown.get("law", PEG))
        if (
            flown.get("initial_guess", "none") != "none"
            or needs_trajectory(law)
            or needs_plan(str(flown.get("mission", "ares_v")))
        ):
            self._add("ares_optimizer", OPTIMIZER, _of(values, "mission"), **self._clock())
        if self.switches["view"]:
            self._add(
                "ares_view",
                VIEW,
                _of(values, "mission", "foxglove_port"),
                **identity,
                frame_prefix=own_frames(self.namespace),
                **self._clock(),
            )
        if self.switches["live"]:
            self._add("ares_view", LIVE, _of(values, "mission"), **identity, bag=bag)
        if record:
            about |= {"seed": flown["seed"]} if "seed" in flown else {}
            self._add("ares_bags", RECORDER, about, **identity, bag=bag, **self._clock())
        self.verdict.start(self.nodes)
        self.name = f"flight {id_text(identity['flight_id'])}"
        where = f"ROS_DOMAIN_ID={self.environment['ROS_DOMAIN_ID']} ros2 topic list"
        return [
            LogInfo(msg=f"{self.name}: {where}, namespace {self.namespace}"),
            *([LogInfo(msg=f"recording to {bag}")] if bag else []),
            *([LogInfo(msg=expected)] if expected else []),
            *self._handlers(),
            *self.nodes.values(),
        ]

    def _values(self) -> dict[str, Any]:
        """Return the command-line arguments by parameter name."""
        names = {"guidance": "law"}
        values: dict[str, Any] = {
            names.get(name, name): self.given[name]
            for name in ("mission", "guidance", "initial_guess", "dispersions", "failure", "bag")
            if self.given[name]
        }
        kinds = {"pace": ("a number", float), "seed": ("an integer", int)}
        kinds["foxglove_port"] = kinds["seed"]
        for name, (expected, kind) in kinds.items():
            if self.given[name]:
                try:
                    values[name] = kind(self.given[name])
                except ValueError as error:
                    text = f"{name} is {self.given[name]!r}; expected {expected}"
                    raise CannotStart(text) from error
        return values

    def _namespace(self) -> str:
        """Return the namespace of all nodes, below a pushed one, as in launch_ros."""
        given = self.given["namespace"]
        if not given.startswith("/") and self.pushed_namespace:
            given = f"{self.pushed_namespace.rstrip('/')}/{given}"
        return absolute_namespace(given)

    def _restarts(self) -> int:
        text = self.given["restarts"]
        if not (text.isascii() and text.isdigit() and int(text) <= MAX_RESTARTS):
            raise CannotStart(f"restarts is {text!r}; expected an integer from 0 to {MAX_RESTARTS}")
        return int(text)

    def _domain(self) -> int:
        text = self.given["domain_id"]
        options = FlyOptions()
        if text:
            options = replace(options, domain_id=int(text) if text.isdigit() else -1)
        domain = domain_id(options)
        if domain is None:
            # claimed until this process ends
            domain, _ = claim_domain(preferred=[DEFAULT_DOMAIN], namespace=self.namespace)
        return domain

    def _clock(self) -> dict[str, bool]:
        return {"use_sim_time": self.switches["use_sim_time"]}

    def _add(self, package: str, name: str, values: dict[str, Any], **more: Any) -> None:
        special: dict[str, Any] = {"sigterm_timeout": STOP_TIMEOUT}
        if name == JUDGE:
            special["output_format"] = "{line}"
        elif name in KEPT:
            special |= {
                "respawn": True,
                "respawn_delay": RESTART_DELAY,
                "respawn_max_retries": self.restarts,
            }
        self.nodes[name] = Node(
            package=package,
            executable=name,
            name=name,
            namespace=self.namespace,
            parameters=[LaunchConfiguration("params_file"), {**values, **more}],
            remappings=list(own_names(self.namespace).items()),
            arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
            additional_env=self.environment,
            output="screen",
            **special,
        )

    # ---- reactions

    def _handlers(self) -> list[Any]:
        """Return the event handlers of the processes; registered before the first one starts."""
        handlers = [OnShutdown(on_shutdown=self._on_shutdown)]
        for name, node in self.nodes.items():
            handlers += [
                OnProcessStart(target_action=node, on_start=partial(self._on_start, name)),
                OnProcessExit(target_action=node, on_exit=partial(self._on_exit, name)),
            ]
        return [RegisterEventHandler(handler) for handler in handlers]

    def _on_shutdown(self, _event: Any, _context: LaunchContext) -> None:
        """Interrupt the flight when launch shuts down."""
        self.verdict.interrupt()

    def _on_start(self, name: str, _event: Any, _context: LaunchContext) -> None:
        self.verdict.started(name)

    def _on_exit(self, name: str, event: Any, _context: LaunchContext) -> list[Any]:
        """Return the actions after the end of a node's process."""
        follows = self.verdict.ended(name, event.returncode)
        actions: list[Any] = [LogInfo(msg=follows.line)] if follows.line else []
        if follows.tell_judge is not None:
            actions.append(self._signal(JUDGE, follows.tell_judge))
        if follows.shut_down:
            # SIGTERM first: on SIGINT, a node that still starts would print a traceback
            actions += [self._signal(other, signal.SIGTERM) for other in self.verdict.up]
            actions += [self._end(other) for other in self.nodes]
        elif name in KEPT and not follows.restart:
            # else launch would restart it
            actions.append(self._end(name))
        if not self.verdict.running:
            actions.append(LogInfo(msg=f"{self.name}: exit status {self.verdict.status}"))
        return actions

    def _signal(self, name: str, number: signal.Signals) -> EmitEvent:
        """Send a signal to a running process; launch fails for any other."""
        matches = matches_action(self.nodes[name])
        return EmitEvent(event=SignalProcess(signal_number=number, process_matcher=matches))

    def _end(self, name: str) -> EmitEvent:
        """End a process, once it runs, and do not restart it."""
        matches = matches_action(self.nodes[name])
        return EmitEvent(event=ShutdownProcess(process_matcher=matches))


def _of(values: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: values[name] for name in names if name in values}


def fly(context: LaunchContext) -> list[Any]:
    """Return the actions of the flight, or none after an error."""
    flight = Flight(context)
    if is_launched_itself(Path(__file__), sys.argv):
        end_launch_with(flight.verdict, context.asyncio_loop)
    try:
        return flight.start()
    except CannotStart as error:
        flight.verdict.cannot_start(" ".join(str(error).split()))
        return []


def generate_launch_description() -> LaunchDescription:
    """Return the flight in a launch scope of its own, so that its settings stay inside."""
    return LaunchDescription([GroupAction([*arguments(), OpaqueFunction(function=fly)])])
