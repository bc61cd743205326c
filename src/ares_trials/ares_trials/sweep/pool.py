# SPDX-License-Identifier: Apache-2.0
"""Run attempts in worker processes; a crash or a hang is a finding and does not end the sweep."""

import ctypes
import multiprocessing
import os
import resource
import signal
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from multiprocessing.connection import Connection
from pathlib import Path

from ares_trials.sweep.attempts import BROKEN, REFUSED, attempt

#: CPU time limit of one attempt, s, independent of the machine's load.
CPU_LIMIT_S = 60
#: Wall time in s after which an attempt without CPU time is stopped.
WALL_LIMIT_S = 300.0
#: prctl option: kill the worker when its parent ends (Linux).
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Task:
    """Hold a file and the actions to run if it can be read.

    Attributes:
        name: of the input, for the report.
        kind: mission or dispersions.
        text: the file.
        actions: of `attempts.ACTIONS`.
    """

    name: str
    kind: str
    text: str
    actions: tuple[str, ...]


@dataclass(frozen=True)
class Result:
    """Hold the outcome of one attempt.

    Attributes:
        task: the task.
        action: the action.
        outcome: begins with REFUSED, DONE or BROKEN.
    """

    task: Task
    action: str
    outcome: str

    @property
    def broken(self) -> bool:
        """Return whether the outcome is a finding."""
        return self.outcome.startswith(BROKEN)

    @property
    def refused(self) -> bool:
        """Return whether the input was refused in one line."""
        return self.outcome.startswith(REFUSED)

    def __str__(self) -> str:
        return f"{self.task.name}: {self.action}: {self.outcome}"


def _serve(connection: Connection, warm: Sequence[Task]) -> None:
    """Run tasks in a worker: send each action before it runs, and its outcome after."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # a warning would print a second line
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "input.yaml")
        for task in warm:
            # load or compile kernels without a limit
            path.write_text(task.text, "utf-8")
            for action in task.actions:
                attempt(action, path)
        connection.send("")
        while True:
            try:
                task = connection.recv()
            except EOFError:
                return
            path.write_text(task.text, "utf-8")
            for action in (f"read {task.kind}", *task.actions):
                connection.send(action)
                used = resource.getrusage(resource.RUSAGE_SELF)
                limit = int(used.ru_utime + used.ru_stime) + 1 + CPU_LIMIT_S
                resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
                outcome = attempt(action, path)
                connection.send(outcome)
                if action.startswith("read") and outcome.startswith((REFUSED, BROKEN)):
                    break
            connection.send("")


class AttemptWorker:
    """Run attempts in a process; replace it after a crash or a hang.

    Attributes:
        wall_limit_s: wall time after which an attempt is stopped, s.
    """

    def __init__(self, warm: Sequence[Task]) -> None:
        """Start nothing yet.

        Args:
            warm: tasks that each process runs first, without a limit on CPU time.
        """
        self._warm = warm
        self.wall_limit_s = WALL_LIMIT_S
        self._process: multiprocessing.process.BaseProcess | None = None

    @property
    def pid(self) -> int | None:
        """Return the id of the process; None without one."""
        return self._process.pid if self._process else None

    def attempt(self, task: Task) -> list[Result]:
        """Run all of a task; after a crash or a hang a new process continues with the rest."""
        results: list[Result] = []
        todo = task.actions
        while True:
            action = self._try(Task(task.name, task.kind, task.text, todo), task, results)
            if action not in todo:
                return results
            todo = todo[todo.index(action) + 1 :]
            if not todo:
                return results

    def _try(self, rest: Task, task: Task, results: list[Result]) -> str:
        """Run to the end and return "", or return the action that ended the process."""
        if self._process is None:
            self._start()
        action = ""
        try:
            self._connection.send(rest)
            while True:
                action = self._receive()
                if not action:
                    return ""
                outcome = self._receive()
                if not (action.startswith("read") and results):
                    results.append(Result(task, action, outcome))
        except (EOFError, OSError):
            results.append(Result(task, action, f"{BROKEN}: {self._bury()}"))
            return action

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        process = context.Process(target=_serve, args=(other, self._warm), daemon=True)
        process.start()
        other.close()
        self._process = process
        self._receive()

    def _receive(self) -> str:
        if not self._connection.poll(self.wall_limit_s):
            raise EOFError
        text: str = self._connection.recv()
        return text

    def _bury(self) -> str:
        """Describe the end of the process."""
        process = self._process
        self._process = None
        if process is None:
            return "no process"
        process.join(1.0)
        status = process.exitcode
        if status is None:
            process.kill()
            process.join()
            return f"no answer within {self.wall_limit_s:g} s"
        if status == -signal.SIGXCPU:
            return f"hang, more than {CPU_LIMIT_S} s of CPU time"
        return f"crash, {signal.Signals(-status).name if status < 0 else f'exit {status}'}"

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._connection.close()
            self._process.join(5.0)
            self._process.kill()
            self._process.join()
            self._process = None


def attempt_all(tasks: Sequence[Task], warm: Sequence[Task]) -> Iterator[Result]:
    """Run all tasks, one worker per core.

    Args:
        tasks: to run.
        warm: run first by each worker, without a limit.
    """
    count = len(os.sched_getaffinity(0))

    def share(k: int) -> list[Result]:
        worker = AttemptWorker(warm)
        try:
            return list(chain.from_iterable(worker.attempt(task) for task in tasks[k::count]))
        finally:
            worker.close()

    with ThreadPoolExecutor(count) as pool:
        for results in pool.map(share, range(count)):
            yield from results
