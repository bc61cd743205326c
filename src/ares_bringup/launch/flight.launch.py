"""One flight under `ros2 launch`: simulator, guidance, recorder and judge, each a process.

    ros2 launch ares_bringup flight.launch.py mission:=ares_v pace:=1.0

An argument that is left empty leaves its parameter to the parameter file. The launch ends
when the judge does, with the exit status of `ares fly`.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
    Shutdown,
    TimerAction,
)
from launch.event_handlers import OnProcessExit, OnProcessStart, OnShutdown
from launch.events.process import SignalProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from ares_bringup.audience import LIVE
from ares_bringup.bag_paths import new_bag
from ares_bringup.discovery import check_protection, discovery_settings
from ares_bringup.fly import absolute_namespace, check_inputs, needs_plan, needs_trajectory
from ares_bringup.keeper import GUIDANCE, JUDGE, OPTIMIZER, RECORDER, SIMULATOR, VIEW, Keeper
from ares_bringup.launch_verdict import LaunchVerdict, end_process_with
from ares_bringup.options import (
    MAX_RESTARTS,
    PEG,
    RESTARTS,
    CannotStart,
    FlyOptions,
    domain_id,
)
from ares_bringup.params_file import node_values
from ares_node.domains import claim_domain
from ares_node.identity import id_text, new_id

SWITCH = ["true", "false"]
LEVELS = ["debug", "info", "warn", "error", "fatal"]

#: The domain of those who name none; a flight takes it if no other flight has.
DEFAULT_DOMAIN = 0

#: Wall time in s that the judge has to end a flight which had not begun, instead of a restart.
RESTART_DELAY = 1.0

#: Wall time in s for the recorder to close its bag before it gets SIGTERM.
RECORDER_STOP_TIMEOUT = "30"


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
            "it, else one that is free.",
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
            description="End everything when the flight is over.",
        ),
        DeclareLaunchArgument(
            "log_level", default_value="info", choices=LEVELS, description="Log level of all nodes."
        ),
    ]


class Flight:
    """What is started, and what follows when something of it ends."""

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
        self.verdict = LaunchVerdict(self.switches["exit_when_complete"])
        self.reports = end_process_with(self.verdict)
        self.nodes: dict[str, Node] = {}
        self._make: dict[str, Callable[[], Node]] = {}

    def start(self) -> list[Any]:
        """The actions that make the flight.

        Raises:
            CannotStart: something that was asked for is wrong; one line.
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
        namespace = absolute_namespace(self.given["namespace"])
        check_inputs(flown, bag)
        domain = self._domain()
        self.verdict.keeper = Keeper(self._restarts())
        identity = {"flight_id": new_id()}
        about = {name: flown[name] for name in ("mission", "law") if name in flown}
        started = [
            self._node(
                "ares_vehicle_sim",
                SIMULATOR,
                _of(values, "mission", "pace", "seed", "dispersions", "failure"),
                **identity,
                exit_when_complete=False,
                expected_recorders=int(record),
                expected_judges=1,
            ),
            self._node(
                "ares_guidance",
                GUIDANCE,
                _of(values, "mission", "law", "initial_guess"),
                **identity,
                **self._clock(),
            ),
            self._node(
                "ares_bringup",
                JUDGE,
                about,
                **identity,
                bag=bag,
                pace=float(flown.get("pace", 0.0)),
                expected_recorders=int(record),
            ),
        ]
        law = str(flown.get("law", PEG))
        if (
            flown.get("initial_guess", "none") != "none"
            or needs_trajectory(law)
            or needs_plan(str(flown.get("mission", "ares_v")))
        ):
            started.append(
                self._node("ares_optimizer", OPTIMIZER, _of(values, "mission"), **self._clock())
            )
        if self.switches["view"]:
            started.append(
                self._node(
                    "ares_view",
                    VIEW,
                    _of(values, "mission", "foxglove_port"),
                    **identity,
                    **self._clock(),
                )
            )
        if self.switches["live"]:
            started.append(self._node("ares_view", LIVE, _of(values, "mission"), **identity))
        if record:
            about |= {"seed": flown["seed"]} if "seed" in flown else {}
            started.append(
                self._node("ares_bags", RECORDER, about, **identity, bag=bag, **self._clock())
            )
        words = f"flight {id_text(identity['flight_id'])}: ROS_DOMAIN_ID={domain} ros2 topic list"
        return [
            SetEnvironmentVariable("ROS_DOMAIN_ID", str(domain)),
            LogInfo(msg=f"{words}, namespace {namespace}"),
            *([LogInfo(msg=f"recording to {bag}")] if bag else []),
            *started,
        ]

    def _values(self) -> dict[str, Any]:
        """What was given on the command line, by the names of the nodes' parameters."""
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
            # held until this process ends
            domain, _ = claim_domain(preferred=[DEFAULT_DOMAIN])
        return domain

    def _clock(self) -> dict[str, bool]:
        return {"use_sim_time": self.switches["use_sim_time"]}

    def _node(self, package: str, name: str, values: dict[str, Any], **more: Any) -> Node:
        plain = {"output_format": "{line}"} if name == JUDGE else {}
        patient = {"sigterm_timeout": RECORDER_STOP_TIMEOUT} if name == RECORDER else {}

        def make() -> Node:
            return Node(
                package=package,
                executable=name,
                name=name,
                namespace=LaunchConfiguration("namespace"),
                parameters=[LaunchConfiguration("params_file"), {**values, **more}],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                output="screen",
                **plain,
                **patient,
            )

        self._make[name] = make
        self.nodes[name] = make()
        return self.nodes[name]

    # ---- what follows

    def handlers(self) -> list[Any]:
        """What listens to the processes; registered before the first one starts."""
        of_launch = [RegisterEventHandler(OnShutdown(on_shutdown=self.on_shutdown))]
        return sum((self._listeners(name) for name in self.nodes), of_launch)

    def _listeners(self, name: str) -> list[Any]:
        """What listens to one process."""
        node = self.nodes[name]
        return [
            RegisterEventHandler(handler)
            for handler in (
                OnProcessStart(target_action=node, on_start=self._on_start(name)),
                OnProcessExit(target_action=node, on_exit=self._on_exit(name)),
            )
        ]

    def _restart(self, name: str) -> list[Any]:
        """The actions that start a node again."""
        self.nodes[name] = self._make[name]()
        started = [*self._listeners(name), self.nodes[name]]
        return [TimerAction(period=RESTART_DELAY, actions=started, cancel_on_shutdown=True)]

    def on_shutdown(self, event: Any, _context: LaunchContext) -> None:
        """An interrupt is one for the verdict too."""
        if event.due_to_sigint:
            self.verdict.interrupt()

    def _on_start(self, name: str) -> Any:
        def note(event: Any, _context: LaunchContext) -> None:
            self.verdict.pids[name] = event.pid

        return note

    def _on_exit(self, name: str) -> Any:
        def follow(event: Any, _context: LaunchContext) -> list[Any]:
            follows = self.verdict.ended(name, event.returncode)
            actions: list[Any] = [LogInfo(msg=follows.line)] if follows.line else []
            if follows.tell_judge and JUDGE in self.verdict.pids:
                judge = self.nodes[JUDGE]
                actions.append(
                    EmitEvent(
                        event=SignalProcess(
                            signal_number=follows.tell_judge,
                            process_matcher=lambda action: action is judge,
                        )
                    )
                )
            if follows.restart:
                actions += self._restart(name)
            if follows.shut_down:
                actions.append(self.shut_down(f"{name} has ended"))
            return actions

        return follow

    def shut_down(self, reason: str) -> Shutdown:
        """The end of the launch.

        Raises:
            RuntimeError: in a program other than `ros2`, a flight that was not as it should be.
        """
        if not self.reports and self.verdict.status:
            raise RuntimeError(f"the flight ends with status {self.verdict.status}")
        return Shutdown(reason=reason)


def _of(values: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: values[name] for name in names if name in values}


def fly(context: LaunchContext) -> list[Any]:
    """The flight, or the line that says why there is none."""
    flight = Flight(context)
    try:
        started = flight.start()
    except CannotStart as error:
        flight.verdict.cannot_start(" ".join(str(error).split()))
        return [flight.shut_down("nothing was started")]
    return [*flight.handlers(), *started]


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            *arguments(),
            *(SetEnvironmentVariable(*item) for item in discovery_settings().items()),
            OpaqueFunction(function=fly),
        ]
    )
