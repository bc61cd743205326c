# SPDX-License-Identifier: Apache-2.0
"""Make the abort map: fly every failure at every second, and compare with the optimum."""

import math
import threading
from collections import Counter
from collections.abc import Generator, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.laws import check_law, find_law
from ares_guidance.plan import ArcPlan, plan_of
from ares_models.arrays import NAVIGATION
from ares_models.failures import Failure, FailureKind
from ares_models.impacts import Outline, outlines
from ares_models.judge import End
from ares_models.kernels.sequence import SAME_TIME
from ares_models.mission import Mission
from ares_models.plans import flies_in_air
from ares_models.tolerances import SAME_SPEED_M_S
from ares_optimizer.solution import OptimizerError, Solution
from ares_studies.aborts.ends import NOWHERE, Judge, Reached, better
from ares_studies.aborts.optimum import Optimizer, plan_in_air
from ares_studies.aborts.rows import FailureRow, failure_rows
from ares_studies.closed_loop import fly_compiled, offline_trajectory, plan_solution, ready_law
from ares_studies.montecarlo.engines import cores
from ares_vehicle_sim.arrays import IMPACT
from ares_vehicle_sim.simulator import Simulator

#: Relative difference of final mass within which a flight equals the optimum.
ACCURACY = 5e-3
#: Relative mass by which a flight may exceed the optimum, since it meets its target within
#: tolerances only.
_ROUNDING = 1e-4
#: Time before cut-off, s, in which engines with less thrust reach the target's speed at another
#: radius; to correct that, the thrust must turn far aside or burn on for a minute.
LATE_S = 60.0
#: Points of the part of a row computed by one thread.
PART = 50


@dataclass(frozen=True)
class AbortPoint:
    """Hold the results of one failure at one time.

    Attributes:
        at_s: time of the failure.
        failure: the failure.
        optimum: best end, with the failure known from the start.
        told: best end with the failure known from its time on: no guidance does better. If the
            target's radius is costly (see `exact`), a bound: `optimum`.
        flown: end of the flight with guidance.
        error: why there is no end; "" if there is one.
        exact: in the last LATE_S, the best end at the exact target with the failure known from its
            time on, if that costs more than ACCURACY of the mass; None elsewhere.
    """

    at_s: float
    failure: Failure
    optimum: Reached
    told: Reached
    flown: Reached
    error: str = ""
    exact: Reached | None = None

    @property
    def share(self) -> float:
        """Return the relative loss of final mass against the optimum; nan without both."""
        return 1.0 - self.flown.m_f_kg / self.optimum.m_f_kg

    @property
    def within(self) -> bool:
        """Return whether the flight has the same end as the optimum, within ACCURACY."""
        return _as_good(self.flown, self.optimum)

    @property
    def within_told(self) -> bool:
        """Return whether the flight equals the optimum that knows the failure from its time on.

        Where the target's radius is costly, an end near the target counts too, as does the exact
        target at its cost.
        """
        if _as_good(self.flown, self.told) or self.near:
            return True
        return self.exact is not None and _as_good(self.flown, self.exact)

    @property
    def near(self) -> bool:
        """Return whether only a costly radius is missed, at the target's energy and mass."""
        return (
            self.exact is not None
            and self.flown.end is End.LOWERED
            and abs(self.flown.lacking_m_s) <= SAME_SPEED_M_S
            and abs(self.share) <= ACCURACY
        )

    @property
    def wrong(self) -> str:
        """Return why the point is implausible; "" if it is not."""
        if self.error:
            return self.error
        for way, found, name, best in (
            ("flown", self.flown, "knew", self.optimum),
            ("flown", self.flown, "was told", self.told),
            ("the optimizer that was told came", self.told, "knew", self.optimum),
        ):
            if found.end.rank < best.end.rank:
                return f"{way} to {found.end}, which the optimizer that {name} did not find"
            heavier = found.m_f_kg / best.m_f_kg - 1.0
            if found.end is End.TARGET is best.end and heavier > _ROUNDING:
                return f"{way} {100 * heavier:.3f} % heavier than the optimizer that {name} found"
            nearer = best.lacking_m_s - found.lacking_m_s
            if found.end is End.LOWERED is best.end and nearer > SAME_SPEED_M_S:
                return f"{way} {nearer:.1f} m/s nearer than the optimizer that {name} found"
        return ""


def _check_same(nominal_kg: float, planned_kg: float) -> None:
    """Check that the optimizers of the map find the plan where nothing fails.

    Raises:
        OptimizerError: they do not.
    """
    if not abs(nominal_kg / planned_kg - 1.0) <= _ROUNDING:
        raise OptimizerError(
            f"without a failure the optimizer of the map comes to {nominal_kg:,.1f} kg and the "
            f"plan to {planned_kg:,.1f} kg; expected the same within {100 * _ROUNDING:g} %. It "
            "keeps no limit of the dynamic pressure (max_dynamic_pressure_pa)"
        )


def _as_good(flown: Reached, best: Reached) -> bool:
    """Tell whether two ends are of the same kind, and orbits reached with equal mass.

    Suborbital ends are not compared further.
    """
    if flown.end is not best.end:
        return False
    return best.end is End.SUBORBITAL or abs(1.0 - flown.m_f_kg / best.m_f_kg) <= ACCURACY


@dataclass(frozen=True)
class MapRow:
    """Hold one failure at all its times."""

    name: str
    points: tuple[AbortPoint, ...]


@dataclass(frozen=True)
class Share:
    """Hold a count and its total."""

    count: int
    of: int

    @property
    def percent(self) -> float:
        """Return the share in percent; nan if the total is 0."""
        return 100.0 * self.count / self.of if self.of else math.nan


@dataclass(frozen=True)
class AbortMap:
    """Hold an abort map.

    Attributes:
        mission: flown mission.
        law: guidance law.
        step_s: interval between failure times, s.
        safe_perigee_altitude_m: lowest perigee of a lasting orbit.
        nominal: the optimum without failure.
        rows: one per failure.
        areas: outlines of the areas that impacts must avoid, by name: latitude and longitude in
            deg, the first corner repeated at the end.
        way: navigation states of the flight without failure, shape (n,), dtype NAVIGATION.
    """

    mission: Mission
    law: str
    step_s: float
    safe_perigee_altitude_m: float
    nominal: Reached
    rows: tuple[MapRow, ...]
    areas: Mapping[str, Outline]
    way: NDArray[np.void]

    @property
    def points(self) -> list[AbortPoint]:
        """Return the points of all rows."""
        return [point for row in self.rows for point in row.points]

    @property
    def wrong(self) -> list[AbortPoint]:
        """Return the implausible points."""
        return [point for point in self.points if point.wrong]

    @property
    def unfound(self) -> int:
        """Return the number of points at which the optimizer that was told found no flight."""
        return sum(not point.error and math.isnan(point.told.m_f_kg) for point in self.points)

    @property
    def outside(self) -> Share:
        """Return the share of suborbital flights that fall outside all areas."""
        fallen = [point for point in self.points if point.flown.falls]
        return Share(sum(not point.flown.area for point in fallen), len(fallen))

    def shares(self, *, told: bool = False) -> dict[str, Share]:
        """Count the points within ACCURACY, by the end that was possible.

        Args:
            told: compare with the optimum that knows the failure from its time on, not from the
                start.
        """
        chosen = {
            "target in reach": {End.TARGET},
            "an orbit in reach": set(End) - {End.SUBORBITAL},
            "all": set(End),
        }
        found = {}
        for name, ends in chosen.items():
            points = [
                point
                for point in self.points
                if (point.told if told else point.optimum).end in ends
            ]
            good = sum(point.within_told if told else point.within for point in points)
            found[name] = Share(good, len(points))
        return found

    def to_json(self) -> dict[str, Any]:
        """Return an object for ``json.dumps(allow_nan=False)``."""
        return {
            "mission": self.mission.name,
            "law": self.law,
            "step_s": self.step_s,
            "safe_perigee_altitude_m": self.safe_perigee_altitude_m,
            "accuracy": ACCURACY,
            "nominal": _told(self.nominal),
            "points": len(self.points),
            "wrong": len(self.wrong),
            "unfound": self.unfound,
            "within": {name: vars(share) for name, share in self.shares().items()},
            "within_told": {name: vars(share) for name, share in self.shares(told=True).items()},
            "near": sum(point.near for point in self.points),
            "areas": list(self.areas),
            "outside": vars(self.outside),
            "rows": [_row(row) for row in self.rows],
        }


def _row(row: MapRow) -> dict[str, Any]:
    return {
        "name": row.name,
        "optimum": _counts(point.optimum for point in row.points),
        "told": _counts(point.told for point in row.points),
        "flown": _counts(point.flown for point in row.points),
        "within": sum(point.within for point in row.points),
        "within_told": sum(point.within_told for point in row.points),
        "near": sum(point.near for point in row.points),
        "points": [
            {
                "at_s": round(point.at_s, 3),
                "optimum": _told(point.optimum),
                "told": _told(point.told),
                "flown": _told(point.flown),
                "short_percent": _number(100.0 * point.share, 4),
                "within": point.within,
                "within_told": point.within_told,
                **({"exact": _told(point.exact), "near": point.near} if point.exact else {}),
                **({"wrong": point.wrong} if point.wrong else {}),
            }
            for point in row.points
        ],
    }


def _counts(ends: Iterator[Reached]) -> dict[str, int]:
    counts = Counter(reached.end for reached in ends)
    return {str(end): counts[end] for end in End if counts[end]}


def _told(reached: Reached) -> dict[str, Any]:
    told: dict[str, Any] = {
        "end": str(reached.end),
        "m_f_kg": _number(reached.m_f_kg, 1),
        "time_s": _number(reached.time_s, 2),
        "lacking_m_s": _number(reached.lacking_m_s, 2),
        "perigee_altitude_m": _number(reached.perigee_altitude_m, 0),
    }
    if reached.falls:
        told["impact_deg"] = [round(angle, 2) for angle in reached.impact_deg]
        told["area"] = reached.area or None
    if reached.left_on:
        told["left_on"] = list(reached.left_on)
    return told


def _number(value: float, decimals: int) -> float | None:
    return round(value, decimals) + 0.0 if math.isfinite(value) else None


@dataclass(frozen=True)
class MapSettings:
    """Hold the settings of a map.

    Attributes:
        mission: only its last arc is free.
        law: guidance law.
        step_s: interval between failure times, s.
    """

    mission: Mission
    law: str
    step_s: float


def _flown_way(mission: Mission, law: str, plan: ArcPlan | None = None) -> NDArray[np.void]:
    """Return the navigation states of the flight without failure, shape (n,), dtype NAVIGATION."""
    simulator = Simulator(mission)
    guidance = ready_law(mission, law, plan=plan)
    states = []
    while not simulator.complete:
        states.append(simulator.navigation.copy())
        guidance.step(simulator.navigation)
        simulator.command(guidance.steering)
        simulator.advance()
    return np.array(states, NAVIGATION)


#: Part of a row: index of the row, slice of its failures.
_Part = tuple[int, slice]


class MapMaker:
    """Compute a map part by part on all cores."""

    def __init__(self, settings: MapSettings):
        """Compute the flight without failure, and list the failures.

        Args:
            settings: of the map.

        Raises:
            OptimizerError: the failures of the mission have no time, or it misses its target.
        """
        self._settings = settings
        self._mission = settings.mission
        self._judge = Judge(self._mission)
        plan = self._solve_plan()
        self._in_air = None
        if plan is not None and flies_in_air(self._mission.arrays().arcs):
            self._in_air = plan_in_air(self._mission, plan)
        optimizer = self._optimizer()
        self._nominal = optimizer.nominal
        if self._in_air is not None and plan is not None:
            _check_same(self._nominal.m_f_kg, plan.m_f_kg)
        self._rows = failure_rows(
            self._mission, optimizer.cutoff_s, optimizer.drops_s, settings.step_s
        )
        self._way = _flown_way(self._mission, settings.law, self._plan)
        self._own = threading.local()
        self._points: dict[tuple[int, int], AbortPoint] = {}

    def _solve_plan(self) -> Solution | None:
        """Solve for the plan that all flights follow, if they need one, and check the law with it.

        Raises:
            ValueError: there is no plan, or the law finds no steering; one line.
        """
        mission, name = self._mission, self._settings.law
        arrays, solution = mission.arrays(foreseen=True), None
        self._plan = None
        if mission.needs_plan:
            solution = plan_solution(mission, find_law(name), verify=flies_in_air(arrays.arcs))
            self._plan = plan_of(offline_trajectory(solution), arrays)
        check_law(name, arrays, mission.start().navigation(), self._plan)
        return solution

    def _optimizer(self) -> Optimizer:
        return Optimizer(self._mission, self._judge, self._in_air)

    @property
    def count(self) -> int:
        """Return the number of points of the map."""
        return sum(len(row.failures) for row in self._rows)

    def make(self) -> Generator[int, None, AbortMap]:
        """Compute all points; yield the number computed, and return the map."""
        pool = ThreadPoolExecutor(cores(), thread_name_prefix="aborts")
        running: set[Future[None]] = set()
        patient = True
        try:
            for part in self._parts():
                running.add(pool.submit(self._work, part))
            while running:
                done, running = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
                yield len(self._points)
        except BaseException:
            # do not wait for running parts
            patient = False
            raise
        finally:
            pool.shutdown(wait=patient, cancel_futures=True)
        return self._whole()

    def _parts(self) -> Iterator[_Part]:
        for i, row in enumerate(self._rows):
            # last part first: late failures change the flight least
            for end in range(len(row.failures), 0, -PART):
                yield i, slice(max(0, end - PART), end)

    def _work(self, part: _Part) -> None:
        """Compute one part, from its last failure to its first."""
        i, which = part
        row = self._rows[i]
        if not hasattr(self._own, "optimizer"):
            self._own.optimizer = self._optimizer()
        optimizer: Optimizer = self._own.optimizer
        optimizer.forget()
        numbers = range(which.start, which.stop)
        for k in reversed(numbers):
            self._points[i, k] = self._point(optimizer, row, k)
        if any(self._points[i, k].wrong for k in numbers):
            # from the other side, the continuation may follow another extremal
            for k in numbers:
                self._points[i, k] = self._sought_anew(optimizer, self._points[i, k])

    def _point(self, optimizer: Optimizer, row: FailureRow, k: int) -> AbortPoint:
        failure, at_s = row.failures[k], row.at_s[k]
        try:
            optimum, flown = optimizer.knew(failure), self._fly(failure)
            # where no thrust is left nothing better can be told
            told = optimizer.told(failure, self._state_before(failure, at_s)) or flown
            return self._whether_dear(AbortPoint(at_s, failure, optimum, told, flown))
        except ValueError as problem:
            error = " ".join(str(problem).split())
            return AbortPoint(at_s, failure, NOWHERE, NOWHERE, NOWHERE, error)

    def _sought_anew(self, optimizer: Optimizer, point: AbortPoint) -> AbortPoint:
        """Return a point with the better optima: its own, or continued from the point before."""
        if point.error:
            return point
        failure = point.failure
        optimum = better(point.optimum, optimizer.knew(failure))
        told = optimizer.told(failure, self._state_before(failure, point.at_s)) or point.told
        told = better(point.exact or point.told, told)
        # a flight that was told later could also be flown by one that knew
        optimum = better(optimum, told)
        return self._whether_dear(replace(point, optimum=optimum, told=told, exact=None))

    def _whether_dear(self, point: AbortPoint) -> AbortPoint:
        """Replace the optimum at a costly target in the last minute by its bound."""
        late = point.at_s > self._nominal.time_s - LATE_S
        burns = point.told.time_s > point.at_s + SAME_TIME
        if not (late and burns and point.optimum.end is End.TARGET):
            return point
        cheap = point.told.m_f_kg >= (1.0 - ACCURACY) * point.optimum.m_f_kg
        if point.told.end is End.TARGET and cheap:
            return point
        return replace(point, told=point.optimum, exact=point.told)

    def _state_before(self, failure: Failure, at_s: float) -> NDArray[np.void]:
        """Return the last navigation state before a failure takes effect, shape (1,)."""
        stuck = failure.kind is FailureKind.STUCK_JETTISON
        until = at_s - SAME_TIME if stuck else at_s + SAME_TIME
        i = int(np.searchsorted(self._way["time"], until, side="right")) - 1
        return self._way[i : i + 1]

    def _fly(self, failure: Failure) -> Reached:
        law = ready_law(self._mission, self._settings.law, plan=self._plan)
        flight = fly_compiled(self._mission, law=law, failure=failure)
        plant = flight.plant
        met_ground = bool((flight.events["type"] == IMPACT).any())
        return self._judge.judge(
            plant["position"].copy(),
            plant["velocity"].copy(),
            float(plant["mass"]),
            float(plant["time"]),
            int(plant["jettisoned"]),
            grounded=met_ground,
        )

    def _whole(self) -> AbortMap:
        rows = tuple(
            MapRow(row.name, tuple(self._points[i, k] for k in range(len(row.failures))))
            for i, row in enumerate(self._rows)
        )
        settings = self._settings
        return AbortMap(
            self._mission,
            settings.law,
            settings.step_s,
            self._judge.safe_perigee_altitude_m,
            self._nominal,
            rows,
            outlines(self._mission),
            self._way,
        )
