# SPDX-License-Identifier: Apache-2.0
"""The optimizer: requests to it, and guidance's use of its answers."""

import contextlib
import io
import math
from collections.abc import Sequence
from functools import partial
from random import Random
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message

from ares_guidance.node import GuidanceNode
from ares_models.kernels.steering import UNIT_TOLERANCE
from ares_models.mission import Mission, load_mission
from ares_msgs.msg import NavState
from ares_msgs.srv import SolveTrajectory
from ares_node.time import stamp_from_seconds
from ares_optimizer.messages import RequestServer, Response
from ares_vehicle_sim.simulator import CommandRefused, Simulator
from hostile.messages import heard, hostile
from hostile.nodes import MISSION, Call, Flight, NodeTarget
from hostile.target import Broken, Target, check, one_line

#: Laws that start from an answer.
_LAWS = ("peg", "optimal", "peg_thesis")
_METHODS = ("", "indirect", "closed_form", "analytic", "direct11", "direct20", "jump")
#: Missions whose targets and starts differ in kind.
_MISSIONS = (MISSION, "saturn_v_tli", "apollo11_ascent", "geostationary_burn")
#: What position and velocity are multiplied by.
_SHARES = (1.0, 1.0, 1.0, 0.0, -1.0, 1e-30, 1e-3, 0.5, 1.1, 1e3)


def flies(steering: Any) -> bool:
    """Tell whether the simulator accepts a direction that is no unit vector."""
    if abs(math.hypot(*steering[0]["direction"]) - 1.0) < UNIT_TOLERANCE:
        return False
    try:
        Simulator(load_mission(MISSION)).command(steering)
    except CommandRefused:
        return False
    return True


class OptimizerAnswers(NodeTarget):
    """Give optimizer's answers to guidance: each law starts from one, or states why not."""

    name = "answers of an optimizer"
    share = 1.0
    look_every = 10**9

    def set_up(self) -> Sequence[Call]:
        self._flight = Flight()
        self._state = self._flight.nav_state()
        asked = SolveTrajectory.Request(
            mission=MISSION, use_nav_state=True, nav_state=self._state, time_limit=5.0
        )
        self._good = bytes(serialize_message(RequestServer(MISSION, "indirect", 5.0).answer(asked)))
        calls = []
        for law in _LAWS:
            node = self.node(GuidanceNode, mission=MISSION, law=law, initial_guess="optimizer")
            calls.append(
                Call(Response, self._answer, partial(self._take, node), kept=("error_code",))
            )
        return calls

    def _answer(self) -> Any:
        return deserialize_message(self._good, Response)

    def _take(self, node: Any, answer: Any) -> None:
        now, _, _, measured = node._answers.read(bytes(serialize_message(self._state)))
        node._answers.request(self._state)
        node._asked = now
        node._wants_guess = True
        node._use_guess(answer, now)
        if not node._wants_guess:
            node._answers.step(now, measured)
            if node._law.steered and flies(node._law.steering):
                raise Broken(f"a direction is flown: {node._law.steering[0]['direction']}")
        node._forget()


def odd_state(mission: Mission, random: Random) -> NavState:
    """Make a navigation state of valid numbers that no flight of a mission reaches."""
    arrays, start = mission.arrays(), mission.start()
    arc = random.randrange(len(arrays.arcs))
    stack = float(arrays.arcs[arc]["stack_mass"])
    time = start.time_s + random.choice((0.0, 0.0, 1.0, 100.0, -100.0, 1e5))
    position, velocity = (
        np.array(vector) * random.choice(_SHARES)
        + random.choice((0.0, 0.0, size)) * random.random()
        for vector, size in ((start.position, 1e6), (start.velocity, 1e3))
    )
    return NavState(
        stamp=stamp_from_seconds(time),
        position=position,
        velocity=velocity,
        mass=random.choice(
            (stack, stack - float(arrays.arcs[arc]["propellant"]), 1.0, stack * random.random())
        ),
        heating_rate=random.choice((math.nan, 0.0, 1e3)),
        arc=arc,
        arc_start_time=time - random.choice((0.0, 0.0, 1.0, 100.0, 1e4, -10.0)),
        jettisoned=random.choice((0, (1 << len(arrays.jettisons)) - 1, random.randrange(256))),
    )


class Requests(Target):
    """Send requests to the optimizer: answered in time, or refused with a reason."""

    name = "optimizer"
    share = 0.1

    def begin(self) -> None:
        self._answers = RequestServer(MISSION, "indirect", 0.05)
        self._flight = Flight()
        self._missions = {name: load_mission(name) for name in _MISSIONS}
        # compiled before it is timed
        for method in _METHODS:
            self._answers.answer(
                SolveTrajectory.Request(
                    mission=MISSION,
                    use_nav_state=True,
                    nav_state=self._flight.nav_state(),
                    method=method,
                    time_limit=60.0,
                )
            )

    def make(self, random: Random) -> bytes:
        if random.random() < 0.5:
            name = random.choice(_MISSIONS)
            odd = SolveTrajectory.Request(
                mission=name,
                use_nav_state=True,
                nav_state=odd_state(self._missions[name], random),
                method=random.choice(_METHODS),
                time_limit=0.05,
            )
            return bytes(serialize_message(odd))
        request = SolveTrajectory.Request(
            mission=MISSION,
            use_nav_state=random.random() < 0.9,
            nav_state=self._flight.nav_state(),
            method=random.choice(_METHODS),
            time_limit=0.05,
        )
        return hostile(request, random, ("mission", "method", "time_limit", "use_nav_state"))

    def run(self, data: bytes) -> str:
        request = heard(SolveTrajectory.Request, data)
        if request is None:
            return "no message"
        request.time_limit = min(request.time_limit, 0.05)
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            answer = self._answers.answer(request)
        check(answer.error_code != Response.INTERNAL, f"internal: {said.getvalue()[-400:]!r}")
        bytes(serialize_message(answer))
        if answer.error_code != Response.NONE:
            one_line(answer.message)
            check(not answer.converged, "refused and converged")
            return f"error {answer.error_code}"
        numbers = (answer.cutoff_time, answer.final_mass, *answer.arc_start_time)
        numbers += (*answer.arc_end_time, *answer.arc_end_mass)
        check(all(map(math.isfinite, numbers)), f"success with {numbers}")
        check(answer.final_mass > 0.0, f"success with {answer.final_mass} kg")
        return "solved"
