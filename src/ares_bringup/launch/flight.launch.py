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
from ares_bringup.inputs import absolute_namespace, check_inputs
from ares_bringup.keeper import GUIDANCE, JUDGE, KEPT, OPTIMIZER, RECORDER, SIMULATOR, VIEW, Keeper
from ares_bringup.launch_verdict import LaunchVerdict, end_launch_with, is_launched_itself
from ares_bringup.node_values import optimizer_values
from ares_bringup.options import CannotStart, FlyOptions, domain_id, refusals
from ares_bringup.parameter_tables import LAUNCH, known, offered
from ares_bringup.params_file import node_values
from ares_bringup.rehearsal import rehearse
from ares_node.domains import claim_domain
from ares_node.identity import id_text, new_id
from ares_node.names import own_frames, own_names
from ares_node.parameters import Parameter
from ares_node.parent import LAUNCHER

#: Nodes whose log lines may be stamped with flight time.
STAMPED = (GUIDANCE, OPTIMIZER, VIEW, RECORDER)

#: Default ROS domain; a flight uses it if no other flight does.
DEFAULT_DOMAIN = 0

#: Wall time in s before a restart, in which the judge can end a flight that had not begun.
RESTART_DELAY = 1.0

#: Wall time in s for a node to end, and the recorder to close its bag, before it gets SIGTERM
#: again; long enough for a busy machine.
STOP_TIMEOUT = "20"


def arguments() -> list[DeclareLaunchArgument]:
    """Return the arguments; an empty one leaves its parameter to the parameter file."""
    own = {row.name: (row, _text(row.default)) for row in LAUNCH}
    own |= {name: (row, "") for name, row in offered().items()}
    share = Path(get_package_share_directory("ares_bringup"))
    own["params_file"] = own["params_file"][0], str(share / "params" / "flight.yaml")
    return [
        DeclareLaunchArgument(
            name,
            default_value=default,
            description=row.text,
            choices=_choices(row) if default else None,
        )
        for name, (row, default) in own.items()
    ]


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _choices(row: Parameter) -> list[str] | None:
    return ["true", "false"] if isinstance(row.default, bool) else list(row.choices) or None


class LaunchedFlight:
    """Build the launch actions of a flight and react to the ends of its processes."""

    def __init__(self, context: LaunchContext) -> None:
        #: Texts of all arguments by name.
        self.texts = {
            name: LaunchConfiguration(name).perform(context)
            for name in (*(row.name for row in LAUNCH), *offered())
        }
        #: Namespace pushed by the file that includes this one.
        self.pushed_namespace = context.launch_configurations.get("ros_namespace", "")
        self.verdict = LaunchVerdict(self.texts["exit_when_complete"] == "true")
        self.nodes: dict[str, Node] = {}

    def start(self) -> list[Any]:
        """Return the actions that start the flight.

        Raises:
            CannotStart: an argument is invalid; one line.
        """
        check_protection()
        with refusals():
            self.own = {row.name: row.parsed(self.texts[row.name]) for row in LAUNCH}
            values = {
                row.name: row.parsed(text)
                for name, row in offered().items()
                if (text := self.texts[name])
            }
        files = self.own["params_file"]
        try:
            flown = {**node_values(files, GUIDANCE), **node_values(files, SIMULATOR), **values}
        except (OSError, ValueError) as error:
            raise CannotStart(f"params_file: {error}") from error
        record = self.own["record"]
        mission = str(flown.get("mission", "ares_v"))
        bag = self.own["bag"] or str(new_bag(Path(mission).stem)) if record else ""
        self.namespace = self._namespace()
        check_inputs(flown, bag)
        expected = rehearse(flown)
        self.verdict.keeper = Keeper(self.own["restarts"])
        self.environment = {
            **discovery_settings(),
            "ROS_DOMAIN_ID": str(self._domain()),
            LAUNCHER: str(os.getpid()),
        }
        flight_id = new_id()
        values |= {
            "flight_id": flight_id,
            "exit_when_complete": False,
            "expected_recorders": int(record),
            "expected_judges": 1,
            "frame_prefix": own_frames(self.namespace),
            "bag": bag,
        }
        # as the flight has it, whoever the parameter file says it to
        about = values | {x: flown[x] for x in ("mission", "law", "seed") if x in flown}
        self._add_nodes(values, about, bool(optimizer_values(flown)))
        self.verdict.start(self.nodes)
        self.name = f"flight {id_text(flight_id)}"
        where = f"ROS_DOMAIN_ID={self.environment['ROS_DOMAIN_ID']} ros2 topic list"
        return [
            LogInfo(msg=f"{self.name}: {where}, namespace {self.namespace}"),
            *([LogInfo(msg=f"recording to {bag}")] if bag else []),
            *([LogInfo(msg=expected)] if expected else []),
            *self._handlers(),
            *self.nodes.values(),
        ]

    def _namespace(self) -> str:
        """Return the namespace of all nodes, below a pushed one, as in launch_ros."""
        given = self.own["namespace"]
        if not given.startswith("/") and self.pushed_namespace:
            given = f"{self.pushed_namespace.rstrip('/')}/{given}"
        return absolute_namespace(given)

    def _domain(self) -> int:
        text = self.own["domain_id"]
        options = FlyOptions()
        if text:
            options = replace(options, domain_id=int(text) if text.isdigit() else -1)
        domain = domain_id(options)
        if domain is None:
            # claimed until this process ends
            domain, _ = claim_domain(preferred=[DEFAULT_DOMAIN], namespace=self.namespace)
        return domain

    def _add_nodes(self, values: dict[str, Any], about: dict[str, Any], optimizer: bool) -> None:
        """Add the nodes of the flight: with its values, or those that are told about it."""
        self._add("ares_vehicle_sim", SIMULATOR, values)
        self._add("ares_guidance", GUIDANCE, values)
        self._add("ares_bringup", JUDGE, about)
        if optimizer:
            self._add("ares_optimizer", OPTIMIZER, values)
        if self.own["view"]:
            self._add("ares_view", VIEW, values)
        if self.own["live"]:
            self._add("ares_view", LIVE, values)
        if self.own["record"]:
            self._add("ares_bags", RECORDER, about)

    def _add(self, package: str, name: str, values: dict[str, Any]) -> None:
        given = known(name, values)
        if name in STAMPED:
            given["use_sim_time"] = self.own["use_sim_time"]
        special: dict[str, Any] = {"sigterm_timeout": STOP_TIMEOUT}
        if name == JUDGE:
            special["output_format"] = "{line}"
        elif name in KEPT:
            special |= {
                "respawn": True,
                "respawn_delay": RESTART_DELAY,
                "respawn_max_retries": self.own["restarts"],
            }
        self.nodes[name] = Node(
            package=package,
            executable=name,
            name=name,
            namespace=self.namespace,
            parameters=[LaunchConfiguration("params_file"), given],
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


def fly(context: LaunchContext) -> list[Any]:
    """Return the actions of the flight, or none after an error."""
    flight = LaunchedFlight(context)
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
