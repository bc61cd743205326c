# SPDX-License-Identifier: Apache-2.0
"""What a flight is asked to be. No ROS."""

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ares_guidance.law import LawKind

#: Highest seed, and highest number of flights: their draws and noise are keyed by them.
MAX_SEED = 2**63 - 1
MAX_FLIGHTS = 10**8
#: Port where Foxglove looks unless told otherwise, and the highest that there is.
FOXGLOVE_PORT = 8765
MAX_PORT = 65535
#: The guidance law that is flown unless another is named.
PEG = "peg"
#: Highest ROS domain id; the ports of a higher one do not exist.
MAX_DOMAIN_ID = 232
#: How often a node that ends in flight is restarted unless another number is given, and at most.
RESTARTS = 3
MAX_RESTARTS = 100


class CannotStart(Exception):
    """What was asked for cannot start; the text is one line, empty if a node has said why."""


def self_starting(guidance: str) -> "LawKind":
    """The law of a flight that has no optimizer's node to ask.

    Raises:
        CannotStart: it has to be told of a trajectory; one line.
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


class HeatingSource(StrEnum):
    """What times a heating jettison, by the names of the parameter `heating_source`."""

    MEASURED = "measured"
    MODEL = "model"


class InitialGuess(StrEnum):
    """Where the guidance law starts, by the names of the parameter `initial_guess`."""

    NONE = "none"
    OPTIMIZER = "optimizer"
    ANALYTIC = "analytic"


class Maximize(StrEnum):
    """What `optimize` may seek the most of, besides the mass at cut-off."""

    PAYLOAD = "payload"


class AnalyticProfile(StrEnum):
    """Polynomials of method `analytic`, by their names there."""

    THESIS = "thesis"
    IMPROVED = "improved"


class PositionIntegral(StrEnum):
    """Position integrals of method `analytic`, by their names there."""

    EXACT = "exact"
    TRAPEZOID = "trapezoid"
    QUADRATIC = "quadratic"


class JettisonTarget(StrEnum):
    """Where method `analytic` finds its jettison target, by the names there."""

    MISSION = "mission"
    OPTIMIZER = "optimizer"


class Heating(StrEnum):
    """Where the optimizer holds a heating limit, by its names in `ares_optimizer.solve`."""

    AT_JETTISON = "at_jettison"
    FROM_JETTISON = "from_jettison"
    IGNORED = "ignored"


class ExportFormat(StrEnum):
    """Formats of `ares export`, by the ends of their files."""

    CSV = "csv"
    PARQUET = "parquet"
    KML = "kml"
    CZML = "czml"


class ExportTable(StrEnum):
    """Tables of a flight."""

    FLIGHT = "flight"
    EVENTS = "events"


@dataclass(frozen=True)
class LiveOptions:
    """The page that follows a flight.

    Attributes:
        host: address to serve on; beyond this machine the page has a token.
        port: 0 takes a free one.
        browser: open the page.
        wait: let the flight begin when the page is open, or after a while.
    """

    host: str = "127.0.0.1"
    port: int = 0
    browser: bool = False
    wait: bool = False


@dataclass(frozen=True)
class FlyOptions:
    """One flight.

    Attributes:
        mission: name of a shipped mission or path of a mission file.
        guidance: guidance law.
        in_process: all nodes in this process instead of one process each.
        record: write a bag.
        bag: folder of the bag; None takes a new name in the project's bags folder.
        seed: seed of dispersions and navigation errors.
        dispersions: name of shipped dispersions or path of a file; None flies the mission
            exactly, or as a campaign would if a flight is named.
        failure: what fails, as `ares_models.failures.read_failure` takes it; None: nothing does.
        flight: number of a campaign's flight, stepped as there; None: flight 0 of the seed,
            stepped as any flight.
        sealed: draw a key, by which the nodes prove to each other who says what.
        pace: real-time factor; 0 flies as fast as guidance answers.
        navigation_period_s: flight time between navigation states; None: the node's default.
        cycle_period_s: flight time between guidance cycles; None: the node's default.
        hold_time_s: time to go from which the steering is held; None: the node's default.
        heating_source: what times a heating jettison; None: the node's default.
        initial_guess: where the guidance law starts; the optimizer's node joins for its guess.
            Law peg_thesis takes analytic for none.
        attitude_rate_limit_deg_s: fastest turn of the thrust; 0: none.
        view: start the view node too.
        foxglove_port: where Foxglove gets what the view node shows, which is then started; 0: not.
        domain_id: ROS domain; None: that of ROS_DOMAIN_ID, else one that no other flight has.
        namespace: namespace of all nodes and topics.
        live: the page that follows the flight; None: none.
        restarts: how often guidance, optimizer and view are each restarted if they end in flight.
        arguments: further command line of nodes, by their names: what no option sets.
    """

    mission: str = "ares_v"
    guidance: str = PEG
    in_process: bool = False
    sealed: bool = False
    record: bool = True
    bag: Path | None = None
    seed: int = 0
    dispersions: str | None = None
    failure: str | None = None
    flight: int | None = None
    pace: float = 0.0
    navigation_period_s: float | None = None
    cycle_period_s: float | None = None
    hold_time_s: float | None = None
    heating_source: HeatingSource | None = None
    initial_guess: InitialGuess = InitialGuess.NONE
    attitude_rate_limit_deg_s: float = 0.0
    view: bool = False
    foxglove_port: int = 0
    domain_id: int | None = None
    namespace: str = "ares"
    live: LiveOptions | None = None
    restarts: int = RESTARTS
    arguments: Mapping[str, Sequence[str]] = field(default_factory=dict)


def has_display() -> bool:
    """Whether a browser would be seen here."""
    names = ("DISPLAY", "WAYLAND_DISPLAY")
    return sys.platform == "darwin" or any(os.environ.get(name) for name in names)


def domain_id(options: FlyOptions) -> int | None:
    """The ROS domain that a flight is told to take: of the options, else of ROS_DOMAIN_ID.

    Returns:
        None if it is told nothing.

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
