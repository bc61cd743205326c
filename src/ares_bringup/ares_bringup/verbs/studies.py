# SPDX-License-Identifier: Apache-2.0
"""Define the verbs of studies: optimum, campaigns, aborts."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ares_bringup.options import (
    MAX_FLIGHTS,
    MAX_SEED,
    PEG,
    AnalyticProfile,
    HeatingPhase,
    JettisonTargetSource,
    Maximize,
    PositionIntegral,
)
from ares_bringup.verbs.app import (
    BEGUN,
    SELF_STARTING_HELP,
    BadInput,
    MissionOption,
    TablesOrJson,
    app,
    needs,
    with_settings,
)
from ares_models.registry import registered
from ares_optimizer.registry import AUTO, method_names

METHODS_HELP = (
    f"How to solve: {', '.join(method_names())}; auto chooses by the mission, and says what it did."
)
#: Entry points of this group answer `optimize --method NAME` in place of the common page.
OPTIMIZE = "ares_bringup.optimize"


@app.command()
def optimize(
    mission: MissionOption = "ares_v",
    method: Annotated[str, typer.Option(help=METHODS_HELP)] = AUTO,
    heating: Annotated[
        HeatingPhase | None,
        typer.Option(
            help="When the heating limit holds: at the fairing's jettison, from it on, or never; "
            "default: as in the mission."
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
        JettisonTargetSource | None,
        typer.Option(help="Of analytic: source of the target of part one; default: mission."),
    ] = None,
    maximize: Annotated[
        Maximize | None,
        typer.Option(help="Seek the greatest payload_kg of a mission with its masses by item."),
    ] = None,
    time_limit: Annotated[
        float, typer.Option(min=0.0, help="Wall time after which the search is given up, s.")
    ] = 30.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Write the optimum as a page into this file (.html).")
    ] = None,
    bag: Annotated[
        Path | None,
        typer.Option(
            "--beside", metavar="BAG", help="Of --out: lay the flight of this bag over it."
        ),
    ] = None,
) -> None:
    """Find the optimal ascent off line, with its proof.

    Exit status 0: optimal; 3: feasible, not proven to be the best; 4: infeasible; 1: not found.
    """
    needs("solve")
    given = {
        "profile": profile and profile.value,
        "position_integral": position_integral and position_integral.value,
        "steps": steps,
        "jettison_target": jettison_target and jettison_target.value,
    }
    asked = {name: value for name, value in given.items() if value is not None}
    own_page = registered(OPTIMIZE).get(method)
    if bag is not None and out is None:
        raise BadInput("--beside goes with --out only")
    if out is not None:
        needs("pages")
        if out.suffix not in (".html", ".htm"):
            raise BadInput(f"--out is {str(out)!r}; expected a file ending in .html")
        if own_page is not None or maximize is not None:
            raise BadInput("--out goes with neither --method analytic nor --maximize")
    if own_page is not None:
        others = {"--heating": heating, "--hold-jettison": hold_jettison}
        refused = [name for name, value in others.items() if value]
        raise typer.Exit(own_page.load()(mission, as_json, refused, asked, time_limit))
    for name in asked:
        raise BadInput(f"--{name.replace('_', '-')} goes with --method analytic only")
    if maximize is not None:
        beside = {
            "--method": method != AUTO,
            "--heating": heating is not None,
            "--hold-jettison": bool(hold_jettison),
        }
        for name in (name for name, there in beside.items() if there):
            raise BadInput(f"{name} does not go with --maximize")
        from ares_bringup.commands.optimize import optimize_payload

        raise typer.Exit(optimize_payload(mission, as_json, time_limit))
    from ares_bringup.commands.optimize import optimize as solve

    status = solve(
        mission,
        method,
        as_json,
        heating.value if heating is not None else None,
        tuple(hold_jettison or ()),
        time_limit,
        out,
        bag,
    )
    raise typer.Exit(status)


@app.command()
@with_settings("cycle_period", "hold_time", "heating_source")
def montecarlo(
    n: Annotated[
        int, typer.Option("-n", "--flights", min=1, max=MAX_FLIGHTS, help="Flights.")
    ] = 1000,
    mission: MissionOption = "ares_v",
    guidance: Annotated[str, typer.Option(help=SELF_STARTING_HELP)] = PEG,
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
        begun=BEGUN,
    )
    raise typer.Exit(status)


@app.command()
def aborts(
    mission: MissionOption = "ares_v",
    guidance: Annotated[str, typer.Option("--guidance", "--law", help=SELF_STARTING_HELP)] = PEG,
    step_s: Annotated[
        float, typer.Option(min=0.1, max=3600.0, help="Between the times of failures, s.")
    ] = 1.0,
    as_json: TablesOrJson = False,
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
