# SPDX-License-Identifier: Apache-2.0
"""Inject faults."""

from typing import Annotated

import typer

from ares_bringup.options import MAX_SEED
from ares_bringup.verbs.app import TablesOrJson


def faults(
    n: Annotated[int, typer.Option("-n", "--trials", min=1, help="Faults in all.")] = 100,
    seed: Annotated[int, typer.Option(min=0, max=MAX_SEED, help="Seed of what is drawn.")] = 0,
    rows: Annotated[
        list[str] | None,
        typer.Option(metavar="WORD", help="Only faults with this word; may be given again."),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Flights at a time.")] = 1,
    as_json: TablesOrJson = False,
) -> None:
    """Inject faults into real flights, say what they came to. Exit status 1: one was wrong."""
    from ares_trials.faults.campaign import faults as fly_faults

    raise typer.Exit(fly_faults(n, seed, rows or (), workers, as_json))
