# SPDX-License-Identifier: Apache-2.0
"""Hold the state of a flight under way for pages that come and go. No ROS.

One thread writes, another reads: every method is safe to call from any.
"""

import math
import threading
import time
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.kernels.environment import altitude
from ares_models.mission import Mission, load_mission
from ares_models.passage import AirState, Passage
from ares_models.plans import flies_in_air
from ares_node.identity import id_text
from ares_studies.event_words import (
    ENDS,
    EVENT_NAMES,
    MARKS,
    MAX_Q,
    Moment,
    air_moments,
    event_name,
    hand_over,
)
from ares_studies.flight_page.charts import ARC_ROLES
from ares_studies.flight_page.data import States, attitude_of, phase_name, states_of
from ares_studies.flight_page.geometry import impact_track
from ares_studies.flight_page.land import land_on

#: Most states, and most guidance statuses, kept of a flight.
MAX_ROWS = 1500
MAX_EVENTS = 500
#: Most texts of diagnostics kept.
MAX_COMPLAINTS = 100
#: Mission whose Earth is used while the flown one is unknown.
_SOME_MISSION = "ares_v"

#: Columns shown of a state: name, source, factor, decimals.
_STATES = (
    ("time_s", "time_s", 1.0, 3),
    ("altitude_km", "altitude_m", 1e-3, 4),
    ("speed_m_s", "speed_m_s", 1.0, 2),
    ("relative_speed_m_s", "relative_speed_m_s", 1.0, 2),
    ("flight_path_angle_deg", "flight_path_angle_deg", 1.0, 4),
    ("pitch_deg", "pitch_deg", 1.0, 3),
    ("yaw_deg", "yaw_deg", 1.0, 3),
    ("mass_t", "mass_kg", 1e-3, 4),
    ("thrust_kn", "thrust_n", 1e-3, 2),
    ("acceleration_m_s2", "acceleration_m_s2", 1.0, 4),
    ("heating_w_m2", "heating_w_m2", 1.0, 4),
    ("perigee_km", "perigee_m", 1e-3, 2),
    ("apogee_km", "apogee_m", 1e-3, 2),
    ("inclination_deg", "inclination_deg", 1.0, 4),
    ("dynamic_pressure_kpa", "dynamic_pressure_pa", 1e-3, 4),
    ("mach", "mach", 1.0, 4),
    ("q_alpha_kpa_rad", "q_alpha_pa_rad", 1e-3, 5),
)
_PLACES = ("latitude_deg", "longitude_deg", "height", "impact_latitude_deg", "impact_longitude_deg")
STATE_FIELDS = (*(name for name, *_ in _STATES), *_PLACES)
STATUS_FIELDS = (
    "time_s",
    "time_to_go_s",
    "cutoff_s",
    "iterations",
    "predicted_altitude_km",
    "predicted_speed_m_s",
)


def _known(value: float, digits: int) -> float | None:
    return round(float(value), digits) + 0.0 if math.isfinite(value) else None


def _moment(time_s: float, text: str, mass_kg: float, mark: str | None) -> dict[str, Any]:
    """Return an event, or what is found beside events, as the page shows it."""
    return {"time_s": _known(time_s, 9), "text": text, "mass_kg": _known(mass_kg, 9), "mark": mark}


def _limits(mission: Mission) -> dict[str, float]:
    """Return the lowest limits of a mission, by the field of a state."""
    kilo = 1e-3
    given = {
        "heating_w_m2": [part.heating_limit_w_m2 for part in mission.jettisons],
        "dynamic_pressure_kpa": [
            stage.max_dynamic_pressure_pa and kilo * stage.max_dynamic_pressure_pa
            for stage in mission.stages
        ],
        "q_alpha_kpa_rad": [
            stage.max_q_alpha_pa_rad and kilo * stage.max_q_alpha_pa_rad for stage in mission.stages
        ],
    }
    known = {name: [value for value in values if value] for name, values in given.items()}
    return {name: min(values) for name, values in known.items() if values}


def _shields(mission: Mission) -> int:
    """Return bits of the parts, by jettison, whose heating limit acts once they are off."""
    limits = [part.heating_limit_w_m2 or math.inf for part in mission.jettisons]
    least = min(limits, default=math.inf)
    return sum(1 << k for k, limit in enumerate(limits) if limit == least < math.inf)


class RowSeries:
    """Hold a bounded series of rows in order, numbered from 0; the last one is always kept.

    When it is full, every second row is dropped and the stride doubles: of the later rows, those
    whose number is a multiple of the stride are kept.
    """

    def __init__(self, most: int = MAX_ROWS) -> None:
        """Start empty; keep `most` rows at most."""
        self.stride = 1
        self.count = 0
        self._most = most
        self._numbers: list[int] = []
        self._rows: list[Sequence[float | None]] = []

    def add(self, row: Sequence[float | None]) -> None:
        """Append a row."""
        if self._numbers and self._numbers[-1] % self.stride:
            self._numbers.pop()
            self._rows.pop()
        self._numbers.append(self.count)
        self._rows.append(row)
        self.count += 1
        if len(self._rows) > self._most:
            self.stride *= 2
            kept = [k for k, n in enumerate(self._numbers[:-1]) if n % self.stride == 0]
            kept.append(len(self._rows) - 1)
            self._numbers = [self._numbers[k] for k in kept]
            self._rows = [self._rows[k] for k in kept]

    def since(self, number: int) -> list[tuple[int, Sequence[float | None]]]:
        """Return the kept rows from a number on, with their numbers."""
        first = bisect_right(self._numbers, number - 1)
        return list(zip(self._numbers[first:], self._rows[first:], strict=True))


@dataclass(frozen=True)
class Seen:
    """Hold what a page has received: the flight, and the number of items of each kind."""

    flight: int = -1
    states: int = 0
    statuses: int = 0
    events: int = 0
    complaints: int = 0
    about: int = -1


class Story:
    """Hold the flight shown."""

    def __init__(self) -> None:
        """Start without a flight."""
        self._lock = threading.RLock()
        self._flight = 0
        self._about_version = 0
        self._controls = False
        self._begin(0, None)

    def _begin(self, flight_id: int, mission: Mission | None) -> None:
        self.flight_id = flight_id
        self._mission = mission or load_mission(_SOME_MISSION)
        self._environment = self._mission.environment_array()[0]
        self._mission_known = mission is not None
        self._states, self._statuses = RowSeries(), RowSeries()
        self._events: list[dict[str, Any]] = []
        self._heard: list[tuple[int, int, float, float]] = []
        self._complaints: dict[tuple[str, str, str], list[Any]] = {}
        self._complaint_version = 0
        self._phases: list[dict[str, Any]] = []
        self._phase: tuple[int, int] | None = None
        self._heard_at: float | None = None
        self._shields = _shields(self._mission)
        self._air = mission is not None and flies_in_air(mission.arrays().arcs)
        self._passage = Passage()
        self._boosts = False
        self._hand_over: list[Moment] = []
        self._about: dict[str, Any] = {
            "title": mission.title if mission else "A flight",
            "flight": id_text(flight_id) if flight_id else "",
            "law": "",
            "land": bool(land_on(self._mission.environment.earth.equatorial_radius_m)),
            "limits": _limits(mission) if mission else {},
            # limits that do not act yet
            "idle": ["heating_w_m2"] if self._shields else [],
            "air": self._air,
            "in_air": self._air,
            "left_air_s": None,
            "guidance": "",
            "moments": [],
            "pace": None,
            "paused": False,
            "replayed": False,
            "rate": None,
            "end": "",
            "verdict": "",
            "good": False,
            "shortcomings": [],
            "exit_status": "",
            "report": "",
            "no_report": "",
            "note": "",
        }

    # ---- written by the node

    def begin(self, flight_id: int, mission: Mission | None, note: str = "") -> None:
        """Replace the flight by a new one.

        Args:
            flight_id: its identity.
            mission: flown mission; None: unknown.
            note: remark for the reader, one sentence.
        """
        with self._lock:
            self._begin(flight_id, mission)
            self._flight += 1
            self._update(note=note)

    def learn(self, mission: Mission) -> None:
        """Restart the story with the mission of the flight, announced late; keep the events.

        Args:
            mission: flown mission.
        """
        with self._lock:
            heard, complaints = self._heard, self._complaints
            self.begin(self.flight_id, mission)
            self._complaints = complaints
            for event in heard:
                self.add_event(*event)

    @property
    def mission_known(self) -> bool:
        """Return True once the mission of the flight is known."""
        return self._mission_known

    def _update(self, **words: Any) -> None:
        if any(self._about[name] != word for name, word in words.items()):
            self._about |= words
            self._about_version += 1

    def update(self, **words: Any) -> None:
        """Update facts about the flight.

        Args:
            words: `law`, `pace`, `paused`, `replayed`, `rate`; at its end `verdict`, `good`,
                `shortcomings`, `exit_status`; `report`, the command for its report, or
                `no_report`, the reason why there is none.
        """
        with self._lock:
            self._update(**words)

    def set_controllable(self, controls: bool) -> None:
        """Set whether a node accepts pause and pace."""
        with self._lock:
            if controls != self._controls:
                self._controls = controls
                self._about_version += 1

    def add_states(self, truth: Mapping[str, NDArray[Any]]) -> None:
        """Add states, in order.

        Args:
            truth: columns of VehicleState, with `time` in s and `sequence`.
        """
        mission = self._mission
        earth = mission.earth()
        shown = states_of(truth, mission)
        # the first state precedes the first command, so its attitude is unknown
        for values in attitude_of(shown):
            values[truth["sequence"] == 0] = math.nan
        falls = impact_track(
            truth["time"], truth["position"], truth["velocity"], self._environment, earth
        )
        found = {field: getattr(shown, name) * factor for field, name, factor, _ in _STATES}
        if self._air:
            # in the air heating is not that of single molecules
            found["heating_w_m2"][self._follow_air(shown)] = math.nan
        columns = [(found[field], digits) for field, *_, digits in _STATES]
        columns += [(shown.track.latitude_deg, 4), (shown.track.longitude_deg, 4)]
        columns += [(shown.altitude_m / earth.equatorial_radius, 6)]
        columns += [(falls.latitude_deg, 3), (falls.longitude_deg, 3)]
        with self._lock:
            for i in range(len(truth["time"])):
                self._states.add([_known(values[i], digits) for values, digits in columns])
                self._note_phase(truth, i)
            self._heard_at = time.monotonic()

    def _follow_air(self, shown: States) -> NDArray[np.bool_]:
        """Follow the climb through the air; tell which states are in it, shape (n,)."""
        columns = [getattr(shown, item.name).tolist() for item in fields(AirState)]
        in_air = []
        with self._lock:
            for numbers in zip(*columns, strict=True):
                self._passage.add(AirState(*numbers))
                in_air.append(self._passage.left_s is None)
            self._update(in_air=in_air[-1], left_air_s=self._passage.left_s)
            self._show_moments()
        return np.array(in_air)

    def set_passage(self, passage: Passage) -> None:
        """Put what the simulator tells of the climb in place of what is found in some states."""
        with self._lock:
            self._passage.mach_1, self._passage.max_q = passage.mach_1, passage.max_q
            self._passage.beyond_max_q = True
            self._show_moments()

    def _show_moments(self) -> None:
        """Show Mach 1, the hand-over, and the greatest dynamic pressure once it is past."""
        found = air_moments(self._passage) + self._hand_over
        self._update(
            moments=[
                _moment(moment.time_s, moment.text, moment.mass_kg, MARKS.get(moment.kind))
                for moment in found
                if moment.kind != MAX_Q or self._passage.beyond_max_q
            ]
        )

    def _note_phase(self, truth: Mapping[str, NDArray[Any]], i: int) -> None:
        """Start a new phase when the arc or the set of jettisoned parts changes."""
        now = int(truth["arc"][i]), int(truth["jettisoned"][i])
        if now[1] & self._shields:
            self._update(idle=[])
        if now != self._phase:
            self._phase = now
            name = phase_name(*now, self._mission) if self._mission_known else f"arc {now[0]}"
            self._phases.append({"name": name, "role": None, "from_s": float(truth["time"][i])})
            self._about_version += 1
        phase = self._phases[-1]
        if phase["role"] is None and truth["thrust"][i] > 0.0:
            burns = sum(1 for one in self._phases if one["role"])
            phase["role"] = ARC_ROLES[burns % len(ARC_ROLES)]
            self._about_version += 1

    def add_status(
        self, row: Mapping[str, float], position: Any, velocity: Any, *, boosts: bool = False
    ) -> None:
        """Add a guidance status.

        Args:
            row: `time_s`, `time_to_go_s`, `cutoff_s`, `iterations`.
            position: predicted at cut-off, shape (3,), m.
            velocity: predicted at cut-off, shape (3,), m/s.
            boosts: guidance flies the attitude programme of the air.
        """
        x, y, z = position
        height = altitude((float(x), float(y), float(z)), self._environment)
        speed = float(np.linalg.norm(velocity))
        numbers = {**row, "predicted_altitude_km": height / 1e3, "predicted_speed_m_s": speed}
        with self._lock:
            self._statuses.add([_known(numbers[name], 4) for name in STATUS_FIELDS])
            if self._boosts and not boosts:
                self._hand_over = [hand_over(row["time_s"], math.nan)]
                self._show_moments()
            self._boosts = boosts
            if self._air:
                self._update(guidance="boost programme" if boosts else "closed loop")

    def add_event(self, kind: int, index: int, moment: float, mass_kg: float) -> None:
        """Add an event: type, index, flight time, s, mass after it, kg."""
        mission = self._mission
        names: tuple[Sequence[str], Sequence[str], Sequence[str]] = ((), (), ())
        if self._mission_known:
            names = mission.arc_names, mission.stage_names, mission.jettison_names
        with self._lock:
            if len(self._events) >= MAX_EVENTS:
                return
            self._heard.append((kind, index, moment, mass_kg))
            text = event_name(kind, index, *names, mission.held_s)
            self._events.append(_moment(moment, text, mass_kg, MARKS.get(kind)))
            if kind in ENDS:
                self._update(end=EVENT_NAMES[kind])

    def add_complaint(self, moment: float, level: str, node: str, text: str) -> None:
        """Add a warning or an error of a node; each text is stored once, with its count."""
        with self._lock:
            known = self._complaints.get((level, node, text))
            if known is None and len(self._complaints) < MAX_COMPLAINTS:
                known = self._complaints[level, node, text] = [moment, 0]
            if known is not None:
                known[1] += 1
            self._complaint_version += 1

    # ---- read by the server

    @property
    def ended(self) -> bool:
        """Return whether the end of the flight was seen."""
        return bool(self._about["end"])

    @property
    def judged(self) -> bool:
        """Return True once the verdict has arrived."""
        return bool(self._about["verdict"])

    def age(self) -> float | None:
        """Return the wall time since the last state, s; None before the first."""
        heard = self._heard_at
        return None if heard is None else time.monotonic() - heard

    def news(self, seen: Seen) -> tuple[dict[str, Any] | None, Seen]:
        """Return what a page lacks; None if nothing.

        Args:
            seen: what it has received.

        Returns:
            The message, and what the page has received after it.
        """
        with self._lock:
            whole = seen.flight != self._flight
            if whole:
                seen = Seen()
            now = Seen(
                self._flight,
                self._states.count,
                self._statuses.count,
                len(self._events),
                self._complaint_version,
                self._about_version,
            )
            if now == seen:
                return None, seen
            message: dict[str, Any] = {
                "kind": "flight" if whole else "update",
                "age_s": self.age(),
                "states": self._states.since(seen.states),
                "statuses": self._statuses.since(seen.statuses),
                "strides": [self._states.stride, self._statuses.stride],
                "events": self._events[seen.events :],
            }
            if whole or now.complaints != seen.complaints:
                message["complaints"] = [
                    {"time_s": first, "count": count, "level": level, "node": node, "text": text}
                    for (level, node, text), (first, count) in self._complaints.items()
                ]
            if whole or now.about != seen.about:
                message["about"] = {
                    **self._about,
                    "controls": self._controls,
                    "phases": self._phases,
                }
            return message, now
