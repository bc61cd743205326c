# SPDX-License-Identifier: Apache-2.0
"""Define the options of a flight. No ROS."""

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ares_guidance.law import LawKind
    from ares_models.mission import Mission

#: Highest seed and highest number of flights, which key the random streams.
MAX_SEED = 2**63 - 1
MAX_FLIGHTS = 10**8
#: Default port of Foxglove; highest port.
FOXGLOVE_PORT = 8765
MAX_PORT = 65535
#: Mission of `ares fly` where none is named.
FROM_THE_PAD = "delta_iii_pad"
#: Default guidance law.
PEG = "peg"
#: Highest ROS domain id; the ports of a higher one do not exist.
MAX_DOMAIN_ID = 232
#: Default and highest number of restarts of a node that ends in flight.
RESTARTS = 3
MAX_RESTARTS = 100


class CannotStart(Exception):
    """Report in one line why a request cannot start; "" if a node has printed the reason."""


def refusal(
    error: Exception, mission: "Mission | None" = None, name: str | None = None
) -> CannotStart:
    """Fold an error into one line, with the names of a mission's arcs and jettisons.

    Args:
        error: what is wrong.
        mission: that it concerns; None: none.
        name: of the mission, shipped, or path of its file: a key that the error begins with gets
            file and line; None: it gets none.
    """
    from ares_models.mission_warnings import at_its_line

    text = " ".join(str(error).split())
    text = mission.with_names(text) if mission else text
    return CannotStart(at_its_line(text, name) if mission and name else text)


@contextmanager
def refusals(*kinds: type[Exception]) -> Iterator[None]:
    """Convert errors of some kinds to CannotStart, in one line; by default those of values."""
    caught = kinds or (ValueError,)
    try:
        yield
    except caught as error:
        raise refusal(error) from error


def self_starting(guidance: str) -> "LawKind":
    """Return a guidance law that needs no trajectory of the optimizer's node.

    Raises:
        CannotStart: it needs one; one line.
        ValueError: no such law; one line.
    """
    from ares_guidance.laws import find_law, self_starting_laws

    law = find_law(guidance)
    if law.needs_trajectory:
        raise CannotStart(
            f"--guidance is {guidance!r}; expected a law that starts by itself: "
            f"one of {', '.join(self_starting_laws())}"
        )
    return law


class Maximize(StrEnum):
    """Name the objectives of `optimize` other than the mass at cut-off."""

    PAYLOAD = "payload"


class HeatingPhase(StrEnum):
    """Name the phases in which the optimizer holds a heating limit, as `ares_optimizer.solve`."""

    AT_JETTISON = "at_jettison"
    FROM_JETTISON = "from_jettison"
    IGNORED = "ignored"


class ExportFormat(StrEnum):
    """Name the formats of `ares export` by their file extensions."""

    CSV = "csv"
    PARQUET = "parquet"
    KML = "kml"
    CZML = "czml"


class ExportTable(StrEnum):
    """Name the tables of a flight."""

    FLIGHT = "flight"
    EVENTS = "events"


@dataclass(frozen=True)
class LiveOptions:
    """Hold the options of the live page.

    Attributes:
        host: address to serve on; beyond this machine the page has a token.
        port: 0 takes a free one.
        browser: open the page.
        watched: start the flight when the page is open, or after a time limit, and serve the
            page until it is closed: for a person at a terminal.
        prefix: of the options `host` and `port` on the command line.
    """

    host: str = "127.0.0.1"
    port: int = 0
    browser: bool = False
    watched: bool = False
    prefix: str = "live-"


@dataclass(frozen=True)
class FlyOptions:
    """Hold the options of one flight.

    Attributes:
        mission: name of a shipped mission or path of a mission file.
        guidance: guidance law.
        in_process: all nodes in this process instead of one process each.
        sealed: draw a key with which the nodes authenticate their messages.
        record: write a bag.
        bag: folder of the bag; None: a new name in the project's bags folder.
        settings: parameters of the nodes by name. Dispersions that are not given are none, or those
            of a campaign if a flight is given; the optimizer's node joins for an initial guess.
        flight: number of a campaign's flight, stepped as there; None: flight 0 of the seed,
            stepped as a single flight.
        view: start the view node too.
        foxglove_port: port for Foxglove; starts the view node too; 0: none.
        domain_id: ROS domain; None: that of ROS_DOMAIN_ID, else one without another flight.
        namespace: namespace of all nodes and topics.
        live: options of the live page; None: no page.
        restarts: restarts allowed of each of guidance, optimizer and view in flight.
        arguments: further command-line arguments by node name.
    """

    mission: str = FROM_THE_PAD
    guidance: str = PEG
    in_process: bool = False
    sealed: bool = False
    record: bool = True
    bag: Path | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    flight: int | None = None
    view: bool = False
    foxglove_port: int = 0
    domain_id: int | None = None
    namespace: str = "ares"
    live: LiveOptions | None = None
    restarts: int = RESTARTS
    arguments: Mapping[str, Sequence[str]] = field(default_factory=dict)


def has_display() -> bool:
    """Tell whether a browser would be visible here."""
    names = ("DISPLAY", "WAYLAND_DISPLAY")
    return sys.platform == "darwin" or any(os.environ.get(name) for name in names)


def domain_id(options: FlyOptions) -> int | None:
    """Return the requested ROS domain: that of the options, else of ROS_DOMAIN_ID.

    Returns:
        None if none is requested.

    Raises:
        CannotStart: it is not an integer from 0 to 232.
    """
    if options.domain_id is not None:
        text, source = str(options.domain_id), "domain id"
    else:
        text, source = os.environ.get("ROS_DOMAIN_ID", ""), "ROS_DOMAIN_ID"
        if not text:
            return None
    if not text.isascii() or not text.isdigit() or int(text) > MAX_DOMAIN_ID:
        raise CannotStart(f"{source} is {text!r}; expected an integer from 0 to {MAX_DOMAIN_ID}")
    return int(text)
