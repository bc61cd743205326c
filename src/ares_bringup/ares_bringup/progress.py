# SPDX-License-Identifier: Apache-2.0
"""Show the progress of long work: share done, time elapsed, time left."""

import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
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


#: Time of a search, s, before its first plain line, and between that and the next.
FIRST_LINE_S, NEXT_LINE_S = 2.0, 10.0


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
    """Show the progress of a search on standard error: a live line, or plain lines now and then.

    Plain lines are for what is no terminal, such as a log.

    Args:
        quiet: hide it.

    Yields:
        A function that accepts the optimizer's progress.
    """
    out = console(sys.stderr)
    if not quiet and not out.is_terminal:
        with _said() as tell:
            yield tell
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=out, transient=True, disable=quiet) as shown:
        task = shown.add_task("searching", total=None)
        yield lambda word: shown.update(task, description=search_line(word))


@contextmanager
def _said() -> Iterator[Callable[["Word"], None]]:
    """Print where a search stands, in lines; nothing for one that is over at once."""
    begin, over = time.monotonic(), threading.Event()
    last = ["searching"]

    def say() -> None:
        pause = FIRST_LINE_S
        while not over.wait(pause):
            pause = NEXT_LINE_S
            line = f"ares: {last[0]}, {time.monotonic() - begin:.0f} s"
            # a closed log is no reason to end a search
            with suppress(OSError, ValueError):
                print(line, file=sys.stderr, flush=True)

    def hear(word: "Word") -> None:
        last[0] = search_line(word)

    # apart from the search, whose kernels tell nothing for long
    speaker = threading.Thread(target=say, name="progress", daemon=True)
    speaker.start()
    try:
        yield hear
    finally:
        over.set()
        speaker.join()
