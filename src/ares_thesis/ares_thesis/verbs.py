# SPDX-License-Identifier: Apache-2.0
"""Compute the thesis anew; solve by its analytic method, with the options of that method."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from ares_bringup.verbs.app import needs


def reproduce(
    out: Annotated[
        Path, typer.Option(help="Folder of the page and of its numbers; made if not there.")
    ] = Path("reproduction"),
) -> None:
    """Compute every table and figure of the thesis anew: one HTML page, one JSON file."""
    needs("pages")
    from ares_thesis.commands.reproduce import reproduce as reproduce_thesis

    reproduce_thesis(out)


def optimize_analytic(
    mission: str,
    as_json: bool,
    time_limit_s: float,
    *,
    profile: Annotated[
        Literal["thesis", "improved"] | None,
        typer.Option(help="Of analytic: polynomials as printed, or improved (default)."),
    ] = None,
    position_integral: Annotated[
        Literal["exact", "trapezoid", "quadratic"] | None,
        typer.Option(help="Of analytic: how position is integrated; default: exact."),
    ] = None,
    steps: Annotated[
        tuple[int, int] | None,
        typer.Option(metavar="N1 N2", help="Of analytic: steps of the trapezoid."),
    ] = None,
    jettison_target: Annotated[
        Literal["mission", "optimizer"] | None,
        typer.Option(help="Of analytic: source of the target of part one; default: mission."),
    ] = None,
) -> int:
    """Answer `ares optimize --method analytic`; return the exit status."""
    from ares_thesis.commands.analytic import optimize

    given: dict[str, Any] = {
        "profile": profile,
        "position_integral": position_integral,
        "steps": steps,
        "jettison_target": jettison_target,
    }
    asked = {name: value for name, value in given.items() if value is not None}
    return optimize(mission, as_json, asked, time_limit_s)
