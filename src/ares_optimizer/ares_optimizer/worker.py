# SPDX-License-Identifier: Apache-2.0
"""Solve requests in one thread, in order. No ROS."""

import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

from ares_optimizer.deadline import Deadline


class Job:
    """Hold one request, answered once.

    Attributes:
        request: the request.
        deadline: ends its search.
    """

    def __init__(self, request: Any, deadline: Deadline, reply: Callable[[Any], None]) -> None:
        """Create an unanswered job.

        Args:
            request: the request.
            deadline: of the search.
            reply: sends a response, from any thread.
        """
        self.request = request
        self.deadline = deadline
        self._reply = reply
        self._open = threading.Lock()

    @property
    def answered(self) -> bool:
        """Return true if a response was sent."""
        return self._open.locked()

    def answer(self, response: Any) -> None:
        """Send a response, unless one was sent before."""
        if self._open.acquire(blocking=False):
            self._reply(response)


class Worker:
    """Solve jobs in a thread until closed."""

    def __init__(self, solve: Callable[[Job], Any]) -> None:
        """Start the thread.

        Args:
            solve: returns the response to a job; called in the thread.
        """
        self._solve = solve
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._jobs: list[Job] = []
        self._thread = threading.Thread(target=self._run, name="optimizer", daemon=True)
        self._thread.start()

    def put(self, job: Job) -> None:
        """Queue a job."""
        self._jobs.append(job)
        self._queue.put(job)

    def withdraw(self) -> list[Job]:
        """End the running search and those that wait; return all jobs, answered or not."""
        jobs = list(self._jobs)
        for job in jobs:
            job.deadline.end_now()
        return jobs

    def close(self) -> None:
        """Accept no more jobs, and end the running search."""
        self.withdraw()
        self._queue.put(None)

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the thread of a closed worker to end."""
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (job := self._queue.get()) is not None:
            if not job.answered:
                job.answer(self._solve(job))
            self._jobs.remove(job)
