# SPDX-License-Identifier: Apache-2.0
"""Adapter between a guidance law and messages: navigation states in, commands and status out.

The node uses it in flight, replay uses it on the states of a bag.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ares_guidance.arrays import AIM_SAFE, PHASE_BOOST
from ares_guidance.floor import lowest_coast
from ares_guidance.law import Law
from ares_guidance.laws import check_law, make_law
from ares_guidance.plan import plan_of
from ares_guidance.settings import LawSettings
from ares_guidance.trajectory import OfflineTrajectory
from ares_models.arrays import HEATING_LIMIT, NAVIGATION
from ares_models.input_file import read_text
from ares_models.mission import MISSION, Mission, list_missions
from ares_models.software import software
from ares_msgs.msg import GuidanceStatus, NavState, ThrustCommand
from ares_msgs.srv import SolveTrajectory
from ares_node.diagnostics import FINAL_MASS_KG, LOWEST_COAST_M, Level
from ares_node.identity import MISSION_DIGEST
from ares_node.states import StateMessage
from ares_node.time import NANOSECONDS, ns_from_stamp, stamp_from_ns

#: Optimizer method that a request can select.
ANALYTIC = "analytic"
#: Reported once when the law starts from the optimizer's answer, with the method and the stamp of
#: the navigation state in the request.
ANSWER_TAKEN = "starting from the optimizer's answer"
ASKED_AT_NS = "asked_at_ns"

#: Speed missing at the end of a leg that the next one makes up for, m/s.
SMALL_SHORTFALL_M_S = 30.0
#: Fields of an answer that are no lists, and those that are lists of vectors.
_NUMBERS = ("jettison_time", "cutoff_time", "by_legs")
_VECTORS = (
    *("steering_direction", "steering_direction_rate", "primer_rate"),
    *("sample_position", "sample_velocity", "sample_direction"),
)


class Answers:
    """Answer the navigation states of one flight with messages.

    Attributes:
        law: the law.
        identity: flight_id and guidance_id of the answers.
    """

    def __init__(self, mission: Mission, values: Mapping[str, Any]) -> None:
        """Prepare for the first navigation state.

        Args:
            mission: as guidance believes it.
            values: parameters of the node guidance by name, without flight_id; a missing setting
                of the law has its default.

        Raises:
            ValueError: no such law, a setting out of its range, or a law that cannot fly this
                mission; one line.
        """
        # an old bag lacks settings that were introduced later
        known = [item for item in fields(LawSettings) if item.name in values]
        self.arrays = mission.arrays(foreseen=True)
        self.law: Law = make_law(
            values["law"],
            self.arrays,
            LawSettings(**{each.name: values[each.name] for each in known}),
            mission.start().navigation(),
        )
        self.identity = (0, 0)
        self._values = values
        self._mission = mission
        name = str(values["mission"])
        #: mission of a request: a shipped name, else the text of the file; never a path
        self._asks_for = (
            {"mission": name}
            if name in list_missions()
            else {"mission_text": read_text(MISSION.find(name), MISSION)}
        )
        self._heating_jettisons = int(np.sum(self.arrays.jettisons["criterion"] == HEATING_LIMIT))
        self._state_message = StateMessage(NavState)
        self._nav = np.zeros(1, NAVIGATION)
        self._start = np.zeros(1, NAVIGATION)
        self._measured = self._nav[list(self._state_message.fields)]
        self._stamp = stamp_from_ns(0)

    # ---- settings and the optimizer's guess

    def settings(self) -> str:
        """Return everything that determines the answers, as a JSON object.

        It holds the node's parameters, `software` (versions) and `mission_digest` (of the
        mission's numbers).
        """
        about = {"software": software(), MISSION_DIGEST: self._mission.digest}
        return json.dumps(about | dict(self._values))

    @property
    def wants_guess(self) -> bool:
        """Return whether the law needs the optimizer's answer before its first command."""
        law = self.law
        needed = law.kind.needs_trajectory or law.lacks_plan
        return bool(self._values["initial_guess"] != "none" or needed)

    @property
    def time_limit(self) -> float:
        """Return the wall time allowed for the optimizer, s."""
        name = "plan_timeout_s" if self.law.lacks_plan else "optimizer_timeout_s"
        return float(self._values[name])

    def request(self, state: NavState) -> SolveTrajectory.Request:
        """Build the optimizer's request from a navigation state, or from the surveyed pad."""
        navigated = np.zeros(1, NAVIGATION)
        navigated["time"] = ns_from_stamp(state.stamp) / NANOSECONDS
        for name in self._state_message.fields:
            navigated[name] = getattr(state, name)
        self._start = self._mission.start_of_plan(navigated)
        self._asked = float(self._start["time"][0]), float(self._start["mass"][0])
        analytic = not self.law.lacks_plan and self._values["initial_guess"] != "optimizer"
        return SolveTrajectory.Request(
            **self._asks_for,
            method=ANALYTIC if analytic else "",
            use_nav_state=self._start is navigated,
            nav_state=state,
            time_limit=self.time_limit,
        )

    def check_start(self, answer: SolveTrajectory.Response) -> None:
        """Check that the law can fly the optimizer's answer to the last `request`.

        Raises:
            FindsNoWay: it finds no solution; one line, which names the laws that do.
            ValueError: the answer is not a plan of this mission.
        """
        if self.law.by_plan:
            plan = plan_of(_trajectory(answer), self.arrays)
            check_law(self.law.kind.name, self.arrays, self._start, plan)

    def start_from(self, answer: SolveTrajectory.Response) -> dict[str, float]:
        """Start from the optimizer's answer to the last `request`.

        Returns:
            For a plan FINAL_MASS_KG and LOWEST_COAST_M, else an empty dictionary.

        Raises:
            ValueError: the answer is not usable, or is a plan through the ground; one line.
        """
        trajectory = _trajectory(answer)
        later = bool(self.arrays.environment["boost"]["knots"][0] > 0)
        trajectory.check_begin(*self._asked, later)
        self.law.start_from(trajectory)
        if not self.law.by_plan:
            return {}
        lowest = lowest_coast(trajectory, self.arrays)
        return {FINAL_MASS_KG: float(answer.final_mass), LOWEST_COAST_M: lowest}

    # ---- the flight

    def read(self, data: bytes) -> tuple[int, int, int, Any]:
        """Return stamp in ns, flight_id, sequence and measured state of a NavState in CDR."""
        return self._state_message.read(data)

    def content(self, data: bytes) -> bytes:
        """Return the sealed part of a NavState in CDR."""
        return self._state_message.content(data)

    def step(self, now: int, measured: Any) -> bool:
        """Answer one navigation state.

        Args:
            now: its stamp, ns.
            measured: as returned by `read`.

        Returns:
            Whether there is a new `status`: a guidance cycle was due, or the state was refused
            and no refusal was reported for a cycle period. `command` is the answer in both
            cases, once `law.steered`.
        """
        nav = self._nav[0]
        nav["time"] = now / NANOSECONDS
        self._measured[0] = measured
        self._stamp = stamp_from_ns(now)
        reported = int(self.law.state["navigation"]["reported"])
        due = self.law.step(nav)
        return due or int(self.law.state["navigation"]["reported"]) != reported

    def command(self) -> ThrustCommand:
        """Build the command that answers the last state."""
        flight_id, guidance_id = self.identity
        # the message keeps a reference to the array: give it a copy
        steering = self.law.steering[0].copy()
        return ThrustCommand(
            stamp=self._stamp,
            flight_id=flight_id,
            guidance_id=guidance_id,
            nav_stamp=self._stamp,
            reference_time=float(steering["reference_time"]),
            direction=steering["direction"],
            direction_rate=steering["direction_rate"],
            cutoff_time=float(steering["cutoff_time"]),
            jettison=int(steering["jettison"]),
            jettison_time=float(steering["jettison_time"]),
            arc_end_times=steering["arc_end_times"][: len(self.arrays.arcs)],
        )

    @property
    def _legs_follow(self) -> bool:
        """Return whether the present leg is not the last one."""
        return 0 < int(self.law.state["leg"]["count"]) < len(self.arrays.arcs)

    @property
    def jettison_after_cutoff(self) -> bool:
        """Return whether a heating jettison is aboard and the plan does not drop it."""
        aboard = self._heating_jettisons > int(self._nav[0]["jettisoned"]).bit_count()
        dropped = self.law.steering[0]["jettison"] >= 0 or self._legs_follow
        return bool(aboard and self._solved and not dropped)

    @property
    def reported_error(self) -> int:
        """Return the error code for the log: of a leg, the next one corrects a small shortfall."""
        state = self.law.state
        error = int(state["error"])
        small = state["aim"] != AIM_SAFE and state["lowered"] < SMALL_SHORTFALL_M_S
        if error == GuidanceStatus.PROPELLANT_SHORT and self._legs_follow and small:
            return int(GuidanceStatus.NONE)
        return error

    def fallback_report(self) -> tuple[Level, str]:
        """Return the level and the line that says why PEG flies in place of the law."""
        nav, time_to_go = self._nav[0], float(self.law.state["solution"]["time_to_go"])
        end = int(self.law.state["leg"]["count"]) or len(self.arrays.arcs)
        held = np.flatnonzero(self.arrays.arcs["held"][:end])
        if len(held) and held[-1] >= nav["arc"]:
            text = f"arc {held[-1]} is flown in held attitude: peg steers up to it"
            return Level.OK, text
        mu, radius = float(self.arrays.environment["mu"][0]), float(np.linalg.norm(nav["position"]))
        angle = math.degrees(math.sqrt(mu / radius**3) * time_to_go)
        return Level.WARN, (
            f"law {self.law.kind.name} has no solution for the burn ahead, {time_to_go:.0f} s over "
            f"{angle:.0f} deg of the orbit: peg flies it"
        )

    @property
    def _solved(self) -> bool:
        """Return whether the law's solution was accepted; in the boost programme it has none."""
        return self.law.converged and self.law.phase != PHASE_BOOST

    def status(self) -> GuidanceStatus:
        """Build the status of the law after the last cycle."""
        flight_id, guidance_id = self.identity
        state = self.law.state
        solution = state["solution"]
        steering = self.law.steering[0]
        now = float(self._nav[0]["time"])
        cutoff_time = float(steering["cutoff_time"])
        # 0 without a solution yet
        known = math.nan if self.law.phase == PHASE_BOOST else 1.0
        return GuidanceStatus(
            stamp=self._stamp,
            flight_id=flight_id,
            guidance_id=guidance_id,
            cycle=self.law.cycle,
            law=int(state["law"]) or self.law.kind.code,
            phase=self.law.phase,
            error_code=int(state["error"]),
            converged=self._solved,
            iterations=int(state["iterations"]),
            total_iterations=int(state["total_iterations"]),
            stale_cycles=int(state["stale_cycles"]),
            time_to_go=cutoff_time - now if self._solved else math.nan,
            cutoff_time=cutoff_time,
            velocity_to_go=known * solution["velocity_to_go"],
            predicted_position=known * state["predicted_position"],
            predicted_velocity=known * state["predicted_velocity"],
            miss_speed=known * float(solution["miss_speed"]),
            jettison_time=float(steering["jettison_time"]),
            jettison_after_cutoff=self.jettison_after_cutoff,
            density_ratio=known * float(state["density_ratio"]),
        )


def _trajectory(answer: SolveTrajectory.Response) -> OfflineTrajectory:
    """Convert the optimizer's answer to a trajectory.

    Args:
        answer: response of the service.

    Raises:
        ValueError: its lists differ in length, or a value is wrong.
    """
    columns: dict[str, Any] = {}
    for name in (item.name for item in fields(OfflineTrajectory)):
        value = getattr(answer, name)
        if name not in _NUMBERS:
            value = np.asarray(value, np.int64 if name == "flown_arc" else np.float64)
        columns[name] = value.reshape(-1, 3) if name in _VECTORS else value
    return OfflineTrajectory(**columns)
