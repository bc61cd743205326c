"""The `ares` command.

What only one verb needs is imported by that verb: the command line itself starts fast.
"""

import json
import os
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ares_bringup import __version__
from ares_bringup.commands.interrupts import Interrupts
from ares_bringup.options import (
    FOXGLOVE_PORT,
    MAX_DOMAIN_ID,
    MAX_FLIGHTS,
    MAX_PORT,
    MAX_SEED,
    PEG,
    AnalyticProfile,
    CannotStart,
    ExportFormat,
    ExportTable,
    FlyOptions,
    Heating,
    HeatingSource,
    InitialGuess,
    JettisonTarget,
    LiveOptions,
    Method,
    PositionIntegral,
    has_display,
)
from ares_guidance.registry import law_names
from ares_node.requirements import unmet

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

#: Real-time factor of a flight that is looked at, unless another is given.
PACE_TO_WATCH = 10.0
#: Where pages are served: for this machine alone.
LOOPBACK = "127.0.0.1"

EXIT_STATUSES = """Exit status:

\b
  0    flown to the target, or done
  1    flown, but not as it should: target missed, impact, propellant gone,
       something not jettisoned, a node lost, bag incomplete
  2    could not start: bad input, in one line on standard error
  130  interrupted; what was flown is in the bag
  143  ended by SIGTERM, which a flight takes for an interruption

\b
Flown to the target means: radius within 100 m, speed 0.1 m/s, flight-path
angle 0.001 deg, inclination, node and argument of perigee 0.01 deg.
"""

CHECK_STATUSES = """Exit status of --check:

\b
  0    every command and status is equal within 1e-12
  1    they part, or a command is missing: where, and by how much
  2    it cannot be checked, or not to its end
"""

LAWS_HELP = f"Guidance law: {', '.join(law_names())}."

HELP = f"""Fly ascent guidance on ROS 2, and look at what was flown.

{EXIT_STATUSES}
\b
Environment:
  ARES_BAGS      folder of new bags; default `bags` of the workspace
  ROS_DOMAIN_ID  ROS domain of flights; default: each gets one of its own
"""

SETTINGS: dict[str, Any] = {
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
    "add_completion": False,
}

# options that several verbs have
MissionOption = Annotated[
    str, typer.Option(help="Name that `ares missions` lists, or path of a mission file.")
]
UnsaidMission = Annotated[
    str | None, typer.Option(help="Of a bag that does not say which mission was flown.")
]
LawOption = Annotated[str, typer.Option(help=LAWS_HELP)]
TablesOrJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON object instead of the tables.")
]
CyclePeriod = Annotated[float | None, typer.Option(help="Flight time between guidance cycles, s.")]
HoldTime = Annotated[
    float | None, typer.Option(help="Time to go from which the steering is held, s.")
]
HeatingSourceOption = Annotated[
    HeatingSource | None, typer.Option(help="What times the fairing jettison.")
]
LiveHost = Annotated[
    str, typer.Option(help="Serve the page there; beyond this machine its address has a token.")
]
LivePort = Annotated[
    int, typer.Option(min=0, max=MAX_PORT, help="Serve the page there; 0: on a free port.")
]
NoBrowser = Annotated[bool, typer.Option("--no-browser", help="Do not open the page.")]
Namespace = Annotated[str, typer.Option(help="Namespace of all nodes and topics.")]
FilesArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="[NAME|PATH]...", help="Show and check these only."),
]
SchemaOut = Annotated[
    Path | None, typer.Option(help="Write it to this file, which must not exist.")
]


class _Lists(TyperGroup):
    """A verb that lists, or checks what it is given, unless another word follows it."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """What is no word of the verb is a file to list."""
        if not args or args[0] not in (*self.commands, *ctx.help_option_names):
            args = ["list", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    name="ares", help=HELP, context_settings={"help_option_names": ["-h", "--help"]}, **SETTINGS
)
bag_app = typer.Typer(help="Look into recorded flights: info, verify, repair.", **SETTINGS)
app.add_typer(bag_app, name="bag")
LISTS: dict[str, Any] = {
    "cls": _Lists,
    "subcommand_metavar": "[NAME|PATH]... | COMMAND",
    **SETTINGS,
}
missions_app = typer.Typer(
    help="List the shipped missions, or check mission files; new: write one.", **LISTS
)
app.add_typer(missions_app, name="missions")
dispersions_app = typer.Typer(
    help="List the shipped dispersions, or check files; new: propose some.", **LISTS
)
app.add_typer(dispersions_app, name="dispersions")


class BadInput(Exception):
    """The command cannot do what was asked; the text is one line."""


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"ares {__version__}")
        raise typer.Exit


@app.callback()
def _ares(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print version."),
    ] = False,
) -> None:
    """Options before the verb."""


@app.command(epilog=EXIT_STATUSES)
def fly(
    mission: MissionOption = "ares_v",
    guidance: LawOption = PEG,
    in_process: Annotated[
        bool, typer.Option("--in-process", help="All nodes in one process.")
    ] = False,
    as_json: TablesOrJson = False,
    bag: Annotated[
        Path | None,
        typer.Option(help="Folder of the bag, which must not exist; default: a new name."),
    ] = None,
    no_record: Annotated[bool, typer.Option("--no-record", help="Write no bag.")] = False,
    seed: Annotated[
        int, typer.Option(min=0, max=MAX_SEED, help="Seed of dispersions and navigation errors.")
    ] = 0,
    dispersions: Annotated[
        str | None,
        typer.Option(help="Shipped dispersions' name, or path of a file; default: flown exactly."),
    ] = None,
    flight: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=MAX_FLIGHTS - 1,
            help="Number of a campaign's flight: fly it again, stepped as there.",
        ),
    ] = None,
    pace: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Real-time factor; 0: as fast as possible. Default: 10 with --live, else 0.",
        ),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Follow the flight on a page in the browser.")
    ] = False,
    live_host: LiveHost = LOOPBACK,
    live_port: LivePort = 0,
    no_browser: NoBrowser = False,
    nav_period: Annotated[
        float | None, typer.Option(help="Flight time between navigation states, s.")
    ] = None,
    cycle_period: CyclePeriod = None,
    hold_time: HoldTime = None,
    heating_source: HeatingSourceOption = None,
    initial_guess: Annotated[
        InitialGuess,
        typer.Option(help="Where guidance starts: from nothing, or asking the optimizer's node."),
    ] = InitialGuess.NONE,
    attitude_rate_limit: Annotated[
        float, typer.Option(min=0.0, help="Fastest turn of the thrust, deg/s; 0: none.")
    ] = 0.0,
    view: Annotated[
        bool, typer.Option("--view", help="Standard messages for RViz and maps; on with --live.")
    ] = False,
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="Serve all of it to Foxglove and Lichtblick too.")
    ] = False,
    foxglove_port: Annotated[
        int | None,
        typer.Option(min=1, max=MAX_PORT, help=f"Port for --foxglove; default: {FOXGLOVE_PORT}."),
    ] = None,
    domain_id: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=MAX_DOMAIN_ID,
            help="ROS domain; default: ROS_DOMAIN_ID, else one that no other flight has.",
        ),
    ] = None,
    namespace: Namespace = "ares",
) -> None:
    """Fly a mission through the graph, record it, say how it went."""
    if bag is not None and no_record:
        raise BadInput("--bag and --no-record exclude each other")
    if bag is not None and os.path.lexists(bag):
        raise BadInput(f"--bag is {str(bag)!r}, which exists; expected a new folder")
    if foxglove_port is not None and not foxglove:
        raise BadInput("--foxglove-port goes with --foxglove only")
    _check_page(live, live_host, live_port, no_browser)
    page = _live_options(live_host, live_port, no_browser, as_json)
    if pace is None:
        pace = PACE_TO_WATCH if live else 0.0
    from ares_bringup.fly import fly as fly_mission

    options = FlyOptions(
        mission=mission,
        guidance=guidance,
        in_process=in_process,
        record=not no_record,
        bag=bag,
        seed=seed,
        dispersions=dispersions,
        flight=flight,
        pace=pace,
        navigation_period_s=nav_period,
        cycle_period_s=cycle_period,
        hold_time_s=hold_time,
        heating_source=heating_source,
        initial_guess=initial_guess,
        attitude_rate_limit_deg_s=attitude_rate_limit,
        view=view or live,
        foxglove_port=(foxglove_port or FOXGLOVE_PORT) if foxglove else 0,
        domain_id=domain_id,
        namespace=namespace,
        live=page if live else None,
    )
    with ExitStack() as shown:
        show = None
        if not as_json and sys.stderr.isatty():
            from ares_bringup.report import console
            from ares_bringup.terminal import TerminalView

            show = shown.enter_context(TerminalView(console(sys.stderr))).show
        summary = fly_mission(
            options,
            begun=_BEGUN,
            greet=(lambda _line: None) if as_json else typer.echo,
            show=show or (lambda _monitor: None),
        )
    if as_json:
        typer.echo(json.dumps(summary.to_json(), indent=2, allow_nan=False))
    else:
        from ares_bringup.report import console, print_summary

        print_summary(summary, console())
    raise typer.Exit(summary.exit_code)


@app.command()
def optimize(
    mission: MissionOption = "ares_v",
    method: Annotated[Method, typer.Option(help="How to solve.")] = Method.DIRECT11,
    heating: Annotated[
        Heating | None,
        typer.Option(
            help="Where the heating limit holds: when the fairing goes, from then on, nowhere; "
            "default: as the mission says."
        ),
    ] = None,
    hold_jettison: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=SECONDS", help="Drop a part at this time whatever the heating."),
    ] = None,
    profile: Annotated[
        AnalyticProfile | None,
        typer.Option(help="Of analytic: polynomials as printed, or improved (default)."),
    ] = None,
    position_integral: Annotated[
        PositionIntegral | None,
        typer.Option(help="Of analytic: how position is integrated; default: exact."),
    ] = None,
    steps: Annotated[
        tuple[int, int] | None,
        typer.Option(metavar="N1 N2", help="Of analytic: steps of the trapezoid."),
    ] = None,
    jettison_target: Annotated[
        JettisonTarget | None,
        typer.Option(help="Of analytic: target of part one, found from; default: mission."),
    ] = None,
    time_limit: Annotated[
        float, typer.Option(min=0.0, help="Wall time after which the search is given up, s.")
    ] = 30.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Find the optimal ascent off line, with its proof. Exit status 1: no optimum."""
    _needs("solve")
    given = {
        "profile": profile and profile.value,
        "position_integral": position_integral and position_integral.value,
        "steps": steps,
        "jettison_target": jettison_target and jettison_target.value,
    }
    asked = {name: value for name, value in given.items() if value is not None}
    if method is Method.ANALYTIC:
        from ares_bringup.commands.analytic import optimize_analytic

        others = {"--heating": heating, "--hold-jettison": hold_jettison}
        refused = [name for name, value in others.items() if value]
        raise typer.Exit(optimize_analytic(mission, as_json, refused, asked, time_limit))
    for name in asked:
        raise BadInput(f"--{name.replace('_', '-')} goes with --method analytic only")
    from ares_bringup.commands.optimize import optimize as solve

    status = solve(
        mission,
        method.value,
        as_json,
        heating.value if heating is not None else None,
        tuple(hold_jettison or ()),
        time_limit,
    )
    raise typer.Exit(status)


@app.command()
def reproduce(
    out: Annotated[
        Path, typer.Option(help="Folder of the page and of its numbers; made if not there.")
    ] = Path("reproduction"),
) -> None:
    """Compute every table and figure of the thesis anew: one HTML page, one JSON file."""
    _needs("pages")
    from ares_bringup.commands.reproduce import reproduce as reproduce_thesis

    reproduce_thesis(out)


@app.command()
def montecarlo(
    n: Annotated[
        int, typer.Option("-n", "--flights", min=1, max=MAX_FLIGHTS, help="Flights.")
    ] = 1000,
    mission: MissionOption = "ares_v",
    guidance: LawOption = PEG,
    dispersions: Annotated[
        str, typer.Option(help="Shipped dispersions' name, or path of a file.")
    ] = "standard",
    seed: Annotated[
        int, typer.Option(min=0, max=MAX_SEED, help="Master seed of what is drawn.")
    ] = 0,
    only: Annotated[
        list[int] | None,
        typer.Option(
            min=0,
            max=MAX_FLIGHTS - 1,
            metavar="K",
            help="Fly this flight alone; may be given again.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder, new or of a campaign to go on with; default: a new name."),
    ] = None,
    as_json: TablesOrJson = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Threads; default: one per core.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Fly on the workers of a Dask scheduler.")
    ] = None,
    cycle_period: CyclePeriod = None,
    hold_time: HoldTime = None,
    heating_source: HeatingSourceOption = None,
    stop_success: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="WIDTH",
            help="Stop when the 95 % interval of the share of successes is narrower.",
        ),
    ] = None,
    stop_mass: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="KG",
            help="Stop when the 95 % interval of the mean final mass is narrower.",
        ),
    ] = None,
) -> None:
    """Fly dispersed flights in compiled code, keep them in Parquet, judge them."""
    if only and out is not None:
        raise BadInput("--only and --out exclude each other: nothing is kept")
    _needs("pages")
    from ares_bringup.commands.montecarlo import CampaignOptions
    from ares_bringup.commands.montecarlo import montecarlo as fly_campaign

    status = fly_campaign(
        CampaignOptions(
            count=n,
            mission=mission,
            guidance=guidance,
            dispersions=dispersions,
            seed=seed,
            only=tuple(only or ()),
            out=out,
            as_json=as_json,
            workers=workers,
            scheduler=scheduler,
            cycle_period_s=cycle_period,
            hold_time_s=hold_time,
            heating_source=heating_source and heating_source.value,
            success_width=stop_success,
            mass_width_kg=stop_mass,
        ),
        begun=_BEGUN,
    )
    raise typer.Exit(status)


@missions_app.command("list")
def missions_list(files: FilesArgument = None) -> None:
    """List the shipped missions, or check mission files."""
    from ares_bringup.commands.mission_list import show_missions

    raise typer.Exit(show_missions(files or ()))


@missions_app.command("new")
def missions_new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Letters, digits and underscores.")],
    out: Annotated[
        Path | None, typer.Option(help="The file, which must not exist; default: NAME.yaml.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            metavar="MISSION", help="With the numbers of this mission; default: a small launcher."
        ),
    ] = None,
) -> None:
    """Write a mission file with a comment on every key, ready to be flown."""
    from ares_bringup.commands.new_files import new_mission

    new_mission(name, out, like)


@missions_app.command("schema")
def missions_schema(out: SchemaOut = None) -> None:
    """Print the JSON Schema of a mission file, for editors."""
    from ares_bringup.commands.new_files import show_schema
    from ares_models.mission import MISSION

    show_schema(MISSION, out)


@dispersions_app.command("list")
def dispersions_list(files: FilesArgument = None) -> None:
    """List the shipped dispersions, or check dispersions files."""
    from ares_bringup.commands.mission_list import show_dispersions

    raise typer.Exit(show_dispersions(files or ()))


@dispersions_app.command("new")
def dispersions_new(
    mission: MissionOption,
    out: Annotated[
        Path | None,
        typer.Option(help="The file, which must not exist; default: MISSION_dispersions.yaml."),
    ] = None,
) -> None:
    """Propose dispersions that fit a mission's vehicle, each with its reason."""
    from ares_bringup.commands.new_files import new_dispersions

    new_dispersions(mission, out)


@dispersions_app.command("schema")
def dispersions_schema(out: SchemaOut = None) -> None:
    """Print the JSON Schema of a dispersions file, for editors."""
    from ares_bringup.commands.new_files import show_schema
    from ares_vehicle_sim.dispersions import DISPERSIONS

    show_schema(DISPERSIONS, out)


@bag_app.command("info")
def bag_info(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Say what a bag holds, and whether it is whole. Exit status 1: it is damaged."""
    from ares_bringup.commands.bags import show_bag

    raise typer.Exit(show_bag(bag, as_json))


@bag_app.command("verify")
def bag_verify(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check every checksum, index and count, decode every message.

    Exit status 0: all is well; 1: damaged; 2: not a bag.
    """
    from ares_bringup.commands.bags import verify_bag

    raise typer.Exit(verify_bag(bag, as_json))


@bag_app.command("repair")
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
    start: Annotated[float | None, typer.Option(help="Flight time from which on, s.")] = None,
    end: Annotated[float | None, typer.Option(help="Flight time up to which, s.")] = None,
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
    live_host: LiveHost = LOOPBACK,
    live_port: LivePort = 0,
    no_browser: NoBrowser = False,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Publish nothing: give the recorded navigation to guidance as it is now and "
            "compare each command.",
        ),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Of --check: print one JSON object.")
    ] = False,
    mission: Annotated[
        str | None, typer.Option(help="Of --check: in place of the recorded mission.")
    ] = None,
    guidance: Annotated[
        str | None, typer.Option(help="Of --check: law in place of the recorded one.")
    ] = None,
    setting: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Of --check: a parameter of guidance in place of the recorded one; may be given "
            "again.",
        ),
    ] = None,
) -> None:
    """Publish a recorded flight again, with its clock; or check it against guidance.

    On a terminal, space pauses and goes on, + and - change the pace, left and right go 10 s,
    q ends.
    """
    published = (pace, start, end, topic, namespace)
    _check_page(live, live_host, live_port, no_browser)
    if check:
        if loop or live or any(given is not None for given in published):
            raise BadInput("--check publishes nothing: it goes without the options of publishing")
        from ares_bringup.commands.check import check_bag, parse_settings

        given = {"mission": mission, "law": guidance}
        settings = {name: value for name, value in given.items() if value is not None}
        settings |= parse_settings(setting or ())
        raise typer.Exit(check_bag(bag, settings, as_json))
    if as_json or any(given is not None for given in (mission, guidance, setting)):
        raise BadInput("--json, --mission, --guidance and --set go with --check only")
    if start is not None and end is not None and end < start:
        raise BadInput(f"--end is {end:g}; expected at least --start, {start:g}")
    from ares_bringup.commands.bags import replay_bag

    extract = {"topics": topic or None, "start_s": start, "end_s": end, "loop": loop}
    page = _live_options(live_host, live_port, no_browser, False) if live else None
    raise typer.Exit(replay_bag(bag, 1.0 if pace is None else pace, extract, namespace, page))


@app.command()
def live(
    mission: Annotated[
        str, typer.Option(help="Name or path of the mission; default: as the simulator says.")
    ] = "",
    host: LiveHost = LOOPBACK,
    port: LivePort = 0,
    no_browser: NoBrowser = False,
    domain_id: Annotated[
        int | None,
        typer.Option(min=0, max=MAX_DOMAIN_ID, help="ROS domain; default: ROS_DOMAIN_ID, else 0."),
    ] = None,
    namespace: Namespace = "ares",
) -> None:
    """Follow whatever flight or replay there is on a page in the browser, until Ctrl-C."""
    _needs("live")
    from ares_bringup.audience import follow

    page = _live_options(host, port, no_browser, False)
    follow(page, mission, namespace, domain_id)


@app.command()
def plot(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag.")],
    out: Annotated[
        Path | None,
        typer.Option(help="Image file (.png, .svg, .pdf); default: flight.png in the bag."),
    ] = None,
    mission: UnsaidMission = None,
) -> None:
    """Draw a recorded flight; of a damaged bag what is intact, exit status 1."""
    _needs("pages")
    from ares_bringup.commands.plot import plot_bag

    image, missing = plot_bag(bag, out, mission)
    typer.echo(image)
    if missing:
        typer.echo(f"ares: {_one_line(missing)}", err=True)
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
    mission: UnsaidMission = None,
) -> None:
    """Show a recorded flight, or several over each other, on one HTML page."""
    _needs("pages")
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
) -> None:
    """Write a recorded flight for other tools. Exit status 1: the bag is damaged."""
    if table is not None and form not in (ExportFormat.CSV, ExportFormat.PARQUET):
        raise BadInput("--table goes with --format csv and parquet only")
    _needs("pages")
    from ares_bringup.commands.export import export as write_export

    raise typer.Exit(write_export(bag, form, table or ExportTable.FLIGHT, out))


NODES = {
    "sim": "ares_vehicle_sim",
    "guidance": "ares_guidance",
    "optimizer": "ares_optimizer",
    "recorder": "ares_bags",
    "view": "ares_view.standard",
}


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
)
def node(
    context: typer.Context,
    name: Annotated[
        str, typer.Argument(metavar="sim|guidance|optimizer|recorder|view", help="Which node.")
    ],
) -> None:
    """Run one node; what follows its name goes to it."""
    if name not in NODES:
        raise BadInput(f"node is {name!r}; expected one of {', '.join(NODES)}")
    from ares_bringup.discovery import apply_discovery_settings

    apply_discovery_settings()
    os.execv(sys.executable, [sys.executable, "-P", "-m", NODES[name], *context.args])


def _live_options(host: str, port: int, no_browser: bool, as_json: bool) -> LiveOptions:
    """The page, opened and waited for where a person sits before it."""
    watched = sys.stderr.isatty() and not as_json
    return LiveOptions(host, port, watched and not no_browser and has_display(), watched)


def _check_page(live: bool, host: str, port: int, no_browser: bool) -> None:
    if not live and (host != LOOPBACK or port or no_browser):
        raise BadInput("--live-host, --live-port and --no-browser go with --live only")


def _needs(extra: str) -> None:
    reason = unmet("ares_bringup", extra)
    if reason is not None:
        raise CannotStart(reason)


def _one_line(text: str) -> str:
    return " ".join(text.split())


def main(argv: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        argv: without the program's name; default that of this process.

    Returns:
        The exit status.
    """
    with Interrupts() as interrupts:
        status = _run(argv)
    return interrupts.status(status)


def _run(argv: Sequence[str] | None) -> int:
    try:
        status = app(
            args=list(sys.argv[1:] if argv is None else argv),
            prog_name="ares",
            standalone_mode=False,
        )
        return status if isinstance(status, int) else 0
    except (BadInput, CannotStart) as error:
        if str(error):
            print(f"ares: {_one_line(str(error))}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except BrokenPipeError:
        # the reader of our output has gone: nobody is left to complain to
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except Exception as error:
        # usage errors of the command-line library, which prints three lines for each
        if not hasattr(error, "format_message"):
            raise
        message = error.format_message().rstrip(".")
        help_hint = getattr(getattr(error, "ctx", None), "command_path", "ares")
        print(f"ares: {_one_line(message)} (see `{help_hint} --help`)", file=sys.stderr)
        return EXIT_BAD_INPUT


_BEGUN = time.monotonic()

if __name__ == "__main__":
    sys.exit(main())
