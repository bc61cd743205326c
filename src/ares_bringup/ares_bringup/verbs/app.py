# SPDX-License-Identifier: Apache-2.0
"""Define the command line and the options shared by several verbs.

Imports of a single verb are made in that verb, so that the command line starts fast.
"""

import sys
import time
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperGroup

from ares_bags.errors import printable
from ares_bringup import __version__
from ares_bringup.options import MAX_PORT, CannotStart, LiveOptions, has_display
from ares_bringup.parameter_tables import offered
from ares_guidance.registry import law_names
from ares_models.registry import registered
from ares_node.parameters import Parameter as Row
from ares_node.requirements import unmet

#: Start of the command, s of time.monotonic().
BEGUN = time.monotonic()

#: Default address of pages: this machine only.
LOOPBACK = "127.0.0.1"

EXIT_STATUSES = """Exit status:

\b
  0    flown to the target, or done
  1    flown, but something went wrong: target missed, impact,
       out of propellant, a part not jettisoned, a node lost, bag incomplete
  2    could not start: bad input, in one line on standard error
  130  interrupted; what was flown is in the bag
  143  ended by SIGTERM, which a flight takes for an interruption

\b
Flown to the target means: radius within 100 m, speed 0.1 m/s, flight-path
angle 0.001 deg, inclination, node and argument of perigee 0.01 deg.
"""

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

#: Entry points of this group are verbs.
VERBS = "ares_bringup.verbs"

LAWS_HELP = f"Guidance law: {', '.join(law_names())}, or one of your own."
MissionOption = Annotated[
    str, typer.Option(help="Name that `ares missions` lists, or path of a mission file.")
]
OtherMission = Annotated[
    str | None,
    typer.Option(help="Mission to take instead of the one in the bag; needed if there is none."),
]
#: Laws that need the optimizer's node; a test compares this with the laws.
TOLD_OF_A_TRAJECTORY = ("peg_thesis",)
SELF_STARTING_HELP = LAWS_HELP.replace("".join(f", {name}" for name in TOLD_OF_A_TRAJECTORY), "")
TablesOrJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON object instead of the tables.")
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
    list[str] | None, typer.Argument(metavar="[NAME|PATH]...", help="Show and check these only.")
]
SchemaOut = Annotated[
    Path | None, typer.Option(help="Write it to this file, which must not exist.")
]


class BadInput(Exception):
    """Report in one line that the command cannot do what was requested."""


class _Lists(TyperGroup):
    """Run the default command unless a subcommand follows."""

    #: Default command.
    default = "list"

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the default command before a word that is no subcommand."""
        if not args or args[0] not in (*self.commands, *ctx.help_option_names):
            args = [self.default, *args]
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
    """Accept the options before the verb."""


def add_registered_verbs() -> None:
    """Take up the verbs that other packages register: `name = module:function`.

    One that cannot be imported says so, in one line, where it is called.
    """
    for name, entry in sorted(registered(VERBS).items()):
        try:
            verb = entry.load()
        except (ImportError, AttributeError) as error:
            verb = _refusing(f"{entry.value} cannot be imported: {error}")
        app.command(name)(verb)


def _refusing(reason: str) -> Callable[[], None]:
    def verb() -> None:
        raise CannotStart(one_line(reason))

    return verb


def with_settings(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a verb options for parameters of the nodes, in place of its `**settings`.

    The verb gets those that were given, by parameter name.

    Args:
        names: of the options; none: all that the nodes offer and that the verb has not itself.
    """
    rows = offered()

    def decorate(verb: Callable[..., None]) -> Callable[..., None]:
        own = [p for p in signature(verb).parameters.values() if p.kind is not p.VAR_KEYWORD]
        taken = {p.name for p in own}
        mine = {name: rows[name] for name in names or rows if name not in taken}

        @wraps(verb)
        def called(**given: Any) -> None:
            chosen = {
                row.name: value
                for name, row in mine.items()
                if (value := given.pop(name)) is not None
            }
            verb(**given, **chosen)

        more = [
            Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=_annotation(row))
            for name, row in mine.items()
        ]
        called.__signature__ = Signature([*own, *more])  # type: ignore[attr-defined]
        return called

    return decorate


def _annotation(row: Row) -> Any:
    kind: Any = Literal[row.choices] if row.choices else type(row.default)
    option = typer.Option(min=row.minimum, max=row.maximum, help=row.text)
    return Annotated[kind | None, option]


def needs(extra: str) -> None:
    """Check that the packages of an extra are installed.

    Raises:
        CannotStart: they are not; one line.
    """
    reason = unmet("ares_bringup", extra)
    if reason is not None:
        raise CannotStart(reason)


def one_line(text: str) -> str:
    """Join a text to one printable line."""
    return printable(" ".join(text.split()))


def live_options(host: str, port: int, no_browser: bool, as_json: bool) -> LiveOptions:
    """Make the options of the live page, opened and awaited if a terminal is attached."""
    watched = sys.stderr.isatty() and not as_json
    return LiveOptions(host, port, watched and not no_browser and has_display(), watched)


def check_page(live: bool, host: str, port: int, no_browser: bool) -> None:
    """Check that options of the page are given only with the page.

    Raises:
        BadInput: one is given without it.
    """
    if not live and (host != LOOPBACK or port or no_browser):
        raise BadInput("--live-host, --live-port and --no-browser go with --live only")
