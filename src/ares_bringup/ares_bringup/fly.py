# SPDX-License-Identifier: Apache-2.0
"""Fly one mission from start to summary: one process per node, or all nodes in this process."""

import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING, Any

from ares_bringup.audience import Audience
from ares_bringup.bag_paths import new_bag
from ares_bringup.crew import Crew, describe_end, ros_arguments
from ares_bringup.discovery import apply_discovery_settings
from ares_bringup.held import shared_memory_cleared
from ares_bringup.keeper import (
    GUIDANCE,
    JUDGE,
    OPTIMIZER,
    RECORDER,
    SIMULATOR,
    SPARED,
    VIEW,
    Keeper,
    describe_loss,
)
from ares_bringup.options import (
    PEG,
    CannotStart,
    FlyOptions,
    domain_id,
    refusals,
)
from ares_bringup.parameter_tables import known, tables
from ares_bringup.rehearsal import asks_for_plan, rehearse
from ares_bringup.summary import (
    EXIT_CANNOT_START,
    EXIT_INTERRUPTED,
    FlightSummary,
    MissionFacts,
    facts_of,
)
from ares_bringup.watch import PATIENCE, START_TIMEOUT, Watch
from ares_node.domains import claim_domain
from ares_node.identity import id_text, new_id
from ares_node.key import new_key
from ares_node.names import own_frames, remappings
from ares_node.requirements import unmet
from ares_node.security import enclave_arguments

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node

    from ares_bringup.monitor import FlightMonitor
    from ares_guidance.law import LawKind
    from ares_node.node import FlightNode
    from ares_node.run import StopSignals
    from ares_node.spin import Spinner

#: Security enclave of this process, which runs the judge, or all nodes.
FLY = "fly"
#: Modules that run the nodes as processes.
MODULES = {
    SIMULATOR: "ares_vehicle_sim",
    GUIDANCE: "ares_guidance",
    RECORDER: "ares_bags",
    OPTIMIZER: "ares_optimizer",
    VIEW: "ares_view.standard",
}

#: Wall time in s for which the start of guidance waits for the optimizer, which may compile first.
OPTIMIZER_TIMEOUT = 120.0
#: Wall time in s for simulator and guidance to end: after the flight, and after a signal.
NODE_STOP_TIMEOUT = 10.0
INTERRUPTED_STOP_TIMEOUT = 1.0
#: Wall time in s by which the recorder ends after the other nodes.
HEAD_START = 0.1
#: Wall time in s for the recorder to write its queues and close the bag.
RECORDER_STOP_TIMEOUT = 30.0

Say = Callable[[str], None]
Show = Callable[["FlightMonitor"], None]
Tell = Callable[[FlightSummary], None]


def say_on_standard_error(line: str) -> None:
    """Print a line on standard error."""
    print(line, file=sys.stderr, flush=True)


def mission_facts(name: str) -> MissionFacts:
    """Read and check a mission.

    Raises:
        CannotStart: no such mission, or its file is wrong; one line.
    """
    from ares_models.mission import load_mission

    with refusals():
        mission = load_mission(name)
        # it may not be installed
        mission.atmosphere()
    return facts_of(mission)


def absolute_namespace(namespace: str) -> str:
    """Return a namespace with its leading slash.

    Raises:
        CannotStart: it is invalid in ROS.
    """
    from rclpy.exceptions import InvalidNamespaceException
    from rclpy.validate_namespace import validate_namespace

    absolute = namespace if namespace.startswith("/") else f"/{namespace}"
    try:
        validate_namespace(absolute)
    except InvalidNamespaceException as error:
        reason = str(error).partition(": ")[2].splitlines()[0].rstrip(":")
        raise CannotStart(f"namespace is {namespace!r}; {reason}") from error
    if absolute == "/":
        raise CannotStart(f"namespace is {namespace!r}; expected a name")
    return absolute


def _margin(dispersions: str) -> float:
    """Return the margin to the heating limit for a guidance without a heating sensor.

    Raises:
        CannotStart: the dispersions are invalid; one line.
    """
    from ares_vehicle_sim.dispersions import load_dispersions

    with refusals():
        return load_dispersions(dispersions).heating_margin()


def _check_failure(failure: str, mission: str) -> None:
    """Check that a failure is possible in a mission.

    Raises:
        CannotStart: it is not; one line.
    """
    from ares_models.failures import check_failure, read_failure
    from ares_models.mission import load_mission

    with refusals():
        check_failure(read_failure(failure), load_mission(mission))


def _find_law(name: str) -> "LawKind":
    from ares_guidance.laws import find_law

    try:
        return find_law(name)
    except ValueError as error:
        raise CannotStart(str(error).replace("law is", "guidance is", 1)) from error


def law_that_flew(summary: FlightSummary) -> str:
    """Return the law that ran in most cycles; before the first cycle, the requested one.

    Args:
        summary: of the flight; its `guidance` wins among laws of equal code.
    """
    from ares_guidance.laws import find_law
    from ares_guidance.registry import law_names

    if not summary.laws:
        return summary.guidance
    [(code, _)] = summary.laws.most_common(1)
    for name in (summary.guidance, *law_names()):
        with suppress(ValueError):
            if find_law(name).code == code:
                return name
    return f"law {code}"


def needs_trajectory(law: str) -> bool:
    """Tell whether a guidance law needs a trajectory of the optimizer.

    Raises:
        CannotStart: no such law; one line.
    """
    return _find_law(law).needs_trajectory


def needs_plan(mission: str, law: str) -> bool:
    """Tell whether a law flies a mission by a plan, which the optimizer must make.

    Raises:
        CannotStart: no such mission, or the law cannot fly it; one line.
    """
    from ares_models.mission import load_mission

    with refusals():
        loaded = load_mission(mission)
    return loaded.needs_plan or asks_for_plan(loaded, law)


def check_inputs(flown: Mapping[str, Any], bag: str) -> None:
    """Check the inputs of a flight before anything is started.

    Args:
        flown: parameters of simulator and guidance by name, as far as given.
        bag: folder of the bag; "": none.

    Raises:
        CannotStart: one of them is invalid; one line.
    """
    with refusals():
        for row in (*tables()[SIMULATOR], *tables()[GUIDANCE]):
            if row.name in flown:
                row.checked(flown[row.name])
    name = str(flown.get("mission", "ares_v"))
    mission_facts(name)
    _find_law(str(flown.get("law", PEG)))
    if flown.get("dispersions"):
        _margin(str(flown["dispersions"]))
    if flown.get("failure"):
        _check_failure(str(flown["failure"]), name)
    if bag and os.path.lexists(bag):
        raise CannotStart(f"bag is {bag!r}, which exists; expected a new folder")


def node_parameters(
    options: FlyOptions, bag: str | None, flight_id: int
) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node of the flight, by node name.

    Args:
        options: the flight.
        bag: folder of the bag; None: no recorder.
        flight_id: identity of the flight.
    """
    given: dict[str, Any] = {
        "pace": 0.0,
        **options.settings,
        "flight_id": flight_id,
        "mission": options.mission,
        "law": options.guidance,
        "start_timeout_s": START_TIMEOUT,
        "expected_recorders": int(bag is not None),
        "expected_judges": 1,
        "foxglove_port": options.foxglove_port,
        "frame_prefix": own_frames(options.namespace),
        "bag": bag,
    }
    if options.flight is not None:
        from ares_vehicle_sim.dispersions import STANDARD
        from ares_vehicle_sim.simulator import CAMPAIGN

        stepped = {
            "dispersions": STANDARD,
            "flight": options.flight,
            "navigation_period_s": CAMPAIGN.navigation_period_s,
            "integration_step_s": CAMPAIGN.integration_step_s,
        }
        given = stepped | given
    if "failure" in given:
        _check_failure(given["failure"], options.mission)
    if given.get("heating_source") == "model" and "dispersions" in given:
        given["heating_margin"] = _margin(given["dispersions"])
    names = [SIMULATOR, GUIDANCE]
    if optimizer := optimizer_values(given):
        if reason := unmet("ares_optimizer", "solve"):
            raise CannotStart(reason)
        names.append(OPTIMIZER)
    if options.view or options.foxglove_port:
        names.append(VIEW)
    if bag is not None:
        names.append(RECORDER)
    return {name: known(name, given | optimizer) for name in names}


def optimizer_values(flown: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of the optimizer's node; empty if the flight does not need it.

    Args:
        flown: parameters by name: mission, law, initial_guess, as far as given.
    """
    guess = flown.get("initial_guess", "none")
    mission = str(flown.get("mission", "ares_v"))
    law = str(flown.get("law", PEG))
    if guess == "optimizer" or needs_plan(mission, law):
        return {"mission": mission}
    if guess == "analytic" or needs_trajectory(law):
        return {"mission": mission, "method": "analytic"}
    return {}


def fly(
    options: FlyOptions,
    say: Say = say_on_standard_error,
    modules: Mapping[str, str] = MODULES,
    begun: float | None = None,
    greet: Say = lambda _line: None,
    show: Show = lambda _monitor: None,
    tell: Tell = lambda _summary: None,
) -> FlightSummary:
    """Fly a mission and summarize it.

    No process is left behind, however the flight ends: children end with this process, even if
    it is killed. Call from the main thread, since it handles SIGINT, SIGTERM and SIGHUP.

    Args:
        options: the flight.
        say: gets lines for the user during the flight.
        modules: module of each node, for the layout with several processes.
        begun: start of the command, s of time.monotonic(), for `wall_s`; default: now.
        greet: gets a line with the address of the flight when it has begun.
        show: gets the monitor about ten times a second, to display the flight.
        tell: gets the summary after the flight, before the live page ends.

    Raises:
        CannotStart: the flight cannot start; one line with the reason.
    """
    begun = time.monotonic() if begun is None else begun
    domain = domain_id(options)
    namespace = absolute_namespace(options.namespace)
    facts = mission_facts(options.mission)
    bag = None
    if options.record:
        bag = str((options.bag or new_bag(facts.name)).absolute())
    summary = FlightSummary(facts, options.guidance, bag, new_id(), namespace=namespace)
    parameters = node_parameters(options, bag, summary.flight_id)
    if line := rehearse(parameters[SIMULATOR] | parameters[GUIDANCE]):
        say(line)
    audience = Audience(options, summary, say)
    apply_discovery_settings()
    with ExitStack() as held:
        summary.domain_id = held.enter_context(_own_domain()) if domain is None else domain
        held.enter_context(audience)
        if options.sealed:
            held.enter_context(new_key())
        terms = _Callbacks(say, lambda: greet(_greeting(summary)), audience, show, options)
        if options.in_process:
            _fly_in_process(summary, parameters, terms)
        else:
            _fly_in_processes(summary, parameters, terms, modules)
        if bag is not None and not Path(bag).exists():
            summary.bag = None
        summary.wall_s = time.monotonic() - begun
        tell(summary)
        audience.stay()
    return summary


def _greeting(summary: FlightSummary) -> str:
    """Return the line with identity, domain and namespace of the flight."""
    look = " ros2 topic list" if which("ros2") else ""
    return (
        f"flight {id_text(summary.flight_id)}: "
        f"ROS_DOMAIN_ID={summary.domain_id}{look} (namespace {summary.namespace})"
    )


@dataclass(frozen=True)
class _Callbacks:
    """Hold the callbacks and options of a flight.

    Attributes:
        say: gets lines for the user.
        begun: called when the flight has begun.
        audience: the live page.
        show: gets the monitor repeatedly.
        options: the flight.
    """

    say: Say
    begun: Callable[[], None]
    audience: Audience
    show: Show
    options: FlyOptions


@contextmanager
def _own_domain() -> Iterator[int]:
    try:
        domain, lock = claim_domain()
    except TimeoutError as error:
        raise CannotStart(f"{error}; name one with --domain-id") from error
    try:
        yield domain
    finally:
        os.close(lock)


@contextmanager
def flight_graph(
    summary: FlightSummary, say: Say, abandonable: Callable[[], bool]
) -> Iterator[tuple["FlightMonitor", "Executor", "StopSignals"]]:
    """Yield the monitor and its executor in a private context, and the signals as a flag.

    Args:
        summary: of the flight.
        say: gets lines for the user.
        abandonable: whether an interrupted process may end at once, even while it computes.
    """
    import rclpy
    from rclpy.context import Context
    from rclpy.experimental.events_executor import EventsExecutor
    from rclpy.node import Node
    from rclpy.signals import SignalHandlerOptions

    from ares_bringup.monitor import FlightMonitor
    from ares_node.heartbeat import Heartbeat
    from ares_node.run import StopSignals

    stop = StopSignals(abandonable, EXIT_INTERRUPTED)
    stop.starting = False
    context = Context()
    with stop.watch():
        rclpy.init(
            args=enclave_arguments(FLY),
            context=context,
            domain_id=summary.domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        try:
            executor = EventsExecutor(context=context)
            stop.install()
            stop.wake_with(executor.wake)
            node = Node(
                JUDGE,
                namespace=summary.namespace,
                context=context,
                cli_args=["--ros-args", *remappings(summary.namespace)],
                enable_rosout=False,
                start_parameter_services=False,
            )
            Heartbeat(node, flight_id=lambda: summary.flight_id)
            monitor = FlightMonitor(node, summary, say)
            try:
                executor.add_node(node)
                yield monitor, executor, stop
            finally:
                stop.wake_with(None)
                executor.shutdown()
                monitor.leave()
                node.destroy_node()
        finally:
            context.try_shutdown()


def _watch(monitor: "FlightMonitor", pace: float, terms: _Callbacks, stop: "StopSignals") -> Watch:
    # only on a terminal: for a program, the lines must not depend on the machine's speed
    patience = PATIENCE if sys.stderr.isatty() else math.inf
    return Watch(monitor, pace, terms.say, lambda: stop.requested, terms.begun, patience)


@contextmanager
def _spinner(
    monitor: "FlightMonitor", executor: "Executor", stop: "StopSignals"
) -> Iterator["Spinner"]:
    """Yield a spinner that returns at once on a signal and at the end of the flight."""
    from ares_node.spin import Spinner

    with Spinner(executor, monitor.node) as spinner:
        monitor.when_ended = spinner.come_back
        stop.wake_with(spinner.come_back)
        yield spinner
        stop.wake_with(executor.wake)


def _keep_watch(watch: Watch, spinner: "Spinner", lost: Callable[[], bool]) -> None:
    """Spin until the flight is over or lost."""
    while not watch.over():
        spinner.spin()
        if lost():
            return


# ---- one process each


def _fly_in_processes(
    summary: FlightSummary,
    parameters: Mapping[str, Mapping[str, Any]],
    terms: _Callbacks,
    modules: Mapping[str, str],
) -> None:
    from ares_node.qos import SOLVE_TRAJECTORY

    say, audience = terms.say, terms.audience
    keeper = Keeper(terms.options.restarts)
    with (
        shared_memory_cleared() as look_at_shared_memory,
        Crew({**os.environ, "ROS_DOMAIN_ID": str(summary.domain_id)}) as crew,
    ):

        def start(name: str) -> None:
            arguments = ros_arguments(parameters[name], summary.namespace)
            crew.start(name, modules[name], [*arguments, *terms.options.arguments.get(name, ())])

        # guidance needs the optimizer at its start, so it starts after it
        late = [GUIDANCE] if OPTIMIZER in parameters else []
        begun = time.monotonic()

        def lost() -> bool:
            if late and (
                monitor.node.count_services(SOLVE_TRAJECTORY)
                or OPTIMIZER not in crew.running()
                or time.monotonic() - begun > OPTIMIZER_TIMEOUT
            ):
                start(late.pop())
            look_at_shared_memory()
            audience.look(monitor)
            terms.show(monitor)
            for name, again in _ended(crew, keeper, summary, say):
                if name == GUIDANCE:
                    monitor.guidance_ended()
                if again:
                    start(name)
            return SIMULATOR not in crew.running()

        # the children first, since they take longest to start
        for name in parameters:
            if name not in late:
                start(name)
        with flight_graph(summary, say, lambda: False) as (monitor, executor, stop):
            audience.come(monitor)
            watch = _watch(monitor, parameters[SIMULATOR]["pace"], terms, stop)
            with _spinner(monitor, executor, stop) as spinner:
                _keep_watch(watch, spinner, lost)

            def listen() -> None:
                executor.spin_once(timeout_sec=0.005)

            within = INTERRUPTED_STOP_TIMEOUT if stop.requested else NODE_STOP_TIMEOUT
            _end_crew(crew, summary, say, listen, within)
            audience.leave(monitor)


def _ended(crew: Crew, keeper: Keeper, summary: FlightSummary, say: Say) -> list[tuple[str, bool]]:
    """Report the nodes that have ended; return each with whether to restart it.

    Raises:
        CannotStart: the flight has not begun, and cannot without one of them.
    """
    ended = []
    for name, status in crew.newly_ended():
        if status == EXIT_CANNOT_START and (name == SIMULATOR or not summary.started):
            # the node has printed the reason
            raise CannotStart("")
        if not summary.started and name not in SPARED:
            raise CannotStart(f"{name} {describe_end(status)}")
        line, again = keeper.ended(name, status)
        _say_ended(name, line, summary, say)
        ended.append((name, again))
    return ended


def _say_ended(name: str, line: str, summary: FlightSummary, say: Say) -> None:
    """Report that a node has ended; count it as a shortcoming unless the flight can spare it."""
    if name not in SPARED:
        summary.problems.append(line)
    say(line)


def _end_crew(
    crew: Crew, summary: FlightSummary, say: Say, listen: Callable[[], None], within: float
) -> None:
    """End the flying nodes within `within` s, then the recorder, which writes all they sent."""
    alive = crew.running()
    for name, status in crew.newly_ended():
        # ended between the last poll and the end of the flight
        if summary.started and name not in SPARED:
            _say_ended(name, describe_loss(name, status), summary, say)
    flying = [name for name in alive if name != RECORDER]
    crew.ask_to_stop(flying)
    if RECORDER in alive:
        # the recorder receives their last messages before it ends
        begun = time.monotonic()
        while time.monotonic() - begun < HEAD_START and set(flying) & set(crew.running()):
            listen()
        crew.ask_to_stop([RECORDER])
    for name in crew.stop(flying, within, listen):
        problem = f"{name} did not end within {within:g} s: killed"
        if name in SPARED:
            say(problem)
        else:
            summary.problems.append(problem)
    if RECORDER in alive:
        crew.stop([RECORDER], RECORDER_STOP_TIMEOUT, listen)
        if closed := crew.status(RECORDER):
            summary.problems.append(f"{RECORDER} {describe_end(closed)}: the bag is incomplete")


# ---- all in this process


def _fly_in_process(
    summary: FlightSummary,
    parameters: Mapping[str, Mapping[str, Any]],
    terms: _Callbacks,
) -> None:
    say, audience = terms.say, terms.audience

    def lost() -> bool:
        audience.look(monitor)
        terms.show(monitor)
        return _node_lost(nodes, summary, say)

    with flight_graph(summary, say, lambda: not summary.started) as (monitor, executor, stop):
        audience.come(monitor)
        nodes: dict[str, FlightNode] = {}
        try:
            # the recorder last: a start interrupted while kernels compile leaves no bag
            for name in (OPTIMIZER, VIEW, GUIDANCE, SIMULATOR, RECORDER):
                if name in parameters and not stop.requested:
                    nodes[name] = _started(name, parameters[name], executor, monitor.node)
            watch = _watch(monitor, parameters[SIMULATOR]["pace"], terms, stop)
            with _spinner(monitor, executor, stop) as spinner:
                for node in nodes.values():
                    node.when_done = spinner.come_back
                _keep_watch(watch, spinner, lost)
            for node in _in_order_of_end(nodes):
                if not node.done:
                    node.drain(executor)
                if stop.requested:
                    # else they would fly on while the recorder drains its queues
                    node.stop()
        finally:
            for node in _in_order_of_end(nodes):
                executor.remove_node(node)
                node.stop()
                node.destroy_node()
        if RECORDER in nodes and nodes[RECORDER].exit_code:
            summary.problems.append(f"{RECORDER} failed: the bag is incomplete")
        audience.leave(monitor)


def _in_order_of_end(nodes: Mapping[str, "FlightNode"]) -> list["FlightNode"]:
    """Sort the nodes with the recorder last, so that it writes all that the others sent."""
    order = (SIMULATOR, GUIDANCE, OPTIMIZER, VIEW, RECORDER)
    return [nodes[name] for name in order if name in nodes]


def _started(
    name: str, values: Mapping[str, Any], executor: "Executor", judge: "Node"
) -> "FlightNode":
    """Start a node; return it configured and active.

    Raises:
        CannotStart: a parameter or a transition was refused; one line.
    """
    from rclpy.exceptions import ParameterException
    from rclpy.parameter import Parameter

    from ares_node.parameters import ParameterError

    overrides = [Parameter(key, value=value) for key, value in values.items()]
    try:
        node = _node_class(name)(
            context=judge.context,
            namespace=judge.get_namespace(),
            cli_args=["--ros-args", *remappings(judge.get_namespace())],
            parameter_overrides=overrides,
        )
    except (ParameterError, ParameterException) as error:
        raise CannotStart(f"{name}: {' '.join(str(error).split())}") from error
    executor.add_node(node)
    if not node.start():
        reason = node.failure or "could not start"
        executor.remove_node(node)
        node.stop()
        node.destroy_node()
        raise CannotStart(f"{name}: {reason}")
    return node


def _node_class(name: str) -> "Callable[..., FlightNode]":
    if name == SIMULATOR:
        from ares_vehicle_sim.node import VehicleSimNode

        return VehicleSimNode
    if name == GUIDANCE:
        from ares_guidance.node import GuidanceNode

        return GuidanceNode
    if name == OPTIMIZER:
        from ares_optimizer.node import OptimizerNode

        return OptimizerNode
    if name == VIEW:
        from ares_view.standard.node import ViewNode

        return ViewNode
    from ares_bags.recorder import RecorderNode

    return RecorderNode


def _node_lost(nodes: "Mapping[str, FlightNode]", summary: FlightSummary, say: Say) -> bool:
    """Tell whether the simulator has ended in flight; raise if any node ends before it."""
    for name, node in nodes.items():
        if not node.done:
            continue
        if node.exit_code == EXIT_CANNOT_START:
            raise CannotStart("")
        if not summary.started:
            raise CannotStart(f"{name} ended")
        if name == SIMULATOR:
            summary.problems.append(f"{name} ended in flight")
            say(summary.problems[-1])
            return True
    return False
