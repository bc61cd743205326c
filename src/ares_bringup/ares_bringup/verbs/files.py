# SPDX-License-Identifier: Apache-2.0
"""Define the verbs on missions and dispersions: list, check, new, schema."""

from pathlib import Path
from typing import Annotated

import typer

from ares_bringup.verbs import app as shared


@shared.missions_app.command("list")
def missions_list(files: shared.FilesArgument = None) -> None:
    """List the shipped missions, or check mission files."""
    from ares_bringup.commands.mission_list import show_missions

    raise typer.Exit(show_missions(files or ()))


@shared.missions_app.command("new")
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


@shared.missions_app.command("schema")
def missions_schema(out: shared.SchemaOut = None) -> None:
    """Print the JSON Schema of a mission file, for editors."""
    from ares_bringup.commands.new_files import show_schema
    from ares_models.mission import MISSION

    show_schema(MISSION, out)


@shared.dispersions_app.command("list")
def dispersions_list(files: shared.FilesArgument = None) -> None:
    """List the shipped dispersions, or check dispersions files."""
    from ares_bringup.commands.mission_list import show_dispersions

    raise typer.Exit(show_dispersions(files or ()))


@shared.dispersions_app.command("new")
def dispersions_new(
    mission: shared.MissionOption,
    out: Annotated[
        Path | None,
        typer.Option(help="The file, which must not exist; default: MISSION_dispersions.yaml."),
    ] = None,
) -> None:
    """Propose dispersions that fit a mission's vehicle, each with its reason."""
    from ares_bringup.commands.new_files import new_dispersions

    new_dispersions(mission, out)


@shared.dispersions_app.command("schema")
def dispersions_schema(out: shared.SchemaOut = None) -> None:
    """Print the JSON Schema of a dispersions file, for editors."""
    from ares_bringup.commands.new_files import show_schema
    from ares_vehicle_sim.dispersions import DISPERSIONS

    show_schema(DISPERSIONS, out)
