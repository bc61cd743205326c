# SPDX-License-Identifier: Apache-2.0
"""Fly one mission from start to summary: one process per node, or all nodes in this process."""

import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from shutil import which

from ares_bringup.audience import Audience
from ares_bringup.bag_paths import check_new_bag, new_bag
from ares_bringup.discovery import apply_discovery_settings
from ares_bringup.graph import Callbacks, Say, Show
from ares_bringup.inputs import absolute_namespace, mission_facts
from ares_bringup.keeper import GUIDANCE, SIMULATOR
from ares_bringup.node_values import node_parameters
from ares_bringup.one_process import fly_in_process
from ares_bringup.options import CannotStart, FlyOptions, domain_id
from ares_bringup.processes import MODULES, fly_in_processes
from ares_bringup.rehearsal import rehearse
from ares_bringup.shared_plans import shared_plans
from ares_bringup.summary import FlightSummary
from ares_node.domains import claim_domain
from ares_node.identity import id_text, new_id
from ares_node.key import new_key

Tell = Callable[[FlightSummary], None]


def say_on_standard_error(line: str) -> None:
    """Print a line on standard error."""
    print(line, file=sys.stderr, flush=True)


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
        folder = (options.bag or new_bag(facts.name)).absolute()
        check_new_bag(folder)
        bag = str(folder)
    summary = FlightSummary(facts, options.guidance, bag, new_id(), namespace=namespace)
    parameters = node_parameters(options, bag, summary.flight_id)
    with ExitStack() as held:
        held.enter_context(shared_plans())
        if line := rehearse(parameters[SIMULATOR] | parameters[GUIDANCE]):
            say(line)
        audience = Audience(options, summary, say)
        apply_discovery_settings()
        summary.domain_id = held.enter_context(_own_domain()) if domain is None else domain
        held.enter_context(audience)
        if options.sealed:
            held.enter_context(new_key())
        terms = Callbacks(say, lambda: greet(_greeting(summary)), audience, show, options)
        if options.in_process:
            fly_in_process(summary, parameters, terms)
        else:
            fly_in_processes(summary, parameters, terms, modules)
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
