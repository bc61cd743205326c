# SPDX-License-Identifier: Apache-2.0
"""Find the launch time of a plane that is fixed in space, and what each minute beside it costs."""

import math
from collections.abc import Callable
from datetime import timedelta
from typing import NamedTuple

from scipy.optimize import minimize_scalar

from ares_models.mission import Mission
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.payload import NoFlight, PropellantMargin, stage_with_margin
from ares_optimizer.solution import OptimizerError, Solution
from ares_optimizer.solve import solve

#: Times beside the passage of the site through the plane between which the best is sought, s. A
#: launcher leaves before the passage: it flies to the east faster than the plane comes near.
_BEFORE_S, _AFTER_S = 1200.0, 300.0
#: Accuracy of the best launch time, s.
_ACCURACY_S = 0.5


class Launch(NamedTuple):
    """Hold a launch at one time.

    Attributes:
        later_s: after the launch time of the file, s; negative: before it.
        mission: the mission launched then.
        solution: its optimum.
    """

    later_s: float
    mission: Mission
    solution: Solution

    @property
    def final_mass_kg(self) -> float:
        """Return the mass at cut-off, kg; NaN where no flight was found."""
        return self.solution.m_f_kg if self.solution.flyable else math.nan


class Window(NamedTuple):
    """Hold the best launch and launches at whole minutes beside it, in order of time."""

    best: Launch
    launches: tuple[Launch, ...]


def launched_later(mission: Mission, seconds: float) -> Mission:
    """Return the mission launched later: only the angle of the turning body and the date change.

    Args:
        mission: with a start relative to the ground.
        seconds: s; negative: earlier.
    """
    changes: dict[str, object] = {}
    environment = mission.environment
    earth = environment.earth
    if earth.zero_longitude_deg is not None:
        turned = earth.zero_longitude_deg + math.degrees(earth.rotation_rate_rad_s * seconds)
        angle = {"zero_longitude_deg": math.remainder(turned, 360.0)}
        turned_earth = earth.model_copy(update=angle)
        changes["environment"] = environment.model_copy(update={"earth": turned_earth})
    if mission.epoch is not None:
        changes["epoch"] = mission.epoch + timedelta(seconds=seconds)
    return mission.model_copy(update=changes)


def launch_window(
    mission: Mission,
    minutes: int,
    time_limit_s: float | None = None,
    report: Callable[[Progress], None] = lambda _progress: None,
) -> Window:
    """Find the launch time with most propellant left at the target, and solve minutes beside it.

    The best time is sought around that passage of the site through the target's plane which is
    nearest to the launch time of the file.

    Args:
        mission: with a start relative to the ground, and a target with inclination and node.
        minutes: on either side of the best time.
        time_limit_s: of each search, s.
        report: see :class:`ares_optimizer.deadline.Deadline`.

    Raises:
        OptimizerError: launch time or plane do not matter, no burn is free, or no flight is
            found at the best time; one line.
    """
    stage_with_margin(mission)
    passage = _passage(mission)

    def deadline() -> Deadline:
        return Deadline(time_limit_s, report)

    margin = PropellantMargin(deadline)

    def lacking(later_s: float) -> float:
        try:
            return -margin.of(launched_later(mission, later_s))
        except NoFlight:
            return math.inf

    def launch(later_s: float, known: Launch | None = None) -> Launch:
        then = launched_later(mission, later_s)
        guess = known.solution if known is not None and known.solution.flyable else None
        return Launch(later_s, then, solve(then, "auto", guess=guess, deadline=deadline()))

    bounds = (passage - _BEFORE_S, passage + _AFTER_S)
    found = minimize_scalar(
        lacking, bounds=bounds, method="bounded", options={"xatol": _ACCURACY_S}
    )
    if not math.isfinite(found.fun):
        raise OptimizerError(
            "no launch time was found at which the target is reached, with any propellant, from "
            f"{bounds[0]:,.0f} to {bounds[1]:,.0f} s after that of the file"
        )
    best = launch(float(found.x))
    launches = [best]
    for way in (-1, 1):
        known = best
        for minute in range(1, minutes + 1):
            known = launch(best.later_s + 60.0 * way * minute, known)
            launches.append(known)
    return Window(best, tuple(sorted(launches, key=lambda each: each.later_s)))


def _passage(mission: Mission) -> float:
    """Return when the site is in the target's plane, or nearest to it, next to the file's time, s.

    Raises:
        OptimizerError: the mission has no such passage; one line.
    """
    start, target = mission.initial_state, mission.target
    rate = mission.environment.earth.rotation_rate_rad_s
    if not start.ON_GROUND or rate == 0.0:
        raise OptimizerError(
            "initial_state does not turn with the ground; expected one relative to a body that "
            "turns, because a launch time is sought"
        )
    node = target.node_deg(mission)
    if node is None or target.inclination_deg is None:
        missing = "node" if node is None else "inclination_deg"
        raise OptimizerError(
            f"target has no {missing}; expected one, because otherwise all launch times are alike"
        )
    x, y, z = mission.start().position
    tangent = math.tan(math.radians(target.inclination_deg))
    sine = math.inf if tangent == 0.0 else z / math.hypot(x, y) / tangent
    from_node = math.asin(max(-1.0, min(1.0, sine)))
    ahead = (
        math.radians(node) + angle - math.atan2(y, x) for angle in (from_node, math.pi - from_node)
    )
    return min((math.remainder(angle, math.tau) / rate for angle in ahead), key=abs)
