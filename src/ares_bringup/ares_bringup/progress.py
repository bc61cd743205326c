"""A bar for what takes long: how much is done, since when, how long it takes still."""

import sys

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ares_bringup.report import console


def bar(*columns: ProgressColumn, quiet: bool = False) -> Progress:
    """A bar on standard error, if that is a terminal.

    Args:
        columns: what it shows besides, behind the count.
        quiet: not at all.
    """
    out = console(sys.stderr)
    return Progress(
        TextColumn("{task.description:<14}"),
        BarColumn(),
        MofNCompleteColumn(),
        *columns,
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=out,
        disable=quiet or not out.is_terminal,
    )
