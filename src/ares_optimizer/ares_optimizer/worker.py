# SPDX-License-Identifier: Apache-2.0
"""One thread that solves what it is asked, one request after the other. No ROS."""

import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

from ares_optimizer.deadline import Deadline


class Job:
    """One request, to be answered once.

    Attributes:
        request: what is asked.
        deadline: by which its search can be ended.
    """

    def __init__(self, request: Any, deadline: Deadline, reply: Callable[[Any], None]) -> None:
        """Nothing is answered yet.

        Args:
            request: what is asked.
            deadline: of the search.
            reply: sends a response, in whatever thread.
        """
        self.request = request
        self.deadline = deadline
        self._reply = reply
        self._open = threading.Lock()

    @property
    def answered(self) -> bool:
        """Tell whether a response was sent."""
        return self._open.locked()

    def answer(self, response: Any) -> None:
        """Send a response, unless another was sent."""
        if self._open.acquire(blocking=False):
            self._reply(response)


class Worker:
    """Takes jobs until it is closed."""

    def __init__(self, solve: Callable[[Job], Any]) -> None:
        """Start the thread.

        Args:
            solve: gives the response to a job; called in the thread.
        """
        self._solve = solve
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._jobs: list[Job] = []
        self._thread = threading.Thread(target=self._run, name="optimizer", daemon=True)
        self._thread.start()

    def put(self, job: Job) -> None:
        """Have a job done, behind those before it."""
        self._jobs.append(job)
        self._queue.put(job)

    def withdraw(self) -> list[Job]:
        """End the search that runs, and those that wait; all that may not be answered yet."""
        jobs = list(self._jobs)
        for job in jobs:
            job.deadline.end_now()
        return jobs

    def close(self) -> None:
        """Take no more jobs, and end the search that runs."""
        self.withdraw()
        self._queue.put(None)

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until a closed worker has come to its end."""
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (job := self._queue.get()) is not None:
            if not job.answered:
                job.answer(self._solve(job))
            self._jobs.remove(job)
