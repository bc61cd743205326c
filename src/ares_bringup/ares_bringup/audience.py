# SPDX-License-Identifier: Apache-2.0
"""The page that follows a flight, in a process of its own: no flight needs it."""

import os
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from types import TracebackType
from typing import TYPE_CHECKING, Any, NoReturn, Self

from ares_bringup.crew import LOOK_PERIOD, Crew, describe_end, ros_arguments
from ares_bringup.discovery import apply_discovery_settings
from ares_bringup.options import CannotStart, FlyOptions, LiveOptions
from ares_bringup.summary import EXIT_CANNOT_START, FlightSummary
from ares_node.requirements import unmet
from ares_view.live.address import AddressError, free_port

if TYPE_CHECKING:
    from ares_bringup.monitor import FlightMonitor

LIVE = "live"
MODULE = "ares_view.live"
#: What it means that its process has ended.
PAGELESS = "the flight goes on without its page"

#: Wall time in s for the page to be served, and opened, before the flight begins without it.
PATIENCE = 10.0
#: Wall time in s after which the person who has not opened it yet is told so.
TELL_AFTER = 3.0
#: Wall time in s for its process to end.
STOP_TIMEOUT = 3.0


def page_parameters(live: LiveOptions, mission: str, flight_id: int) -> dict[str, Any]:
    """Parameters of the page's node, which will be served as asked for.

    Args:
        live: how to serve it.
        mission: that is flown.
        flight_id: of the flight; 0: whichever there is.

    Raises:
        CannotStart: it cannot be served so; one line.
    """
    if reason := unmet("ares_view", "live"):
        raise CannotStart(reason)
    try:
        port = free_port(live.host, live.port)
    except AddressError as error:
        raise CannotStart(f"--live-{error}") from error
    return {
        "flight_id": flight_id,
        "mission": mission,
        "host": live.host,
        "port": port,
        "open_browser": live.browser,
    }


class Audience:
    """Who looks at a flight; nobody, if no page was asked for."""

    def __init__(
        self, options: FlyOptions, summary: FlightSummary, say: Callable[[str], None]
    ) -> None:
        """Look whether the page can be served.

        Args:
            options: of the flight, with or without a page.
            summary: of the flight.
            say: gets a line for the person at the terminal.

        Raises:
            CannotStart: it cannot; one line.
        """
        self._live = options.live
        self._summary = summary
        self._say = say
        self._crew: Crew | None = None
        self._held = ExitStack()
        self._parameters: Mapping[str, Any] = {}
        if options.live is not None:
            self._parameters = page_parameters(options.live, options.mission, summary.flight_id)

    def __enter__(self) -> Self:
        """Nobody is there yet."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the process if it still runs."""
        self._held.close()

    def come(self, monitor: "FlightMonitor") -> None:
        """Start to serve the page; the flight does not begin before it is.

        Args:
            monitor: of the flight.
        """
        if self._live is None:
            return
        environment = {**os.environ, "ROS_DOMAIN_ID": str(self._summary.domain_id)}
        self._crew = self._held.enter_context(Crew(environment))
        arguments = ros_arguments(self._parameters, self._summary.namespace)
        self._crew.start(LIVE, MODULE, arguments)
        self._deadline = time.monotonic() + PATIENCE
        self._told = False
        monitor.held = True

    def look(self, monitor: "FlightMonitor") -> None:
        """Let the flight begin when it is time; say if the page has gone.

        Raises:
            CannotStart: it cannot be served; it has said why.
        """
        if self._crew is None or self._live is None:
            return
        for name, status in self._crew.newly_ended():
            if status == EXIT_CANNOT_START and not self._summary.started:
                raise CannotStart("")
            self._say(f"{name} {describe_end(status)}: {PAGELESS}")
            monitor.let_go()
        wanted = 1 if self._live.wait else 0
        left = self._deadline - time.monotonic()
        if monitor.pages >= wanted or left < 0.0:
            monitor.let_go()
        elif not self._told and monitor.pages == 0 and left < PATIENCE - TELL_AFTER:
            self._told = True
            self._say(f"the flight begins when the page is open, in {left:.0f} s at the latest")

    def leave(self, monitor: "FlightMonitor") -> None:
        """The flight is over: tell the page what it came to, and end it."""
        if self._crew is not None and self._crew.running():
            monitor.say_verdict()
            self._crew.stop([LIVE], STOP_TIMEOUT)


@contextmanager
def served(live: LiveOptions, mission: str, namespace: str) -> Iterator[None]:
    """A page on whatever comes, from when it can be opened to the end of the block.

    Args:
        live: how to serve it.
        mission: path of its file; empty: the page has no names of it.
        namespace: of the flight.

    Raises:
        CannotStart: it cannot be served so; one line.
    """
    parameters = page_parameters(live, mission, 0)
    with Crew() as crew:
        crew.start(LIVE, MODULE, ros_arguments(parameters, namespace))
        deadline = time.monotonic() + PATIENCE
        while crew.running() and time.monotonic() < deadline:
            with suppress(OSError):
                socket.create_connection((live.host, parameters["port"]), 1.0).close()
                break
            time.sleep(LOOK_PERIOD)
        yield


def follow(live: LiveOptions, mission: str, namespace: str, domain: int | None) -> NoReturn:
    """Serve a page on whatever flies in a domain, until a signal comes.

    Args:
        live: how to serve it.
        mission: name or path; empty: as the simulator says.
        namespace: of the flight.
        domain: ROS domain; None: that of the environment.

    Raises:
        CannotStart: it cannot be served so; one line.
    """
    from ares_bringup.fly import absolute_namespace, mission_facts

    if mission:
        mission_facts(mission)
    arguments = ros_arguments(page_parameters(live, mission, 0), absolute_namespace(namespace))
    apply_discovery_settings()
    if domain is not None:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
    os.execv(sys.executable, [sys.executable, "-P", "-m", MODULE, *arguments])
