"""Optimizer node: serves optimal trajectories, from a mission or from where a flight is."""

import sys
import time
import traceback
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import NAVIGATION
from ares_models.mission import MissionError, load_mission
from ares_msgs.msg import NavState
from ares_msgs.srv import SolveTrajectory
from ares_node.node import FlightNode
from ares_node.parameters import Parameter
from ares_node.qos import SOLVE_TRAJECTORY
from ares_node.run import run_node
from ares_node.time import NANOSECONDS, ns_from_stamp
from ares_optimizer.solution import OptimizerError, Solution
from ares_optimizer.solve import METHODS, solve

Response: Any = SolveTrajectory.Response

PARAMETERS = (
    Parameter("mission", "ares_v", "Mission of a request that names none."),
    Parameter("method", "indirect", "Method of a request that names none.", choices=METHODS),
    Parameter(
        "time_limit_s",
        5.0,
        "Wall time for a request that sets no limit.",
        unit="s",
        minimum=0.001,
        maximum=3600.0,
    ),
)


class OptimizerNode(FlightNode):
    """Answers `solve_trajectory`, one request after the other.

    Requests that come while one is worked on wait in the service's queue: none is lost. The
    node is a process of its own, so the flight never waits for it.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Declare the parameters; everything else waits for `configure`."""
        super().__init__("optimizer", parameters=PARAMETERS, **kwargs)

    def configure(self) -> None:
        """Solve the own mission once, so that the solver is compiled, then offer the service."""
        solve(load_mission(self.values["mission"]), self.values["method"])
        self._active = False
        self._service = self.create_service(SolveTrajectory, SOLVE_TRAJECTORY, self._on_request)

    def activate(self) -> None:
        """Begin to solve."""
        self._active = True

    def deactivate(self) -> None:
        """Refuse requests."""
        self._active = False

    def cleanup(self) -> None:
        """Withdraw the service."""
        self.destroy_service(self._service)

    def _on_request(self, request: SolveTrajectory.Request, response: Any) -> Any:
        try:
            self._serve(request, response)
        except Exception as error:
            # a defect must be seen, and must not leave the caller without an answer
            traceback.print_exc()
            _refuse(response, Response.INTERNAL, f"{type(error).__name__}: {error}")
        return response

    def _serve(self, request: SolveTrajectory.Request, response: Any) -> None:
        method = request.method or self.values["method"]
        response.method = method
        if not self._active:
            _refuse(response, Response.BUSY, "the optimizer is not active")
            return
        if method not in METHODS:
            expected = ", ".join(METHODS)
            _refuse(
                response,
                Response.UNKNOWN_METHOD,
                f"method is {method!r}; expected one of {expected}",
            )
            return
        try:
            mission = load_mission(request.mission or self.values["mission"])
        except MissionError as error:
            _refuse(response, Response.INVALID_MISSION, str(error))
            return
        limit = request.time_limit if request.time_limit > 0.0 else self.values["time_limit_s"]
        state = _navigation(request.nav_state) if request.use_nav_state else None
        begun = time.monotonic()
        try:
            solution = solve(mission, method, state=state, time_limit_s=limit)
        except OptimizerError as error:
            _refuse(response, Response.INVALID_STATE, str(error))
            return
        response.solve_time = time.monotonic() - begun
        _fill(response, solution)
        if solution.converged:
            return
        code = Response.INFEASIBLE
        if response.solve_time > limit:
            code = Response.TIME_LIMIT
        elif "did not converge" in solution.reason:
            code = Response.NOT_CONVERGED
        _refuse(response, code, solution.reason)


def _refuse(response: Any, code: int, reason: str) -> None:
    response.error_code = code
    response.message = " ".join(reason.split())
    response.converged = False


def _navigation(message: NavState) -> NDArray[np.void]:
    record = np.zeros(1, NAVIGATION)
    record["time"] = ns_from_stamp(message.stamp) / NANOSECONDS
    for name in NAVIGATION.names or ():
        if name != "time":
            record[name] = getattr(message, name)
    return record


def _fill(response: Any, solution: Solution) -> None:
    response.converged = solution.converged
    response.jettison_time = solution.t_plf_s
    response.cutoff_time = solution.t_meco_s
    response.final_mass = solution.m_f_kg
    response.iterations = solution.iterations
    arcs = solution.arcs
    response.arc_start_time = [arc.start_s for arc in arcs]
    response.arc_end_time = [arc.end_s for arc in arcs]
    response.arc_start_mass = [arc.start_mass_kg for arc in arcs]
    response.arc_end_mass = [arc.end_mass_kg for arc in arcs]
    response.arc_delta_v = [arc.delta_v_m_s for arc in arcs]
    response.steering_reference_time = [arc.reference_time_s for arc in arcs]
    response.steering_direction = [x for arc in arcs for x in arc.direction]
    response.steering_direction_rate = [x for arc in arcs for x in arc.direction_rate]
    flight = solution.trajectory
    if flight is not None:
        response.sample_time = flight.time_s.tolist()
        response.sample_position = flight.position.ravel().tolist()
        response.sample_velocity = flight.velocity.ravel().tolist()
        response.sample_mass = flight.mass.tolist()
        response.sample_direction = flight.direction.ravel().tolist()


def main() -> int:
    """Run the node as a process."""
    return run_node(OptimizerNode, name="optimizer")


if __name__ == "__main__":
    sys.exit(main())
