# SPDX-License-Identifier: Apache-2.0
"""Show the progress of long work: share done, time elapsed, time left."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ares_bringup.report import console, number

if TYPE_CHECKING:
    from ares_optimizer.deadline import Progress as Word


def bar(*columns: ProgressColumn, quiet: bool = False) -> Progress:
    """Make a progress bar on standard error, shown if that is a terminal.

    Args:
        columns: shown after the count.
        quiet: hide it.
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


def search_line(word: "Word") -> str:
    """Describe the progress of a search."""
    mass = "" if math.isnan(word.m_f_kg) else f", {number(word.m_f_kg, 1)} kg"
    return f"{word.method}: iteration {word.iterations}, violation {word.violation:.1e}{mass}"


@contextmanager
def search(quiet: bool = False) -> Iterator[Callable[["Word"], None]]:
    """Show the progress of a search in a line on standard error, if that is a terminal.

    Args:
        quiet: hide it.

    Yields:
        A function that accepts the optimizer's progress.
    """
    out = console(sys.stderr)
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    hidden = quiet or not out.is_terminal
    with Progress(*columns, console=out, transient=True, disable=hidden) as shown:
        task = shown.add_task("searching", total=None)
        yield lambda word: shown.update(task, description=search_line(word))
