# SPDX-License-Identifier: Apache-2.0
"""The abort map: every failure at every second, flown and set beside the optimizer that knew."""

import math
import threading
from collections import Counter
from collections.abc import Generator, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import NAVIGATION
from ares_models.failures import Failure, FailureKind
from ares_models.impacts import Outline, outlines
from ares_models.judge import End
from ares_models.kernels.sequence import SAME_TIME
from ares_models.mission import Mission
from ares_models.tolerances import SAME_SPEED_M_S
from ares_studies.aborts.ends import NOWHERE, Judge, Reached, better
from ares_studies.aborts.optimum import Optimizer
from ares_studies.aborts.rows import FailureRow, failure_rows
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_studies.flight_page.land import land_on
from ares_studies.montecarlo.engines import cores
from ares_vehicle_sim.arrays import IMPACT
from ares_vehicle_sim.simulator import Simulator

#: Part of the optimum's final mass within which a flight is as good.
ACCURACY = 5e-3
#: By so much a flight may end heavier than the optimum: its target is met within tolerances.
_ROUNDING = 1e-4
#: s before the cut-off, in which engines that give less come to the target's speed at another
#: radius; to mend it then, the thrust turns far aside or burns on for a minute.
LATE_S = 60.0
#: Points of a part of a row that one thread works through.
PART = 50


@dataclass(frozen=True)
class Point:
    """One failure at one time.

    Attributes:
        at_s: when it happens.
        failure: what fails.
        optimum: the best end, of the optimizer that knew all along.
        told: the same, of one that was told when it happened: no guidance does better. Where the
            target's radius is dear, a bound: the one that knew.
        flown: the end that guidance came to.
        error: why there is no end; empty if there is one.
        exact: what the target takes from who is told in the last LATE_S, if that is more than
            ACCURACY of the mass; None elsewhere.
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
        """Part of the optimum's final mass that the flight is short of; nan: not to compare."""
        return 1.0 - self.flown.m_f_kg / self.optimum.m_f_kg

    @property
    def within(self) -> bool:
        """Whether it is flown to the same end as the optimum, and as well within ACCURACY."""
        return _as_good(self.flown, self.optimum)

    @property
    def within_told(self) -> bool:
        """The same beside the optimizer that was told when it happened.

        Where the target is dear an end near it counts, and so does the target as dear as there.
        """
        if _as_good(self.flown, self.told) or self.near:
            return True
        return self.exact is not None and _as_good(self.flown, self.exact)

    @property
    def near(self) -> bool:
        """Whether the radius was let go, which was dear, and next to nothing else."""
        return (
            self.exact is not None
            and self.flown.end is End.LOWERED
            and abs(self.flown.lacking_m_s) <= SAME_SPEED_M_S
            and abs(self.share) <= ACCURACY
        )

    @property
    def wrong(self) -> str:
        """Why the point is not to be believed; empty if it is."""
        if self.error:
            return self.error
        for name, best in (("knew", self.optimum), ("was told", self.told)):
            if self.flown.end.rank < best.end.rank:
                return f"flown to {self.flown.end}, which the optimizer that {name} did not find"
            heavier = self.flown.m_f_kg / best.m_f_kg - 1.0
            if self.flown.end is End.TARGET is best.end and heavier > _ROUNDING:
                return f"flown {100 * heavier:.3f} % heavier than the optimizer that {name} found"
        return ""


def _as_good(flown: Reached, best: Reached) -> bool:
    """Whether an end is of the same kind, and an orbit reached with as much mass.

    Where no orbit is in reach nothing is left to be compared.
    """
    if flown.end is not best.end:
        return False
    return best.end is End.SUBORBITAL or abs(1.0 - flown.m_f_kg / best.m_f_kg) <= ACCURACY


@dataclass(frozen=True)
class MapRow:
    """One failure at all its times."""

    name: str
    points: tuple[Point, ...]


@dataclass(frozen=True)
class Share:
    """How many of how many."""

    count: int
    of: int

    @property
    def percent(self) -> float:
        """nan of none."""
        return 100.0 * self.count / self.of if self.of else math.nan


@dataclass(frozen=True)
class AbortMap:
    """All of it.

    Attributes:
        mission: name.
        title: of the mission.
        law: that flew.
        step_s: between times.
        safe_perigee_altitude_m: of an orbit that lasts.
        nominal: the optimum in which nothing fails.
        rows: one per failure.
        areas: outlines of those that impacts are kept out of, by name: latitude and longitude in
            deg, the first corner again at the end.
        land: whether the body is the Earth, and its longitudes are known.
    """

    mission: str
    title: str
    law: str
    step_s: float
    safe_perigee_altitude_m: float
    nominal: Reached
    rows: tuple[MapRow, ...]
    areas: Mapping[str, Outline]
    land: bool

    @property
    def points(self) -> list[Point]:
        """Of all rows."""
        return [point for row in self.rows for point in row.points]

    @property
    def wrong(self) -> list[Point]:
        """Points that are not to be believed."""
        return [point for point in self.points if point.wrong]

    @property
    def outside(self) -> Share:
        """Flights that reach no orbit and fall, and how many of them outside all areas."""
        fallen = [point for point in self.points if point.flown.falls]
        return Share(sum(not point.flown.area for point in fallen), len(fallen))

    def shares(self, *, told: bool = False) -> dict[str, Share]:
        """Points within ACCURACY, by what was in reach.

        Args:
            told: beside the optimizer that was told when it happened, not the one that knew.
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
        """Ready for ``json.dumps(allow_nan=False)``."""
        return {
            "mission": self.mission,
            "law": self.law,
            "step_s": self.step_s,
            "safe_perigee_altitude_m": self.safe_perigee_altitude_m,
            "accuracy": ACCURACY,
            "nominal": _told(self.nominal),
            "points": len(self.points),
            "wrong": len(self.wrong),
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
    """A map as it is asked for.

    Attributes:
        mission: whose last arc alone is free.
        law: that flies.
        step_s: between times.
    """

    mission: Mission
    law: str
    step_s: float


def _flown_way(mission: Mission, law: str) -> NDArray[np.void]:
    """Navigation states of the flight in which nothing fails, shape (n,), dtype NAVIGATION."""
    simulator = Simulator(mission)
    guidance = ready_law(mission, law)
    states = []
    while not simulator.complete:
        states.append(simulator.navigation.copy())
        guidance.step(simulator.navigation)
        simulator.command(guidance.steering)
        simulator.advance()
    return np.array(states, NAVIGATION)


#: A part of a row: its number, and which of its failures.
_Part = tuple[int, slice]


class MapMaker:
    """Makes a map, part by part, on all cores."""

    def __init__(self, settings: MapSettings):
        """Find the flight in which nothing fails, and what can fail.

        Args:
            settings: what is asked for.

        Raises:
            OptimizerError: a mission whose failures have no time, or that does not arrive.
        """
        self._settings = settings
        self._mission = settings.mission
        self._judge = Judge(self._mission)
        optimizer = Optimizer(self._mission, self._judge)
        self._nominal = optimizer.nominal
        self._rows = failure_rows(
            self._mission, optimizer.cutoff_s, optimizer.drops_s, settings.step_s
        )
        self._way = _flown_way(self._mission, settings.law)
        self._own = threading.local()
        self._points: dict[tuple[int, int], Point] = {}

    @property
    def count(self) -> int:
        """Points of the map."""
        return sum(len(row.failures) for row in self._rows)

    def make(self) -> Generator[int, None, AbortMap]:
        """Work through all points; gives how many are done, and returns the map."""
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
            # what is under way is given up
            patient = False
            raise
        finally:
            pool.shutdown(wait=patient, cancel_futures=True)
        return self._whole()

    def _parts(self) -> Iterator[_Part]:
        for i, row in enumerate(self._rows):
            # from the last on: the later a failure, the less it changes
            for end in range(len(row.failures), 0, -PART):
                yield i, slice(max(0, end - PART), end)

    def _work(self, part: _Part) -> None:
        """One part, from its last failure to its first."""
        i, which = part
        row = self._rows[i]
        if not hasattr(self._own, "optimizer"):
            self._own.optimizer = Optimizer(self._mission, self._judge)
        optimizer: Optimizer = self._own.optimizer
        optimizer.forget()
        numbers = range(which.start, which.stop)
        for k in reversed(numbers):
            self._points[i, k] = self._point(optimizer, row, k)
        if any(self._points[i, k].wrong for k in numbers):
            # another extremal may lead there from the other side
            for k in numbers:
                self._points[i, k] = self._sought_anew(optimizer, self._points[i, k])

    def _point(self, optimizer: Optimizer, row: FailureRow, k: int) -> Point:
        failure, at_s = row.failures[k], row.at_s[k]
        try:
            optimum = optimizer.knew(failure)
            told = optimizer.told(failure, self._state_before(failure, at_s))
            return self._whether_dear(Point(at_s, failure, optimum, told, self._fly(failure)))
        except ValueError as problem:
            error = " ".join(str(problem).split())
            return Point(at_s, failure, NOWHERE, NOWHERE, NOWHERE, error)

    def _sought_anew(self, optimizer: Optimizer, point: Point) -> Point:
        """A point with the better of its optima and those that come from the point before it."""
        if point.error:
            return point
        failure = point.failure
        optimum = better(point.optimum, optimizer.knew(failure))
        told = optimizer.told(failure, self._state_before(failure, point.at_s))
        told = better(point.exact or point.told, told)
        return self._whether_dear(replace(point, optimum=optimum, told=told, exact=None))

    def _whether_dear(self, point: Point) -> Point:
        """Of the last minute, the bound in place of a target that is dear."""
        late = point.at_s > self._nominal.time_s - LATE_S
        burns = point.told.time_s > point.at_s + SAME_TIME
        if not (late and burns and point.optimum.end is End.TARGET):
            return point
        cheap = point.told.m_f_kg >= (1.0 - ACCURACY) * point.optimum.m_f_kg
        if point.told.end is End.TARGET and cheap:
            return point
        return replace(point, told=point.optimum, exact=point.told)

    def _state_before(self, failure: Failure, at_s: float) -> NDArray[np.void]:
        """The last navigation state before a failure, shape (1,); none in which it has dropped."""
        stuck = failure.kind is FailureKind.STUCK_JETTISON
        until = at_s - SAME_TIME if stuck else at_s + SAME_TIME
        i = int(np.searchsorted(self._way["time"], until, side="right")) - 1
        return self._way[i : i + 1]

    def _fly(self, failure: Failure) -> Reached:
        flight = fly_compiled(self._mission, law=self._settings.law, failure=failure)
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
            self._mission.name,
            self._mission.title,
            settings.law,
            settings.step_s,
            self._judge.safe_perigee_altitude_m,
            self._nominal,
            rows,
            outlines(self._mission),
            self._mission.zero_longitude_deg is not None
            and bool(land_on(self._mission.environment.earth.equatorial_radius_m)),
        )
