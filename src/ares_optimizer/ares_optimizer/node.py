"""Optimizer node: serves optimal trajectories, from a mission or from where a flight is."""

from collections.abc import Sequence
from typing import Any

from rclpy.service import Service

from ares_msgs.srv import SolveTrajectory
from ares_node.node import FlightNode
from ares_node.parameters import Parameter
from ares_node.qos import SOLVE_TRAJECTORY
from ares_optimizer.messages import LONGEST, Answers, Response, empty, refuse
from ares_optimizer.request import METHODS

PARAMETERS = (
    Parameter("mission", "ares_v", "Mission of a request that names none."),
    Parameter("method", "auto", "Method of a request that names none.", choices=METHODS),
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
    """Answers `solve_trajectory`, one request after the other, while it is active.

    Requests that come while one is worked on wait in the service's queue: none is lost. The
    node is a process of its own, so the flight never waits for it.
    """

    disposable = True

    def __init__(self, more: Sequence[Parameter] = (), **kwargs: Any) -> None:
        """Declare the parameters; everything else waits for `configure`.

        Args:
            more: parameters of a subclass.
            **kwargs: passed on to FlightNode.
        """
        super().__init__("optimizer", parameters=(*PARAMETERS, *more), **kwargs)
        self._service: Service | None = None

    def configure(self) -> None:
        """Solve the own mission once, so that the solver is compiled."""
        values = self.values
        self._answers = Answers(values["mission"], values["method"], values["time_limit_s"])

    def activate(self) -> None:
        """Offer the service."""
        self._service = self.create_service(SolveTrajectory, SOLVE_TRAJECTORY, self._on_request)

    def deactivate(self) -> None:
        """Withdraw the service; who waits in its queue is told so."""
        service = self._service
        if service is None:
            return
        with service.handle:
            while (taken := service.handle.service_take_request(SolveTrajectory.Request))[1]:
                response = empty()
                refuse(response, Response.NOT_ACTIVE, "the optimizer was deactivated")
                service.send_response(response, taken[1])
        self.destroy_service(service)
        self._service = None

    def _on_request(self, request: SolveTrajectory.Request, _response: Any) -> Any:
        return self._answers.answer(request)
