# SPDX-License-Identifier: Apache-2.0
"""Run the live page of a flight in a process of its own, without which the flight goes on."""

import os
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Self

from ares_bringup.bag_paths import bags_folder
from ares_bringup.crew import LOOK_PERIOD, Crew, describe_end, ros_arguments
from ares_bringup.discovery import apply_discovery_settings
from ares_bringup.options import CannotStart, FlyOptions, LiveOptions
from ares_bringup.outcomes import EXIT_CANNOT_START
from ares_bringup.summary import FlightSummary
from ares_node.requirements import unmet
from ares_view.live.address import AddressError, free_port

if TYPE_CHECKING:
    from ares_bringup.monitor import FlightMonitor

LIVE = "live"
MODULE = "ares_view.live"
#: Consequence of the end of its process, for the message.
PAGELESS = "the flight goes on without its page"

#: Wall time in s within which the page must be served; then the flight begins without it.
SERVED_WITHIN = 30.0
#: Wall time in s within which the served page must be opened; then the flight begins without it.
OPENED_WITHIN = 15.0
#: Wall time in s after which the user is told that the flight waits for the page.
TELL_AFTER = 3.0
#: Wall time in s within which its process must end.
STOP_TIMEOUT = 3.0


def page_parameters(
    live: LiveOptions, mission: str, flight_id: int, bag: str, *, stays: bool
) -> dict[str, Any]:
    """Return the parameters of the page's node, checked.

    Args:
        live: options of the page.
        mission: flown mission.
        flight_id: of the flight; 0: the first one heard.
        bag: of the flight, or a folder of bags; "": none.
        stays: end the node after the flight only when no page is open.

    Raises:
        CannotStart: it cannot be served with these options; one line.
    """
    if reason := unmet("ares_view", "live"):
        raise CannotStart(reason)
    try:
        port = free_port(live.host, live.port)
    except AddressError as error:
        raise CannotStart(f"--{live.prefix}{error}") from error
    return {
        "flight_id": flight_id,
        "mission": mission,
        "bag": bag,
        "end_with_pages": stays,
        "host": live.host,
        "port": port,
        "open_browser": live.browser,
    }


class Audience:
    """Run the live page of a flight; do nothing if none was requested."""

    def __init__(
        self, options: FlyOptions, summary: FlightSummary, say: Callable[[str], None]
    ) -> None:
        """Check that the page can be served.

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
            self._parameters = page_parameters(
                options.live,
                options.mission,
                summary.flight_id,
                summary.bag or "",
                stays=options.live.watched,
            )

    def __enter__(self) -> Self:
        """Return the object; start nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the process if it still runs."""
        self._held.close()

    def come(self, monitor: "FlightMonitor") -> None:
        """Start the page's process; hold the flight until the page is served.

        Args:
            monitor: of the flight.
        """
        if self._live is None:
            return
        environment = {**os.environ, "ROS_DOMAIN_ID": str(self._summary.domain_id)}
        self._crew = self._held.enter_context(Crew(environment))
        arguments = ros_arguments(self._parameters, self._summary.namespace)
        self._crew.start(LIVE, MODULE, arguments)
        self._deadline = time.monotonic() + SERVED_WITHIN
        self._served = False
        self._told = False
        monitor.held = True

    def look(self, monitor: "FlightMonitor") -> None:
        """Release the flight when the page is ready or the time is up; report an ended page.

        Raises:
            CannotStart: it cannot be served; its process has printed the reason.
        """
        if self._crew is None or self._live is None:
            return
        for name, status in self._crew.newly_ended():
            if status == EXIT_CANNOT_START and not self._summary.started:
                raise CannotStart("")
            self._say(f"{name} {describe_end(status)}: {PAGELESS}")
            monitor.let_go()
        if monitor.pages >= 0 and not self._served:
            self._served = True
            self._deadline = time.monotonic() + OPENED_WITHIN
        wanted = 1 if self._live.watched else 0
        left = self._deadline - time.monotonic()
        if monitor.pages >= wanted or left < 0.0:
            monitor.let_go()
        elif self._served and not self._told and left < OPENED_WITHIN - TELL_AFTER:
            self._told = True
            self._say(f"the flight begins when the page is open, in {left:.0f} s at the latest")

    def leave(self, monitor: "FlightMonitor") -> None:
        """Send the page the verdict; end its process unless it stays."""
        if self._live is None or self._crew is None or not self._crew.running():
            return
        monitor.say_verdict()
        if self._summary.interrupted or not self._live.watched:
            self._crew.stop([LIVE], STOP_TIMEOUT)

    def stay(self) -> None:
        """Wait until all pages are closed, or for a signal."""
        if self._crew is not None:
            _stay(self._crew, self._say)


def _stay(crew: Crew, say: Callable[[str], None]) -> None:
    from ares_node.run import StopSignals

    begun, told = time.monotonic(), False
    stop = StopSignals(lambda: False)
    stop.starting = False
    with stop.watch():
        while crew.running() and not stop.requested:
            if not told and time.monotonic() - begun > STOP_TIMEOUT:
                told = True
                say("the page stays until it is closed; Ctrl-C ends it too")
            time.sleep(LOOK_PERIOD)
    crew.stop([LIVE], STOP_TIMEOUT)


@contextmanager
def served(
    live: LiveOptions, mission: str, namespace: str, bag: Path, say: Callable[[str], None]
) -> Iterator[Callable[[], None]]:
    """Serve a page on a replay until the end of the block; wait until it can be opened.

    Args:
        live: options of the page.
        mission: path of its file; "": the page has no names from it.
        namespace: of the flight.
        bag: replayed bag.
        say: gets a line for the person at the terminal.

    Yields:
        a function that waits until all pages are closed; it returns at once without a terminal.

    Raises:
        CannotStart: it cannot be served with these options; one line.
    """
    parameters = page_parameters(live, mission, 0, str(bag.absolute()), stays=live.watched)
    with Crew() as crew:
        crew.start(LIVE, MODULE, ros_arguments(parameters, namespace))
        deadline = time.monotonic() + SERVED_WITHIN
        while crew.running() and time.monotonic() < deadline:
            with suppress(OSError):
                socket.create_connection((live.host, parameters["port"]), 1.0).close()
                break
            time.sleep(LOOK_PERIOD)
        yield lambda: _stay(crew, say) if live.watched else None


def follow(live: LiveOptions, mission: str, namespace: str, domain: int | None) -> NoReturn:
    """Serve a page on any flight in a domain, until a signal comes.

    Args:
        live: options of the page.
        mission: name or path; "": the one announced by the flight.
        namespace: of the flight.
        domain: ROS domain; None: that of the environment.

    Raises:
        CannotStart: it cannot be served with these options; one line.
    """
    from ares_bringup.inputs import absolute_namespace, mission_facts

    if mission:
        mission_facts(mission)
    parameters = page_parameters(live, mission, 0, str(bags_folder()), stays=False)
    arguments = ros_arguments(parameters, absolute_namespace(namespace))
    apply_discovery_settings()
    if domain is not None:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
    os.execv(sys.executable, [sys.executable, "-P", "-m", MODULE, *arguments])
