# SPDX-License-Identifier: Apache-2.0
"""Compute the thesis anew."""

from pathlib import Path
from typing import Annotated

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
