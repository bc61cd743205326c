# SPDX-License-Identifier: Apache-2.0
"""Define the verbs on recorded flights: bag, replay, plot, report, export."""

from pathlib import Path
from typing import Annotated

import typer

from ares_bringup.options import ExportFormat, ExportTable
from ares_bringup.verbs import app as shared
from ares_bringup.verbs.app import BadInput, app, needs

CHECK_STATUSES = """Exit status of --check:

\b
  0    every command and status is equal within 1e-12
  1    they part, or a command is missing: where, and by how much
  2    it cannot be checked, or not to its end
"""

Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Publish nothing: give the recorded navigation to guidance as it is now and "
        "compare each command.",
    ),
]
CheckSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Of --check: a parameter of guidance in place of the recorded one; may be given "
        "again.",
    ),
]


@shared.bag_app.command("info")
def bag_info(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Say what a bag holds, and whether it is whole.

    Exit status 0: not damaged; 1: damaged; 2: not a bag, or one without an end.
    """
    from ares_bringup.commands.bags import show_bag

    raise typer.Exit(show_bag(bag, as_json))


@shared.bag_app.command("verify")
def bag_verify(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check every checksum, index and count, decode every message.

    Exit status 0: not damaged; 1: damaged; 2: not a bag.
    """
    from ares_bringup.commands.bags import verify_bag

    raise typer.Exit(verify_bag(bag, as_json))


@shared.bag_app.command("repair")
def bag_repair(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a damaged bag.")],
    into: Annotated[
        Path | None, typer.Option(help="Folder of the copy; default: BAG_repaired.")
    ] = None,
) -> None:
    """Copy what is intact of a damaged bag into a new bag.

    Exit status 0: nothing recorded is lost; 1: something is, or it cannot be known; 2: nothing
    to repair, or nothing to save.
    """
    from ares_bringup.commands.bags import repair_bag

    raise typer.Exit(repair_bag(bag, into))


@app.command(epilog=CHECK_STATUSES)
def replay(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    pace: Annotated[
        float | None,
        typer.Option(min=0.0, help="Real-time factor; 0: as fast as readers take it. Default: 1."),
    ] = None,
    start: Annotated[
        float | None, typer.Option(min=-1e9, max=1e9, help="Flight time from which on, s.")
    ] = None,
    end: Annotated[
        float | None, typer.Option(min=-1e9, max=1e9, help="Flight time up to which, s.")
    ] = None,
    loop: Annotated[
        bool, typer.Option("--loop", help="Begin again at the end; the clock jumps back.")
    ] = False,
    topic: Annotated[
        list[str] | None, typer.Option(help="Only this topic; may be given again.")
    ] = None,
    namespace: Annotated[str | None, typer.Option(help="Put in front of every topic name.")] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Follow it on a page in the browser.")
    ] = False,
    live_host: shared.LiveHost = shared.LOOPBACK,
    live_port: shared.LivePort = 0,
    no_browser: shared.NoBrowser = False,
    check: Check = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Of --check: print one JSON object.")
    ] = False,
    mission: Annotated[
        str | None, typer.Option(help="Of --check: in place of the recorded mission.")
    ] = None,
    guidance: Annotated[
        str | None, typer.Option(help="Of --check: law in place of the recorded one.")
    ] = None,
    setting: CheckSettings = None,
) -> None:
    """Publish a recorded flight again, with its clock; or check it against guidance.

    On a terminal, space pauses and goes on, + and - change the pace, left and right go 10 s,
    q ends.
    """
    published = (pace, start, end, topic, namespace)
    shared.check_page(live, live_host, live_port, no_browser)
    if check:
        if loop or live or any(given is not None for given in published):
            raise BadInput("--check publishes nothing: it goes without the options of publishing")
        raise typer.Exit(_check(bag, {"mission": mission, "law": guidance}, setting, as_json))
    if as_json or any(given is not None for given in (mission, guidance, setting)):
        raise BadInput("--json, --mission, --guidance and --set go with --check only")
    if start is not None and end is not None and end < start:
        raise BadInput(f"--end is {end:g}; expected at least --start, {start:g}")
    from ares_bringup.commands.bags import replay_bag

    extract = {"topics": topic or None, "start_s": start, "end_s": end, "loop": loop}
    page = shared.live_options(live_host, live_port, no_browser, False) if live else None
    raise typer.Exit(replay_bag(bag, 1.0 if pace is None else pace, extract, namespace, page))


def _check(
    bag: Path, given: dict[str, str | None], setting: list[str] | None, as_json: bool
) -> int:
    """Check a bag against guidance, with the settings that are given in place of its own."""
    from ares_bringup.commands.check import check_bag, parse_settings

    settings = {name: value for name, value in given.items() if value is not None}
    settings |= parse_settings(setting or ())
    return check_bag(bag, settings, as_json)


@app.command()
def plot(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    out: Annotated[
        Path | None,
        typer.Option(help="Image file (.png, .svg, .pdf); default: flight.png in the bag."),
    ] = None,
    mission: shared.OtherMission = None,
) -> None:
    """Draw a recorded flight; of a damaged bag what is intact, exit status 1."""
    needs("pages")
    from ares_bringup.commands.plot import plot_bag

    image, missing = plot_bag(bag, out, mission)
    typer.echo(image)
    if missing:
        typer.echo(f"ares: {shared.one_line(missing)}", err=True)
        raise typer.Exit(1)


@app.command()
def report(
    bags: Annotated[
        list[Path], typer.Argument(metavar="BAG...", help="Folders of bags, 5 at most.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The page; default: report.html in the bag, of several comparison.html in the "
            "first."
        ),
    ] = None,
    mission: shared.OtherMission = None,
) -> None:
    """Show a recorded flight, or several over each other, on one HTML page."""
    needs("pages")
    from ares_bringup.commands.report import report as write_report

    typer.echo(write_report(bags, out, mission))


@app.command()
def export(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    form: Annotated[
        ExportFormat,
        typer.Option("--format", help="Tables: csv, parquet. Tracks for globes: kml, czml."),
    ],
    table: Annotated[
        ExportTable | None,
        typer.Option(help="Of csv and parquet: a row per state (default), or per event."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="The file; default: flight or events, with the format's end, in the bag."
        ),
    ] = None,
    mission: shared.OtherMission = None,
) -> None:
    """Write a recorded flight for other tools. Exit status 1: the bag is damaged."""
    if table is not None and form not in (ExportFormat.CSV, ExportFormat.PARQUET):
        raise BadInput("--table goes with --format csv and parquet only")
    needs("pages")
    from ares_bringup.commands.export import export as write_export

    raise typer.Exit(write_export(bag, form, table or ExportTable.FLIGHT, out, mission))
