# SPDX-License-Identifier: Apache-2.0
"""Define the verb that flies a mission."""

import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ares_bringup.options import (
    FOXGLOVE_PORT,
    FROM_THE_PAD,
    MAX_DOMAIN_ID,
    MAX_FLIGHTS,
    MAX_PORT,
    MAX_RESTARTS,
    PEG,
    RESTARTS,
    FlyOptions,
)
from ares_bringup.verbs import app as shared
from ares_bringup.verbs.app import BadInput, app

if TYPE_CHECKING:
    from ares_bringup.summary import FlightSummary

#: Default real-time factor of a flight with a live page.
PACE_TO_WATCH = 10.0

NewBag = Annotated[
    Path | None, typer.Option(help="Folder of the bag, which must not exist; default: a new name.")
]
CampaignFlight = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=MAX_FLIGHTS - 1,
        help="Number of a campaign's flight: fly it again, stepped as there.",
    ),
]
FoxglovePort = Annotated[
    int | None,
    typer.Option(min=1, max=MAX_PORT, help=f"Port for --foxglove; default: {FOXGLOVE_PORT}."),
]
DomainId = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=MAX_DOMAIN_ID,
        help="ROS domain; default: ROS_DOMAIN_ID, else one that no other flight has.",
    ),
]
MostRestarts = Annotated[
    int,
    typer.Option(
        min=0,
        max=MAX_RESTARTS,
        help="How often guidance, optimizer and view are each restarted if they end in flight.",
    ),
]


@app.command(epilog=shared.EXIT_STATUSES)
@shared.with_settings()
def fly(
    mission: shared.MissionOption = FROM_THE_PAD,
    guidance: Annotated[str, typer.Option(help=shared.LAWS_HELP)] = PEG,
    in_process: Annotated[
        bool, typer.Option("--in-process", help="All nodes in one process.")
    ] = False,
    sealed: Annotated[
        bool, typer.Option("--sealed", help="Draw a key: nodes refuse messages without its proof.")
    ] = False,
    as_json: shared.TablesOrJson = False,
    bag: NewBag = None,
    no_record: Annotated[bool, typer.Option("--no-record", help="Write no bag.")] = False,
    flight: CampaignFlight = None,
    live: Annotated[
        bool,
        typer.Option("--live", help="Follow the flight in the browser; default of --pace: 10."),
    ] = False,
    live_host: shared.LiveHost = shared.LOOPBACK,
    live_port: shared.LivePort = 0,
    no_browser: shared.NoBrowser = False,
    view: Annotated[
        bool, typer.Option("--view", help="Standard messages for RViz and maps; on with --live.")
    ] = False,
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="Serve all of it to Foxglove and Lichtblick too.")
    ] = False,
    foxglove_port: FoxglovePort = None,
    domain_id: DomainId = None,
    namespace: shared.Namespace = "ares",
    restarts: MostRestarts = RESTARTS,
    **settings: Any,
) -> None:
    """Fly a mission through the graph, record it, say how it went."""
    _check_bag(bag, no_record)
    if foxglove_port is not None and not foxglove:
        raise BadInput("--foxglove-port goes with --foxglove only")
    shared.check_page(live, live_host, live_port, no_browser)
    page = shared.live_options(live_host, live_port, no_browser, as_json)
    if live:
        settings.setdefault("pace", PACE_TO_WATCH)
    options = FlyOptions(
        mission=mission,
        guidance=guidance,
        in_process=in_process,
        sealed=sealed,
        record=not no_record,
        bag=bag,
        settings=settings,
        flight=flight,
        view=view or live,
        foxglove_port=(foxglove_port or FOXGLOVE_PORT) if foxglove else 0,
        domain_id=domain_id,
        namespace=namespace,
        live=page if live else None,
        restarts=restarts,
    )
    raise typer.Exit(_fly(options, as_json))


def _check_bag(bag: Path | None, no_record: bool) -> None:
    """Refuse a bag that is not recorded, or whose folder exists."""
    if bag is not None and no_record:
        raise BadInput("--bag and --no-record exclude each other")
    if bag is not None and os.path.lexists(bag):
        raise BadInput(f"--bag is {str(bag)!r}, which exists; expected a new folder")


def _fly(options: FlyOptions, as_json: bool) -> int:
    """Fly, show the progress, print the summary as tables or as one JSON object."""
    from ares_bringup.doubts import show_warnings
    from ares_bringup.fly import fly as fly_mission

    show_warnings(options.mission)
    with ExitStack() as shown:
        show = None
        if not as_json and sys.stderr.isatty():
            from ares_bringup.report import console
            from ares_bringup.terminal import TerminalView

            show = shown.enter_context(TerminalView(console(sys.stderr))).show

        def tell(summary: "FlightSummary") -> None:
            shown.close()
            _tell(summary, as_json)

        summary = fly_mission(
            options,
            begun=shared.BEGUN,
            greet=(lambda _line: None) if as_json else typer.echo,
            show=show or (lambda _monitor: None),
            tell=tell,
        )
    return summary.exit_code


def _tell(summary: "FlightSummary", as_json: bool) -> None:
    if summary.interrupted and not summary.started and not as_json:
        # no event to tabulate
        kept = f"; the bag {summary.bag} is empty" if summary.bag else "; nothing was written"
        print(f"ares: interrupted before the flight began{kept}", file=sys.stderr)
    elif as_json:
        from ares_bringup.plain_json import print_json
        from ares_bringup.summary_json import to_json

        print_json(to_json(summary))
    else:
        from ares_bringup.report import console, print_summary

        print_summary(summary, console())
    sys.stdout.flush()
