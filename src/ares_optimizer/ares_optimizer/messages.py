# SPDX-License-Identifier: Apache-2.0
"""Answer the messages of the optimizer's service and of its action.

Used by the node, and by the replay of a recorded flight.
"""

import math
import sys
import time
import traceback
from array import array
from collections import OrderedDict
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import NAVIGATION, MissionArrays
from ares_models.input_file import format_value, read_text
from ares_models.mission import MISSION, MissionError, list_missions, parse_mission
from ares_msgs.action import OptimizeTrajectory
from ares_msgs.msg import NavState
from ares_msgs.srv import SolveTrajectory
from ares_node.time import NANOSECONDS, ns_from_stamp
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.kept import solve_once
from ares_optimizer.registry import AUTO, COLLOCATION, INDIRECT_METHODS, method_names
from ares_optimizer.solution import OptimizerError, Solution, Status, UnfitMethod

Response: Any = SolveTrajectory.Response

#: Most missions kept as arrays.
KEPT_MISSIONS = 16
#: Longest time limit of a request, s.
LONGEST = 3600.0

#: Error codes of the statuses without a flight.
ERROR_CODES = {
    Status.INFEASIBLE: Response.INFEASIBLE,
    Status.NOT_OPTIMAL: Response.NOT_CONVERGED,
    Status.ITERATION_LIMIT: Response.NOT_CONVERGED,
    Status.STALLED: Response.NOT_CONVERGED,
    Status.TIME_LIMIT: Response.TIME_LIMIT,
    Status.ILLEGAL_START: Response.INVALID_STATE,
}


class Refused(Exception):
    """Signal a request without a trajectory; the text is one line."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code


@dataclass(frozen=True)
class Prepared:
    """Hold a mission as arrays.

    Attributes:
        name: of the mission.
        arrays: the mission.
        start: start of the mission, shape (1,), dtype NAVIGATION.
        heating: where its heating limit holds.
    """

    name: str
    arrays: MissionArrays
    start: NDArray[np.void]
    heating: str


class MissionCache:
    """Cache missions as arrays, by their text.

    Attributes:
        own: parameter `mission` of the server, the only path that is opened.
    """

    def __init__(self, own: str) -> None:
        self.own = own
        self._kept: OrderedDict[bytes, Prepared] = OrderedDict()

    def server_mission(self) -> Prepared:
        """Read the mission of the server from its file.

        Raises:
            MissionError: no such mission, or its file is invalid; the line may quote it.
        """
        path = MISSION.find(self.own)
        return self._parsed(read_text(path, MISSION), str(path))

    def get(self, name: str, text: str) -> Prepared:
        """Return the mission of a request.

        Args:
            name: of a shipped mission or the server's; empty: the server's, unless ``text`` is set.
            text: of a mission file; empty: the mission by ``name``.

        Raises:
            Refused: no such mission, or its text is invalid; the line quotes no file of the server.
        """
        if text:
            if name:
                raise Refused(
                    Response.INVALID_MISSION,
                    f"mission is {format_value(name)} beside a mission_text; expected one of them",
                )
            try:
                return self._parsed(text, "mission_text")
            except MissionError as error:
                raise Refused(Response.INVALID_MISSION, str(error)) from error
        shipped = list_missions()
        try:
            if name in shipped:
                return self._parsed(read_text(MISSION.find(name), MISSION), name)
            own = self.server_mission()
        except MissionError as error:
            # to the log of the server only: the line may quote its files
            print(f"mission {self.own}: {error}", file=sys.stderr, flush=True)
            raise Refused(
                Response.INVALID_MISSION, "the server's own mission cannot be read any more"
            ) from error
        if name in ("", self.own, own.name):
            return own
        raise Refused(
            Response.INVALID_MISSION,
            f"mission is {format_value(name)}; expected the server's own, a mission_text, or one "
            f"of {', '.join(shipped)}",
        )

    def _parsed(self, text: str, source: str) -> Prepared:
        key = sha256(text.encode("utf-8", "surrogatepass")).digest()
        found = self._kept.get(key)
        if found is None:
            mission = parse_mission(text, source)
            found = Prepared(
                mission.name,
                mission.arrays(),
                mission.start().navigation(),
                mission.heating_limit_holds,
            )
            self._kept[key] = found
            if len(self._kept) > KEPT_MISSIONS:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return found


class RequestServer:
    """Answer requests, one after the other."""

    def __init__(self, mission: str, method: str, time_limit_s: float) -> None:
        """Solve the server's mission once: the solver is compiled, and the solution kept.

        Args:
            mission: default mission of a request.
            method: default method.
            time_limit_s: default limit of wall time, s.

        Raises:
            MissionError: no such mission, or its file is invalid.
        """
        self._method = method
        self._time_limit = time_limit_s
        self._missions = MissionCache(mission)
        own = self._missions.server_mission()
        _solve(own, method, own.start, Deadline())

    def answer(self, request: Any, deadline: Deadline | None = None, kind: Any = Response) -> Any:
        """Return the response to a request, which may be a refusal.

        Args:
            request: of the service, or a goal of the action.
            deadline: ends the search and reports its progress; the time limit of the request is
                set on it.
            kind: class of the response, of the service or of the action's result.
        """
        response = empty(kind)
        try:
            self._serve(request, response, deadline or Deadline())
        except Refused as refusal:
            refuse(response, refusal.code, str(refusal))
        except Exception as error:
            # log the defect, and answer the caller
            traceback.print_exc()
            refuse(response, Response.INTERNAL, f"{type(error).__name__}: {error}")
        return response

    def _serve(self, request: Any, response: Any, deadline: Deadline) -> None:
        method = request.method or self._method
        if method not in method_names():
            expected = ", ".join(method_names())
            raise Refused(
                Response.UNKNOWN_METHOD, f"method is {method!r}; expected one of {expected}"
            )
        limit = self._limit(request.time_limit)
        mission = self._missions.get(request.mission, request.mission_text)
        state = _navigation(request.nav_state) if request.use_nav_state else mission.start
        begun = time.monotonic()
        try:
            deadline.begin(limit)
            solution = _solve(mission, method, state, deadline)
        except UnfitMethod as error:
            raise Refused(Response.UNFIT_METHOD, str(error)) from error
        except OptimizerError as error:
            raise Refused(Response.INVALID_STATE, str(error)) from error
        response.solve_time = time.monotonic() - begun
        response.method = method
        _fill(response, solution)
        if solution.flyable:
            return
        raise Refused(ERROR_CODES[solution.status], solution.reason)

    def _limit(self, asked: float) -> float:
        if asked == 0.0:
            return self._time_limit
        if not 0.0 < asked <= LONGEST:
            raise Refused(
                Response.INVALID_TIME_LIMIT,
                f"time_limit is {asked:g} s; expected 0 for the server's own, or more, to "
                f"{LONGEST:g} s",
            )
        return asked


def _solve(mission: Prepared, method: str, state: NDArray[np.void], deadline: Deadline) -> Solution:
    """Solve without verification where the method does not need it for its trajectory."""
    return solve_once(
        mission.arrays,
        method,
        state,
        mission.heating,
        deadline,
        verify=method not in (AUTO, COLLOCATION, *INDIRECT_METHODS),
    )


def feedback(progress: Progress) -> OptimizeTrajectory.Feedback:
    """Convert the progress of a search to a feedback message."""
    return OptimizeTrajectory.Feedback(
        method=progress.method,
        iterations=progress.iterations,
        violation=float(progress.violation),
        final_mass=float(progress.m_f_kg),
    )


def empty(kind: Any = Response) -> Any:
    """Return a response of class ``kind`` without a solution."""
    return kind(jettison_time=math.nan, cutoff_time=math.nan, final_mass=math.nan)


def refuse(response: Any, code: int, reason: str) -> None:
    """Set error code and reason of a response without a trajectory."""
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


def _doubles(values: Any) -> "array[float]":
    """Convert numbers to an array that a message accepts without checks per element."""
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def _fill(response: Any, solution: Solution) -> None:
    response.converged = solution.converged
    response.jettison_time = solution.heating_jettison_s
    response.cutoff_time = solution.t_meco_s
    response.final_mass = solution.m_f_kg
    response.iterations = solution.iterations
    arcs = solution.arcs
    response.arc_start_time = _doubles([arc.start_s for arc in arcs])
    response.arc_end_time = _doubles([arc.end_s for arc in arcs])
    response.arc_start_mass = _doubles([arc.start_mass_kg for arc in arcs])
    response.arc_end_mass = _doubles([arc.end_mass_kg for arc in arcs])
    response.arc_delta_v = _doubles([arc.delta_v_m_s for arc in arcs])
    steering = np.array(
        [
            (arc.reference_time_s, *arc.direction, *arc.direction_rate, *arc.primer_rate)
            for arc in arcs
        ]
    ).reshape(-1, 10)
    steering[[arc.coasts for arc in arcs]] = math.nan
    response.steering_reference_time = _doubles(steering[:, 0])
    response.steering_direction = _doubles(steering[:, 1:4])
    response.steering_direction_rate = _doubles(steering[:, 4:7])
    response.primer_rate = _doubles(steering[:, 7:10])
    response.flown_arc = [arc.arc for arc in solution.flown]
    response.flown_start_time = _doubles([arc.start_s for arc in solution.flown])
    response.flown_end_time = _doubles([arc.end_s for arc in solution.flown])
    response.by_legs = solution.by_legs
    flight = solution.trajectory
    if flight is not None:
        response.sample_time = _doubles(flight.time_s)
        response.sample_position = _doubles(flight.position)
        response.sample_velocity = _doubles(flight.velocity)
        response.sample_mass = _doubles(flight.mass)
        response.sample_direction = _doubles(flight.thrust_directions(arcs))
