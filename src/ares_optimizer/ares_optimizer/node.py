# SPDX-License-Identifier: Apache-2.0
"""Serve optimal trajectories on the graph, from a mission or from a state in flight."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from rclpy.action.server import ActionServer, CancelResponse, GoalResponse, ServerGoalHandle
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.service import Service

from ares_msgs.action import OptimizeTrajectory
from ares_msgs.srv import SolveTrajectory
from ares_node.node import FlightNode
from ares_node.parameters import Parameter
from ares_node.qos import OPTIMIZE_TRAJECTORY, SOLVE_TRAJECTORY
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.messages import LONGEST, RequestServer, Response, empty, feedback, refuse
from ares_optimizer.registry import method_names
from ares_optimizer.worker import Job, Worker

Result: Any = OptimizeTrajectory.Result

#: Errors raised if the client or the endpoint no longer exists.
GONE = (rclpy_implementation.RCLError, rclpy_implementation.InvalidHandle)
#: Period of feedback, s of wall time.
FEEDBACK_PERIOD = 0.1
#: Wall time for a search to end with the process, s.
LAST_SEARCH = 1.0

PARAMETERS = (
    Parameter("mission", "ares_v", "Mission of a request that names none."),
    Parameter(
        "method",
        "auto",
        "Method of a request that names none.",
        choices=method_names(),
        registered=True,
    ),
    Parameter(
        "time_limit_s",
        5.0,
        "Wall time for a request that sets no limit.",
        unit="s",
        minimum=0.001,
        maximum=LONGEST,
    ),
)


class OptimizerNode(FlightNode):
    """Answer service and action, one request after the other, while active.

    Searches run in a thread of their own, so the node answers a lifecycle manager meanwhile.
    Requests queue during a search; none is lost. The node is a separate process, so a flight never
    waits for it.
    """

    disposable = True

    def __init__(self, more: Sequence[Parameter] = (), **kwargs: Any) -> None:
        """Declare the parameters; `configure` does the rest.

        Args:
            more: parameters of a subclass.
            **kwargs: passed on to FlightNode.
        """
        super().__init__("optimizer", parameters=(*PARAMETERS, *more), **kwargs)
        self._service: Service | None = None
        self._worker: Worker | None = None

    def configure(self) -> None:
        """Solve the default mission once, to compile the solver; create the action."""
        values = self.values
        self.abandon()
        self._answers = RequestServer(values["mission"], values["method"], values["time_limit_s"])
        self._worker = Worker(self._solve)
        self._goals: dict[bytes, Job] = {}
        self._action = ActionServer(
            self,
            OptimizeTrajectory,
            OPTIMIZE_TRAJECTORY,
            execute_callback=Result,
            goal_callback=self._on_offer,
            handle_accepted_callback=self._on_goal,
            cancel_callback=self._on_cancel,
        )

    def activate(self) -> None:
        """Create the service."""
        service: Any = self.create_service(SolveTrajectory, SOLVE_TRAJECTORY, self._on_request)
        # the callback returns the request; _put queues it in place of a response by the executor
        service.send_response = self._put
        self._service = service

    def deactivate(self) -> None:
        """Withdraw the service; answer waiting requests with NOT_ACTIVE."""
        service, worker = self._service, self._worker
        if service is None or worker is None:
            return
        for job in worker.withdraw():
            kind = Response if isinstance(job.request, SolveTrajectory.Request) else Result
            job.answer(_deactivated(kind))
        with service.handle:
            while (taken := service.handle.service_take_request(SolveTrajectory.Request))[1]:
                Service.send_response(service, _deactivated(Response), taken[1])
        self.destroy_service(service)
        self._service = None

    def cleanup(self) -> None:
        """Withdraw the action and end the solver thread."""
        if self._worker is not None:
            self._worker.close()
        if self.executor is None:
            self._withdraw(self._action)
        else:
            # after the results already queued
            self.executor.create_task(self._withdraw, self._action)

    def destroy_node(self) -> None:
        """Destroy the node, and actions that no executor has withdrawn."""
        for waitable in list(self.waitables):
            if isinstance(waitable, ActionServer):
                self._withdraw(waitable)
        super().destroy_node()

    def _withdraw(self, action: ActionServer) -> None:
        if action in self.waitables:
            action.destroy()

    def abandon(self) -> None:
        """Wait for the last search, whose thread must not outlive the process."""
        if self._worker is not None:
            self._worker.wait(LAST_SEARCH)
            self._worker = None

    # ---- searches, in a thread of their own

    def _solve(self, job: Job) -> Any:
        kind = Response if isinstance(job.request, SolveTrajectory.Request) else Result
        return self._answers.answer(job.request, job.deadline, kind)

    # ---- the service

    def _on_request(self, request: SolveTrajectory.Request, _response: Any) -> Any:
        return request

    def _put(self, request: SolveTrajectory.Request, header: Any) -> None:
        service, worker = self._service, self._worker
        if service is None or worker is None:
            return

        def reply(response: Any) -> None:
            with suppress(*GONE):
                Service.send_response(service, response, header)

        worker.put(Job(request, Deadline(), reply))

    # ---- the action

    def _on_offer(self, _goal: OptimizeTrajectory.Goal) -> GoalResponse:
        return GoalResponse.ACCEPT if self._service is not None else GoalResponse.REJECT

    def _on_goal(self, goal: ServerGoalHandle) -> None:
        worker = self._worker
        if worker is None:
            return
        key = bytes(goal.goal_id.uuid)

        def reply(result: Any) -> None:
            del self._goals[key]
            goal.execute(lambda handle: _concluded(handle, result))

        self._goals[key] = Job(goal.request, Deadline(report=_feedback_publisher(goal)), reply)
        worker.put(self._goals[key])

    def _on_cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        job = self._goals.get(bytes(goal.goal_id.uuid))
        if job is None:
            return CancelResponse.REJECT
        job.deadline.end_now()
        return CancelResponse.ACCEPT


def _deactivated(kind: Any) -> Any:
    """Return a response of class ``kind`` that refuses with NOT_ACTIVE."""
    response = empty(kind)
    refuse(response, Response.NOT_ACTIVE, "the optimizer was deactivated")
    return response


def _concluded(goal: ServerGoalHandle, result: Any) -> Any:
    """Set the final state of a goal and return its result."""
    if goal.is_cancel_requested:
        refuse(result, Result.CANCELED, "canceled")
        goal.canceled()
    elif result.error_code == Result.NONE:
        goal.succeed()
    else:
        goal.abort()
    return result


def _feedback_publisher(goal: ServerGoalHandle) -> Callable[[Progress], None]:
    """Return a function that publishes feedback on a goal, at most every FEEDBACK_PERIOD s."""
    last: dict[str, float] = {}

    def publish(progress: Progress) -> None:
        now = time.monotonic()
        if now - last.get(progress.method, -FEEDBACK_PERIOD) >= FEEDBACK_PERIOD:
            last[progress.method] = now
            with suppress(*GONE):
                goal.publish_feedback(feedback(progress))

    return publish
