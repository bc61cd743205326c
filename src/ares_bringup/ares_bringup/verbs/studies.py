# SPDX-License-Identifier: Apache-2.0
"""Define the verbs of studies: optimum, campaigns, aborts."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import typer

from ares_bringup.options import MAX_FLIGHTS, MAX_SEED, PEG, HeatingPhase, Maximize
from ares_bringup.verbs import app as shared
from ares_bringup.verbs.app import BadInput, app, needs
from ares_models.registry import registered
from ares_optimizer.registry import AUTO, method_names

METHODS_HELP = (
    f"How to solve: {', '.join(method_names())}; auto chooses by the mission, and says what it did."
)
#: Entry points of this group answer `optimize --method NAME` in place of the common page: functions
#: of mission, JSON or tables, and time limit, s. Their keyword-only parameters become options.
OPTIMIZE = "ares_bringup.optimize"
#: Most minutes before and after the best launch time.
LONGEST_WINDOW = 60
#: Method that has an option, by the option's parameter; filled by `with_options_of_methods`.
OF_METHODS: dict[str, str] = {}

HeatingHolds = Annotated[
    HeatingPhase | None,
    typer.Option(
        help="When the heating limit holds: at the fairing's jettison, from it on, or never; "
        "default: as in the mission."
    ),
]
HeldJettisons = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=SECONDS", help="Drop a part at this time whatever the heating."),
]
Maximized = Annotated[
    Maximize | None,
    typer.Option(help="Seek the greatest payload_kg of a mission with its masses by item."),
]
LaunchWindow = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=LONGEST_WINDOW,
        metavar="MINUTES",
        help="Seek the launch time of a target with its node, and what each minute costs, up "
        "to so many before and after.",
    ),
]
Beside = Annotated[
    Path | None,
    typer.Option("--beside", metavar="BAG", help="Of --out: lay the flight of this bag over it."),
]
OnlyFlights = Annotated[
    list[int] | None,
    typer.Option(
        min=0, max=MAX_FLIGHTS - 1, metavar="K", help="Fly this flight alone; may be given again."
    ),
]
SuccessWidth = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        metavar="WIDTH",
        help="Stop when the 95 % interval of the share of successes is narrower.",
    ),
]
MassWidth = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        metavar="KG",
        help="Stop when the 95 % interval of the mean final mass is narrower.",
    ),
]


def with_options_of_methods(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the options of registered methods, in place of its last parameter.

    A method whose answer cannot be imported has none, and says why when it is called.
    """
    own = signature(verb)
    options = [p for p in own.parameters.values() if p.kind is not p.VAR_KEYWORD]
    for method, entry in sorted(registered(OPTIMIZE).items()):
        with suppress(ImportError, AttributeError):
            found = signature(entry.load(), eval_str=True).parameters.values()
            more = [p for p in found if p.kind is p.KEYWORD_ONLY]
            OF_METHODS.update((p.name, method) for p in more)
            options += more
    verb.__signature__ = own.replace(parameters=options)  # type: ignore[attr-defined]
    return verb


def _refuse(option: str, others: Mapping[str, object]) -> None:
    """Refuse the first of other options that is given beside one."""
    for name in (name for name, value in others.items() if value):
        raise BadInput(f"{name} does not go with {option}")


@app.command()
@with_options_of_methods
def optimize(
    mission: shared.MissionOption = "ares_v",
    method: Annotated[str, typer.Option(help=METHODS_HELP)] = AUTO,
    heating: HeatingHolds = None,
    hold_jettison: HeldJettisons = None,
    maximize: Maximized = None,
    window: LaunchWindow = None,
    time_limit: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Wall time after which the search is given up, s; "
            "`--maximize` and `--window` make several.",
        ),
    ] = 120.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Write the optimum as a page into this file (.html).")
    ] = None,
    bag: Beside = None,
    **of_methods: Any,
) -> None:
    """Find the optimal ascent off line, with its proof.

    Exit status 0: optimal; 3: feasible, not proven to be the best; 4: infeasible; 1: not found.
    """
    needs("solve")
    own_page = registered(OPTIMIZE).get(method)
    asked = {name: value for name, value in of_methods.items() if value is not None}
    given: dict[str, object] = {
        "--heating": heating,
        "--hold-jettison": hold_jettison,
        "--out": out,
    }
    searched: dict[str, object] = {"--maximize": maximize, "--window": window is not None}
    if bag is not None and out is None:
        raise BadInput("--beside goes with --out only")
    if own_page is not None:
        _refuse(f"--method {method}", given | searched)
        raise typer.Exit(own_page.load()(mission, as_json, time_limit, **asked))
    for name in asked:
        raise BadInput(f"--{name.replace('_', '-')} goes with --method {OF_METHODS[name]} only")
    given["--method"] = method != AUTO
    if maximize is not None:
        _refuse("--maximize", given | {"--window": searched["--window"]})
        from ares_bringup.commands.optimize import optimize_payload

        raise typer.Exit(optimize_payload(mission, as_json, time_limit))
    if window is not None:
        _refuse("--window", given)
        from ares_bringup.commands.launch_window import optimize_launch

        raise typer.Exit(optimize_launch(mission, window, as_json, time_limit))
    if out is not None:
        needs("pages")
        if out.suffix not in (".html", ".htm"):
            raise BadInput(f"--out is {str(out)!r}; expected a file ending in .html")
    from ares_bringup.commands.optimize import optimize as solve

    kept, held = heating and heating.value, tuple(hold_jettison or ())
    raise typer.Exit(solve(mission, method, as_json, kept, held, time_limit, out, bag))


@app.command()
@shared.with_settings("cycle_period", "hold_time", "heating_source", "boost_steering")
def montecarlo(
    n: Annotated[
        int, typer.Option("-n", "--flights", min=1, max=MAX_FLIGHTS, help="Flights.")
    ] = 1000,
    mission: shared.MissionOption = "ares_v",
    guidance: Annotated[str, typer.Option(help=shared.SELF_STARTING_HELP)] = PEG,
    dispersions: Annotated[
        str, typer.Option(help="Shipped dispersions' name, or path of a file.")
    ] = "standard",
    seed: Annotated[
        int, typer.Option(min=0, max=MAX_SEED, help="Master seed of what is drawn.")
    ] = 0,
    only: OnlyFlights = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder, new or of a campaign to go on with; default: a new name."),
    ] = None,
    as_json: shared.TablesOrJson = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Threads; default: one per core.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Fly on the workers of a Dask scheduler.")
    ] = None,
    stop_success: SuccessWidth = None,
    stop_mass: MassWidth = None,
    **settings: Any,
) -> None:
    """Fly dispersed flights in compiled code, keep them in Parquet, judge them."""
    if only and out is not None:
        raise BadInput("--only and --out exclude each other: nothing is kept")
    needs("pages")
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
            law_settings=settings,
            success_width=stop_success,
            mass_width_kg=stop_mass,
        ),
        begun=shared.BEGUN,
    )
    raise typer.Exit(status)


@app.command()
def aborts(
    mission: shared.MissionOption = "ares_v",
    guidance: Annotated[
        str, typer.Option("--guidance", "--law", help=shared.SELF_STARTING_HELP)
    ] = PEG,
    step_s: Annotated[
        float, typer.Option(min=0.1, max=3600.0, help="Between the times of failures, s.")
    ] = 1.0,
    as_json: shared.TablesOrJson = False,
    out: Annotated[Path | None, typer.Option(help="Write the map as an HTML page.")] = None,
) -> None:
    """Fly every failure at every second; compare with the optimizer that knows of it.

    Exit status 1: the map is made, but points failed.
    """
    needs("pages")
    from ares_bringup.commands.aborts import AbortOptions
    from ares_bringup.commands.aborts import aborts as make_map

    options = AbortOptions(mission, guidance, step_s, as_json, out)
    raise typer.Exit(make_map(options))
