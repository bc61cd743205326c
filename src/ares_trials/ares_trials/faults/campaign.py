# SPDX-License-Identifier: Apache-2.0
"""Many trials, some at a time, and the table of what they came to."""

import ctypes
import json
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from types import FrameType
from typing import Any, TypeVar

from rich.console import Console
from rich.table import Table

from ares_bringup.commands.interrupts import grant, tell
from ares_bringup.crew import CLOSE_TIMEOUT
from ares_bringup.held import all_pids, clear, shared_memory
from ares_bringup.options import CannotStart
from ares_trials.faults.control import Control, undisturbed
from ares_trials.faults.rows import ROWS
from ares_trials.faults.trial import Class, Trial, run

T = TypeVar("T")

#: What is counted.
INJECTED = "injected"
SUMS = (INJECTED, *(kind.value for kind in Class))

EXIT_INTERRUPTED = 130

#: A process hears of the end of its parent (Linux).
PR_SET_PDEATHSIG = 1


def chosen(words: Sequence[str]) -> list[str]:
    """Names of the rows that hold one of some words; all without words.

    Raises:
        CannotStart: none holds a word; one line.
    """
    names = [row.name for row in ROWS]
    for word in words:
        if not any(word in name for name in names):
            raise CannotStart(f"--rows is {word!r}; expected a part of one of: {', '.join(names)}")
    return [name for name in names if not words or any(word in name for word in words)]


def spread(names: Sequence[str], n: int) -> list[tuple[str, int]]:
    """So many trials, one of each row after the other: row and number in it."""
    return [(names[k % len(names)], k // len(names)) for k in range(n)]


def end_with_parent() -> None:
    """Let a worker whose parent has gone, or that is told to end, clean up and end."""

    def end(number: int, _frame: FrameType | None) -> None:
        # both may come: the second must not cut the cleaning short
        signal.signal(number, signal.SIG_IGN)
        # the middleware would tell of the end within a callback as of an error of the callback
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
        raise SystemExit(1)

    signal.signal(signal.SIGTERM, end)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def in_worker(name: str, seed: int, number: int, control: Control | None) -> Trial:
    """One trial of a worker; the pool would go on after the end that a signal has asked for."""
    return _or_end(lambda: run(name, seed, number, control))


def control_in_worker() -> Control:
    """The flight without a fault, likewise."""
    return _or_end(undisturbed)


def _or_end(work: Callable[[], T]) -> T:
    with suppress(SystemExit):
        return work()
    # a signal in the middleware's own code leaves a context that nobody can destroy
    own = os.getpid()
    others = (pid for pid in all_pids() if pid != own)
    clear(shared_memory([own]) - shared_memory(others))
    os._exit(1)


def fly_all(
    tasks: Sequence[tuple[str, int]], seed: int, workers: int, done: Callable[[Trial], None]
) -> list[Trial]:
    """Fly trials in worker processes.

    Args:
        tasks: row and number of each.
        seed: of the campaign.
        workers: how many at a time.
        done: gets each as it ends.

    Returns:
        In the order of the tasks.

    Raises:
        CannotStart: the flight without a fault does not reach the target; one line.
    """
    flown = {row.name for row in ROWS if row.alone is None}
    context = multiprocessing.get_context("spawn")
    # an end that cannot wait for a worker leaves the pool's semaphores to Python's tracker, whose
    # process clears them, and need not say so
    sys.warnoptions.append("ignore:resource_tracker")
    trials: dict[tuple[str, int], Trial] = {}
    with ProcessPoolExecutor(workers, mp_context=context, initializer=end_with_parent) as pool:
        try:
            control = None
            if any(name in flown for name, _ in tasks):
                try:
                    control = pool.submit(control_in_worker).result()
                except (OSError, RuntimeError, ValueError, BrokenProcessPool) as error:
                    raise CannotStart(f"the flight without a fault: {error}") from error
            futures = {
                pool.submit(in_worker, name, seed, number, control): (name, number)
                for name, number in tasks
            }
            for future in as_completed(futures):
                name, number = futures[future]
                try:
                    trial = future.result()
                except (OSError, RuntimeError, ValueError, BrokenProcessPool) as error:
                    trial = Trial(name, seed, number, Class.WRONG.value, f"the trial: {error}")
                trials[name, number] = trial
                done(trial)
        except BaseException:
            # their trials are not waited for
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return [trials[task] for task in tasks]


def counted(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """The table: a row per kind of fault that was flown, with how many came to what."""
    rows = []
    for row in ROWS:
        results = [trial.result for trial in trials if trial.row == row.name]
        if results:
            numbers = {kind.value: results.count(kind.value) for kind in Class}
            rows.append(
                {"row": row.name, "expected": row.expected, INJECTED: len(results), **numbers}
            )
    return rows


def as_object(trials: Sequence[Trial], n: int, seed: int) -> dict[str, Any]:
    """What `ares faults --json` prints: table, sums, and each trial that did not survive."""
    rows = counted(trials)
    return {
        "n": n,
        "seed": seed,
        **{key: sum(row[key] for row in rows) for key in SUMS},
        "rows": rows,
        "trials": [trial.to_json() for trial in trials if trial.result != Class.SURVIVED.value],
    }


def show(result: dict[str, Any], console: Console) -> None:
    """Print the table, and why trials were wrong."""
    table = Table(box=None, pad_edge=False)
    table.add_column("fault")
    for key in SUMS:
        table.add_column(key, justify="right")
    for row in (*result["rows"], {**result, "row": "all"}):
        table.add_row(row["row"], *(str(row[key]) for key in SUMS))
    console.print(table)
    for trial in result["trials"]:
        if trial["result"] == Class.WRONG.value:
            line = f"wrong: {trial['row']}, number {trial['number']}: {trial['why']}"
            console.print(line, soft_wrap=True, markup=False)


def faults(n: int, seed: int, words: Sequence[str], workers: int, as_json: bool) -> int:
    """Fly a campaign of faults and print what came of it; the exit status.

    Args:
        n: trials in all.
        seed: of what is drawn.
        words: only rows whose name holds one of them.
        workers: trials at a time.
        as_json: one object instead of the table.
    """
    from ares_bringup.progress import bar
    from ares_bringup.report import console

    tasks = spread(chosen(words), n)
    with bar(quiet=as_json) as progress:
        task = progress.add_task("injecting", total=len(tasks))

        def done(trial: Trial) -> None:
            progress.advance(task)
            if trial.result == Class.WRONG.value:
                line = f"wrong: {trial.row}, number {trial.number}: {trial.why}"
                print(line, file=sys.stderr, flush=True)

        grant(CLOSE_TIMEOUT)
        try:
            trials = fly_all(tasks, seed, workers, done)
        except KeyboardInterrupt:
            flown = round(progress.tasks[task].completed)
            tell(f"{flown} of {len(tasks)} faults were flown, none is kept")
            return EXIT_INTERRUPTED
    result = as_object(trials, n, seed)
    if as_json:
        print(json.dumps(result, indent=1))
    else:
        show(result, console())
    return int(result[Class.WRONG.value] > 0)
