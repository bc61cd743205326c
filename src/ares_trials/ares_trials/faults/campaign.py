# SPDX-License-Identifier: Apache-2.0
"""Run many trials, several at a time, and tabulate their results."""

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

from ares_bringup.commands.interrupts import extend_grace, report_interrupt
from ares_bringup.crew import CLOSE_TIMEOUT
from ares_bringup.held import all_pids, clear, shared_memory
from ares_bringup.options import CannotStart
from ares_trials.faults.control import Control, undisturbed
from ares_trials.faults.rows import ROWS
from ares_trials.faults.trial import Class, Trial, run

T = TypeVar("T")

#: Columns of the table.
INJECTED = "injected"
SUMS = (INJECTED, *(kind.value for kind in Class))

EXIT_INTERRUPTED = 130

#: prctl option: get a signal when the parent ends (Linux).
PR_SET_PDEATHSIG = 1


def chosen(words: Sequence[str]) -> list[str]:
    """Return the names of the rows that contain one of the words; all rows without words.

    Raises:
        CannotStart: a word matches no row; one line.
    """
    names = [row.name for row in ROWS]
    for word in words:
        if not any(word in name for name in names):
            raise CannotStart(f"--rows is {word!r}; expected a part of one of: {', '.join(names)}")
    return [name for name in names if not words or any(word in name for word in words)]


def spread(names: Sequence[str], n: int) -> list[tuple[str, int]]:
    """Distribute n trials over the rows in turn; return row and number in it."""
    return [(names[k % len(names)], k // len(names)) for k in range(n)]


def end_with_parent() -> None:
    """Let a worker clean up and end when its parent ends or it gets SIGTERM."""

    def end(number: int, _frame: FrameType | None) -> None:
        # a second signal must not interrupt the clean-up
        signal.signal(number, signal.SIG_IGN)
        # the middleware would print the exception as an error of its callback
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
        raise SystemExit(1)

    signal.signal(signal.SIGTERM, end)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def in_worker(name: str, seed: int, number: int, control: Control | None) -> Trial:
    """Run one trial in a worker, and end the worker on a signal, which the pool would ignore."""
    return _or_end(lambda: run(name, seed, number, control))


def control_in_worker() -> Control:
    """Fly the undisturbed flight in a worker, likewise."""
    return _or_end(undisturbed)


def _or_end(work: Callable[[], T]) -> T:
    with suppress(SystemExit):
        return work()
    # after a signal inside the middleware its context cannot be destroyed
    own = os.getpid()
    others = (pid for pid in all_pids() if pid != own)
    clear(shared_memory([own]) - shared_memory(others))
    os._exit(1)


def fly_all(
    tasks: Sequence[tuple[str, int]], seed: int, workers: int, done: Callable[[Trial], None]
) -> list[Trial]:
    """Run trials in worker processes.

    Args:
        tasks: row and number of each.
        seed: of the campaign.
        workers: number of processes.
        done: gets each trial as it ends.

    Returns:
        The trials in the order of the tasks.

    Raises:
        CannotStart: the flight without a fault does not reach the target; one line.
    """
    flown = {row.name for row in ROWS if row.alone is None}
    context = multiprocessing.get_context("spawn")
    # if the end cannot wait for a worker, Python's resource tracker removes the pool's semaphores,
    # and must not print a warning
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
            # do not wait for running trials
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return [trials[task] for task in tasks]


def counted(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """Tabulate the results: one row per kind of fault flown, with counts by class."""
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
    """Return the output of `ares faults --json`: table, sums, trials that did not survive."""
    rows = counted(trials)
    return {
        "n": n,
        "seed": seed,
        **{key: sum(row[key] for row in rows) for key in SUMS},
        "rows": rows,
        "trials": [trial.to_json() for trial in trials if trial.result != Class.SURVIVED.value],
    }


def show(result: dict[str, Any], console: Console) -> None:
    """Print the table, and the reason of each wrong trial."""
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
    """Run a campaign of faults and print its results; return the exit status.

    Args:
        n: number of trials.
        seed: of the campaign.
        words: select rows whose name contains one of them.
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

        extend_grace(CLOSE_TIMEOUT)
        try:
            trials = fly_all(tasks, seed, workers, done)
        except KeyboardInterrupt:
            flown = round(progress.tasks[task].completed)
            report_interrupt(f"{flown} of {len(tasks)} faults were flown, none is kept")
            return EXIT_INTERRUPTED
    result = as_object(trials, n, seed)
    if as_json:
        print(json.dumps(result, indent=1))
    else:
        show(result, console())
    return int(result[Class.WRONG.value] > 0)
